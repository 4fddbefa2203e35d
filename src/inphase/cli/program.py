"""How this program was called, for commands that can be pasted."""

from __future__ import annotations

import shlex
import shutil
import sys
from pathlib import Path


def program() -> str:
    """The first words of such a command: the program need not be on the path, as under `make demo`."""
    called = sys.argv[0]
    if Path(called) == Path(__file__).with_name("__main__.py"):
        return f"{shlex.quote(sys.executable)} -m inphase.cli"
    return shlex.quote(called) if Path(called).stem == "inphase" and shutil.which("inphase") != called else "inphase"
