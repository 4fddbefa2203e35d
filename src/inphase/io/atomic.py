"""Files that are written whole or not at all."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path

from inphase.errors import OptionError


@contextmanager
def whole_file(path: str | PathLike[str], *, new: bool = False) -> Iterator[Path]:
    """A temporary path beside `path`, moved there when the block ends well and removed when it does not.

    new: never in the place of another file; where one has come there meanwhile, FileExistsError is raised. Raises
    OptionError where the folder does not exist or cannot be written to.
    """
    target = check_target(path)
    try:
        # Same folder, so that the move is one step; same suffix, because writers of pictures go by it.
        handle, name = tempfile.mkstemp(prefix=f".{target.stem}-", suffix=target.suffix, dir=target.parent)
    except OSError as error:
        raise OptionError(f"cannot write {target}: {error.strerror}") from None
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())  # mkstemp makes files that only their owner can read
        (_move_if_new if new else os.replace)(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def check_target(path: str | PathLike[str]) -> Path:
    """The path, if a file can be written there; worth asking before long work. Raises OptionError."""
    target = Path(path)
    try:
        is_there, is_folder = target.parent.is_dir(), target.is_dir()
    except OSError as error:  # as for a folder that may not be entered
        raise OptionError(f"cannot write {target}: {error.strerror}") from None
    if not is_there:
        raise OptionError(f"cannot write {target}: expected the folder {target.parent} to exist")
    if is_folder:
        raise OptionError(f"cannot write {target}: expected a file name, got a folder")
    return target


def _move_if_new(temporary: Path, target: Path) -> None:
    try:
        os.link(temporary, target)  # in one step, and only where nothing is
    except FileExistsError:
        raise
    except OSError:  # a disk that knows no links
        if os.path.lexists(target):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target)) from None
        os.replace(temporary, target)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
