"""A local page for the whole way from recordings to a model in use; its actions are command lines of inphase.

Its modules need bokeh, and are imported only by `inphase studio`.
"""

from __future__ import annotations

import os


def forget_settings() -> None:
    """Drop what the shell says of other pages of bokeh, which goes by it from when it is imported.

    It may open a page to others, or have it load its scripts from elsewhere.
    """
    for name in [name for name in os.environ if name.startswith("BOKEH_")]:
        del os.environ[name]
