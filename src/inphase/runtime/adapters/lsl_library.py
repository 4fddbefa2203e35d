"""The library of the lab streaming layer, loaded so that it looks for streams where it was told to.

It reads its settings once, for the whole process: those of this machine alone come from a file that is written for it
(`LSLAPICFG`) before it is loaded. A file that the user has set up is left alone and decides.
"""

from __future__ import annotations

import atexit
import os
import tempfile
from pathlib import Path
from typing import Any

from inphase.errors import OptionError, listing

LOOPBACK = """[ports]
IPv6 = disable
[multicast]
ResolveScope = machine
ListenAddress = 127.0.0.1
[lab]
KnownPeers = {127.0.0.1}
[log]
level = -3
"""
SCOPES = ("machine", "network")
OWN_FILES = (Path("lsl_api.cfg"), Path("~/lsl_api/lsl_api.cfg"), Path("/etc/lsl_api/lsl_api.cfg"))

_scope: str | None = None  # what liblsl was loaded with


def load_lsl(scope: str = "machine") -> Any:
    """The library `pylsl`, which looks for streams in that scope; raises OptionError where it is missing or differs."""
    global _scope
    if scope not in SCOPES:
        raise OptionError(f"scope: expected one of {listing(SCOPES)}, got {scope!r}")
    if _scope not in (None, scope):
        raise OptionError(f"scope: expected {_scope!r}, as another LSL device of this process has, got {scope!r}")
    own = "LSLAPICFG" in os.environ or any(file.expanduser().exists() for file in OWN_FILES)
    if _scope is None and scope == "machine" and not own:
        handle, path = tempfile.mkstemp(prefix="inphase-lsl-", suffix=".cfg")
        with os.fdopen(handle, "w") as file:
            file.write(LOOPBACK)
        os.environ["LSLAPICFG"] = path
        atexit.register(Path(path).unlink, missing_ok=True)
    try:
        import pylsl
    except ImportError:
        raise OptionError("LSL needs pylsl: pip install 'inphase[lsl]'") from None
    except (RuntimeError, OSError) as error:
        where = "https://github.com/sccn/liblsl/releases"
        raise OptionError(f"pylsl found no liblsl: install it ({where}) and name it in PYLSL_LIB: {error}") from None
    _scope = scope
    return pylsl
