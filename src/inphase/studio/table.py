"""Tables whose rows can be sorted and marked; what stands in them is shown as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from bokeh.models import ColumnDataSource
from bokeh.models.widgets import DataTable, NumberFormatter, StringFormatter, TableColumn

HEAD, ROW = 45, 25  # [px], with room for a bar that scrolls


def make_table(columns: Mapping[str, tuple[str, int, int | None]], height: int, **options: Any) -> DataTable:
    """An empty table, as high as its rows and `height` at most.

    columns: by the names of the data, the title, the width [px], and of numbers how many decimals are shown, at most;
    None for text. A NaN is shown as nothing.
    """
    return DataTable(
        source=ColumnDataSource({name: [] for name in columns}),
        columns=[
            TableColumn(field=name, title=title, width=width, formatter=_formatter(decimals))
            for name, (title, width, decimals) in columns.items()
        ],
        index_position=None,
        reorderable=False,
        height=height,
        tags=[height, 0],  # and how often it was filled
        min_width=sum(width for _, width, _ in columns.values()),
        sizing_mode="stretch_width",
        **options,
    )


def fill(table: DataTable, data: Mapping[str, Sequence[Any]]) -> None:
    """Show these rows, by column."""
    source: Any = table.source
    source.data = dict(data)
    highest, before = table.tags
    rows = max(map(len, data.values()), default=0)
    # As many rows as before are not drawn anew by themselves; any change of the table itself has that done.
    table.update(height=min(highest, HEAD + ROW * max(rows, 1)), tags=[highest, before + 1])


def _formatter(decimals: int | None) -> StringFormatter | NumberFormatter:
    if decimals is None:
        return StringFormatter()
    return NumberFormatter(format=f"0.[{'0' * decimals}]" if decimals else "0", nan_format="", text_align="right")
