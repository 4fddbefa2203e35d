"""The page: a template filled with figures, numbers, style and script, all in one file."""

from __future__ import annotations

import html
from collections.abc import Sequence
from functools import lru_cache
from os import PathLike
from pathlib import Path

from inphase.errors import OptionError
from inphase.io.atomic import whole_file
from inphase.report.account import Account
from inphase.report.page.figures import RUNS, SLOTS, make_figures
from inphase.report.page.payload import MOST_NUMBERS, as_script, payload

HERE = Path(__file__).parent
SCRIPTS = (
    "numbers.js",
    "run.js",
    "drawing.js",
    "cursor.js",
    "plots.js",
    "belief.js",
    "tables.js",
    "colours.js",
    "page.js",
)


def write_page(path: str | PathLike[str], accounts: Sequence[Account], title: str | None = None) -> None:
    """Write the report of one or several runs into one file, whole or not at all.

    Raises OptionError where bokeh is not installed, there is no run or there are too many, or the file cannot be
    written.
    """
    text = make_page(accounts, title)
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def check_page() -> None:
    """Raise OptionError where no page can be made: before the work of which it is to tell."""
    try:
        import bokeh  # noqa: F401
    except ImportError:
        raise OptionError("reports need bokeh: pip install 'inphase[studio]'") from None


def make_page(accounts: Sequence[Account], title: str | None = None) -> str:
    """The page as text; raises OptionError as `write_page`."""
    check_page()
    if not 1 <= len(accounts) <= RUNS:
        raise OptionError(f"expected 1 to {RUNS} runs in a report, got {len(accounts)}")
    from bokeh.embed import components
    from bokeh.resources import Resources

    told = [payload(account, MOST_NUMBERS // len(accounts)) for account in accounts]
    script, places = components(make_figures(len(accounts)), wrap_script=False)
    data = "\n".join(
        f'<script type="application/octet-stream" id="numbers-{i}">{numbers}</script>'
        for i, (_, numbers) in enumerate(told)
    )
    heading = title or " · ".join(dict.fromkeys(account.title for account in accounts))
    parts = {
        "title": html.escape(heading),
        "style": _text("style.css"),
        "bokeh": "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw),
        "runs": as_script({"title": heading, "slots": SLOTS, "runs": [description for description, _ in told]}),
        "numbers": data,
        "figures": script,
        "script": "\n".join(_text(name) for name in SCRIPTS),
        "observed": _places(places, "observed"),
        "controlled": _places(places, "controlled"),
        "compared": _places(places, "compared"),
        **{name: places[name] for name in ("phase", "tempo", "likelihood")},
    }
    page = _text("template.html")
    pieces = page.split("{{")
    filled = [pieces[0]]
    for piece in pieces[1:]:
        name, rest = piece.split("}}", 1)
        filled += [parts[name], rest]
    return "".join(filled)


def _places(places: dict[str, str], kind: str) -> str:
    """The figures of a kind, each in the frame that the script gives a heading and a table."""
    return "\n".join(
        f'<figure class="plot" data-plot="{name}"><figcaption></figcaption>{place}</figure>'
        for name, place in places.items()
        if name.startswith(f"{kind}-")
    )


@lru_cache
def _text(name: str) -> str:
    return (HERE / name).read_text(encoding="utf-8")
