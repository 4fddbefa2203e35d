"""The groups of channels that are scaled together, and what they are scaled by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from inphase.channels import Channel, Kind
from inphase.errors import listing
from inphase.model import Model
from inphase.preprocess import Coordinates, Scaling
from inphase.trajectory import Dataset


def groups_of_dataset(dataset: Dataset) -> list[dict[str, Any]]:
    """What the groups of a data set will be scaled by."""
    coordinates = Coordinates.learn(dataset.channels, [d.values for d in dataset])
    features = [coordinates.from_channels(d.values) for d in dataset]
    everything = np.concatenate(features)
    low, high = (f.reduce(everything, axis=0) for f in (np.fmin, np.fmax))
    return _groups(coordinates, Scaling.learn(coordinates.groups, features), low, high)


def groups_of_model(model: Model) -> list[dict[str, Any]]:
    """What the groups of a model are scaled by."""
    return _groups(model.coordinates, model.scaling, model.scaling.low, model.scaling.high)


def _groups(coordinates: Coordinates, scaling: Scaling, low: np.ndarray, high: np.ndarray) -> list[dict[str, Any]]:
    """A group each: its channels and their unit, from where to where they go, and the span that becomes 1 long.

    Angles and the rotation vectors of quaternions are in [rad] from the mean of all demonstrations.
    """
    found = []
    for group in dict.fromkeys(coordinates.groups):
        members = [f for f, other in enumerate(coordinates.groups) if other == group]
        positions = sorted({i for f in members for i in coordinates.channel_of[f]})
        channels = [coordinates.channels[i] for i in positions]
        known = [f for f in members if np.isfinite(low[f])]
        found.append(
            {
                "group": group,
                "unit": _unit(channels),
                "channels": [channel.name for channel in channels],
                "low": float(low[known].min()) if known else None,
                "high": float(high[known].max()) if known else None,
                "span": float(scaling.span[members].max()),
            }
        )
    return found


def print_groups(console: Console, groups: Sequence[dict[str, Any]]) -> None:
    """A group a row."""
    table = Table(box=None, pad_edge=False)
    titles = ["scaled together", "unit", "from", "to", "1 long", "channels"]
    if not any(row["unit"] for row in groups):
        titles.remove("unit")
    for title in titles:
        text = title in ("scaled together", "unit", "channels")
        table.add_column(title, justify="left" if text else "right", no_wrap=not text, overflow="fold")
    for row in groups:
        cells = {
            "scaled together": row["group"],
            "unit": row["unit"],
            "from": "–" if row["low"] is None else f"{row['low']:.3g}",
            "to": "–" if row["high"] is None else f"{row['high']:.3g}",
            "1 long": f"{row['span']:.3g}",
            "channels": listing(row["channels"], 6),
        }
        table.add_row(*(cells[title] for title in titles))
    console.print(table, soft_wrap=False)


def _unit(channels: Sequence[Channel]) -> str:
    if any(channel.kind is Kind.QUATERNION for channel in channels):
        return "rad"
    return " or ".join(dict.fromkeys(channel.unit for channel in channels if channel.unit))
