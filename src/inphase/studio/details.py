"""A table under a figure, folded until it is asked for: the same figures for who cannot tell colours or shapes."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from bokeh.models import InlineStyleSheet
from bokeh.models.widgets import Div

MOST = 400  # rows: more is for a file
STYLE = """
:host { overflow-x: auto; }
summary { cursor: pointer; color: var(--accent); padding: 4px 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 13px; }
th, td { text-align: left; padding: 2px 14px 2px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
th { font-weight: 600; } td.number, th.number { text-align: right; white-space: nowrap; }
"""


def details(summary: str, titles: Sequence[str], rows: Sequence[Sequence[object]]) -> Div:
    """A folded table, of which nothing is taken for markup; numbers (float, int) stand on the right."""
    numbers = [bool(rows) and all(isinstance(row[i], (int, float)) for row in rows) for i in range(len(titles))]
    kinds = [' class="number"' if number else "" for number in numbers]
    head = "".join(f'<th scope="col"{kind}>{escape(title)}</th>' for title, kind in zip(titles, kinds, strict=True))
    body = "".join(
        "<tr>"
        + "".join(f"<td{kind}>{escape(_cell(cell))}</td>" for cell, kind in zip(row, kinds, strict=True))
        + "</tr>"
        for row in rows[:MOST]
    )
    more = f"<p>… and {len(rows) - MOST} more rows</p>" if len(rows) > MOST else ""
    return Div(
        text=f"<details><summary>{escape(summary)}</summary>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}</details>",
        disable_math=True,
        sizing_mode="stretch_width",
        stylesheets=[InlineStyleSheet(css=STYLE)],
    )


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
