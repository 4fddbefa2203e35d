"""`inphase studio`: see recordings, train a model, try it and watch it live, in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from inphase.cli.console import Output
from inphase.errors import OptionError
from inphase.studio import forget_settings

Flag = Annotated[bool, tyro.conf.arg(help_behavior_hint="")]


def studio(
    folder: tyro.conf.Positional[Path] = Path(),
    port: int = 0,
    open_: Annotated[bool, tyro.conf.arg(name="open", help_behavior_hint="")] = False,
) -> int:
    """See recordings, train a model, try it and watch it live, in a browser. Ctrl-C ends it.

    It is served to this computer alone, at an address that nobody can guess; it is printed. Whatever is done there is a
    command line of inphase, which is shown.

    Args:
        folder: where the recordings and models are
        port: of the address; 0 for one that is free
        open_: open the address in a browser
    """
    if not folder.is_dir():
        raise OptionError(f"{folder}: no such folder")
    if not 0 <= port < 65536:
        raise OptionError(f"--port: expected 0 to 65535, got {port}")
    forget_settings()
    try:
        import bokeh  # noqa: F401
    except ImportError:
        raise OptionError("the studio needs bokeh: pip install 'inphase[studio]'") from None
    from inphase.studio.server import Studio

    console = Output()
    with Studio(folder, port) as served:
        console.print(f"studio of {folder.resolve()}, for this computer alone; Ctrl-C ends it\n{served.address}")
        if open_:
            import webbrowser

            webbrowser.open(served.address)
        served.run()
    console.print("studio ended")
    return 0
