"""The messages of a bag, one by one, and all that kept others from being read. Needs `rosbags`, and no ROS."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from inphase.errors import DataError, OptionError, listing
from inphase.io.files import natural
from inphase.runtime.adapters.bag_chunks import LARGEST, unpack
from inphase.runtime.adapters.bag_records import BagDamage, Connection, read_records

SUFFIXES = (".db3", ".mcap", ".db3.zstd", ".mcap.zstd")  # the files in the folder of a bag of ROS 2
ZSTD = b"(\xb5/\xfd"  # how something packed begins, as neither a bag nor a message does
BROKEN = (ValueError, LookupError, TypeError, AttributeError, OverflowError, MemoryError, RecursionError, SyntaxError)


class Bag:
    """A bag of ROS 1 or 2: a .bag, .db3 or .mcap file, or a folder of the latter. Each walk through it reads it anew.

    topics: those whose messages are wanted; all unless told. After a walk, `connections` is what there is, `broken`
    counts the messages of a topic that could not be unpacked, with `why` of the first, `problems` says why no message
    of a type can be, and `damage` where the walk ended early. Raises OptionError where `rosbags` is not installed,
    DataError for what is not there or no bag.
    """

    def __init__(self, path: str | Path, topics: Collection[str] | None = None) -> None:
        if find_spec("rosbags") is None:
            raise OptionError("reading bags needs rosbags: pip install 'inphase[bags]'")
        self.path, self.files = Path(path), _files(Path(path))
        self.topics = topics
        self._forget()

    def _forget(self) -> None:
        self.connections: list[Connection] = []
        self.broken: Counter[str] = Counter()
        self.why: dict[str, str] = {}
        self.problems: dict[str, str] = {}
        self.damage = ""
        self._unpackers: dict[Connection, Callable[[bytes], Any] | None] = {}

    def packed(self) -> Iterator[tuple[Connection, int, bytes]]:
        """Connection, time of receipt [ns] and bytes of every message, in the order in which they lie in the files."""
        self._forget()
        for file in self.files:
            last = ""
            try:
                with _plain(file) as plain:
                    for record in read_records(plain, self.topics):
                        if isinstance(record, Connection):
                            self.connections += [] if record in self.connections else [record]
                        elif self.topics is None or record[0].topic in self.topics:
                            last = f", after its message at {record[1] * 1e-9:.3f} s"
                            yield record
            except DataError as error:
                raise DataError(f"{file}: {error}") from None
            except BagDamage as damage:
                self.damage = f"{file.name} is damaged{last}: {damage}"

    def messages(self) -> Iterator[tuple[Connection, int, Any]]:
        """Connection, time of receipt [ns] and message, of all that can be unpacked."""
        for connection, time, data in self.packed():
            message = self.unpack(connection, data)
            if message is not None:
                yield connection, time, message

    def unpack(self, connection: Connection, data: bytes) -> Any | None:
        """The message of its bytes; None, and noted why, where it cannot be unpacked."""
        from rosbags.serde import SerdeError

        if connection not in self._unpackers:
            try:
                kind = connection.type, connection.encoding, connection.format, connection.definition
                self._unpackers[connection] = unpacker(*kind)
            except DataError as error:
                self._unpackers[connection] = None
                self.problems[connection.topic] = str(error)
        unpacked = self._unpackers[connection]
        if unpacked is None:
            return None
        try:
            return unpacked(unpack("zstd", data, LARGEST) if data[:4] == ZSTD else data)
        except (SerdeError, *BROKEN) as error:
            self.broken[connection.topic] += 1
            self.why.setdefault(connection.topic, " ".join(str(error).split()) or type(error).__name__)
            return None


@lru_cache(maxsize=64)  # to make one takes some milliseconds, and bags of one robot have the same
def unpacker(type: str, encoding: str, format: str = "", definition: str = "") -> Callable[[bytes], Any]:
    """What makes a message of bytes; raises DataError where the type is not known, or written as nothing of ROS."""
    from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
    from rosbags.typesys.msg import normalize_msgtype

    if encoding not in ("ros1", "cdr"):
        raise DataError(f"expected messages encoded as ros1 or cdr, got {encoding or 'nothing'!r}")
    try:
        name = normalize_msgtype(type)
        if definition and format in ("ros1msg", "ros2msg", "ros2idl"):
            store = get_typestore(Stores.EMPTY)
            if format == "ros2idl":
                for part in re.split(r"^=+\nIDL: .*\n", definition, flags=re.MULTILINE):
                    if part.strip():
                        store.register(get_types_from_idl(part))
            else:
                store.register(get_types_from_msg(definition, name))
        else:  # older bags of ROS 2 hold no definitions, and all have these
            store = get_typestore(Stores.LATEST)
            if name not in store.types:
                raise DataError(f"the bag has no definition of {type}, which is none of ROS's own types")
        store.get_msgdef(name)
    except (TypesysError, *BROKEN) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(f"the definition of {type} in the bag cannot be used: {error!r}") from None
    return partial(store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr, typename=name)


def _files(path: Path) -> list[Path]:
    """The files of a bag in the order in which they were written."""
    if not path.exists():
        raise DataError(f"{path}: no such bag")
    if not path.is_dir():
        return [path]
    try:
        files = natural(file for file in path.iterdir() if file.name.endswith(SUFFIXES) and file.name[0] != ".")
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    if not files:
        raise DataError(f"{path}: expected the folder of one bag, with .db3 or .mcap files in it, got none")
    if len(files) > 1 and not (path / "metadata.yaml").exists():  # several recordings, as likely as one in parts
        found = listing(file.name for file in files)
        raise DataError(f"{path}: expected the folder of one bag, with a metadata.yaml; name its files: {found}")
    return files


@contextmanager
def _plain(file: Path) -> Iterator[Path]:
    """The file, unpacked into a temporary one where it was packed as a whole."""
    if file.suffix != ".zstd":
        yield file
        return
    import zstandard

    with tempfile.TemporaryDirectory(prefix="inphase-") as folder:
        plain = Path(folder) / file.stem
        try:
            with file.open("rb") as packed, plain.open("wb") as target:
                shutil.copyfileobj(zstandard.ZstdDecompressor().stream_reader(packed), target)
        except zstandard.ZstdError:
            pass  # what was unpacked by then is read, and found to be cut short
        yield plain
