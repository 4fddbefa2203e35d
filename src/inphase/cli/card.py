"""A model or a data set in a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from inphase.cli.basis_text import show_basis
from inphase.cli.console import counted
from inphase.cli.evidence import describe_evidence, summary
from inphase.cli.groups import groups_of_dataset, groups_of_model, print_groups
from inphase.model import Model
from inphase.trajectory import Dataset

LITTLE_TRUST = 0.1


def describe_model(model: Model) -> dict[str, Any]:
    """What a model holds, as plain values for people and machines."""
    noise_std = np.sqrt(model.scaling.unscale_var(model.noise.var))
    phase_std = np.sqrt(np.diag(model.phase.cov))
    features = [
        {
            "feature": name,
            "role": model.channels[positions[0]].role.value,
            "unit": model.channels[positions[0]].unit,
            "kind": model.channels[positions[0]].kind.value,
            "group": group,
            "basis": show_basis(basis),
            "low": float(low),
            "high": float(high),
            "noise_std": float(std),
            "noise_correlation_time": float(time),
        }
        for name, positions, group, basis, low, high, std, time in zip(
            model.coordinates.names,
            model.coordinates.channel_of,
            model.coordinates.groups,
            model.layout.bases,
            model.scaling.low,
            model.scaling.high,
            noise_std,
            model.noise.correlation_time,
            strict=True,
        )
    ]
    return {
        "observed": list(model.observed),
        "controlled": list(model.controlled),
        "demonstrations": len(model.prior.samples),
        "weights": model.layout.size,
        "trust": model.prior.trust,
        "typical_duration": 1 / model.phase.nominal_velocity,
        "tempo_std": float(phase_std[1] / model.phase.nominal_velocity) if len(phase_std) > 1 else None,
        "order": model.phase.order,
        "periodic": model.phase.periodic,
        "evidence": describe_evidence(model.evidence),
        "provenance": dict(model.provenance),
        "features": features,
        "groups": groups_of_model(model),
    }


def print_model(console: Console, model: Model) -> None:
    """The model's card."""
    card = describe_model(model)
    tempo = f", tempo ± {100 * card['tempo_std']:.0f} %" if card["tempo_std"] is not None else ""
    console.print(
        f"{len(card['observed'])} observed and {len(card['controlled'])} controlled channels, "
        f"{card['demonstrations']} demonstrations, {card['weights']} basis weights\n"
        f"typical duration {card['typical_duration']:.2f} s{tempo}, phase of order {card['order']}"
        f"{', periodic' if card['periodic'] else ''}\n" + _trust_in_words(card["trust"])
    )
    console.print(summary(model))
    rows = [
        {
            "channel": row["feature"],
            "role": row["role"],
            "unit": row["unit"],
            "kind": row["kind"].replace("linear", ""),
            "basis": row["basis"],
            "from": f"{row['low']:.3g}",
            "to": f"{row['high']:.3g}",
            "noise ±": f"{row['noise_std']:.2g}",
            "lasts [s]": f"{row['noise_correlation_time']:.2g}",
        }
        for row in card["features"]
    ]
    console.print(_table(rows, numbers=("from", "to", "noise ±", "lasts [s]")), soft_wrap=False)
    console.print()
    print_groups(console, card["groups"])


def _trust_in_words(trust: float) -> str:
    if trust < LITTLE_TRUST:
        return "the partner's movement tells nothing of the controlled one: only its timing"
    return f"what the partner's movement tells of the controlled one: believed to {100 * trust:.0f} %"


def describe_dataset(dataset: Dataset) -> dict[str, Any]:
    """What a data set holds, as plain values for people and machines."""
    everything = np.concatenate([d.values for d in dataset])
    return {
        "episodes": [
            {"name": d.name, "samples": len(d), "duration": d.duration, "rate": 1 / float(np.median(np.diff(d.times)))}
            for d in dataset
        ],
        "channels": [
            {
                "name": c.name,
                "role": c.role.value,
                "unit": c.unit,
                "kind": c.kind.value,
                "group": c.group,
                "low": float(np.nanmin(column)) if np.isfinite(column).any() else None,
                "high": float(np.nanmax(column)) if np.isfinite(column).any() else None,
                "missing": float(np.isnan(column).mean()),
            }
            for c, column in zip(dataset.channels, everything.T, strict=True)
        ],
        "groups": groups_of_dataset(dataset),
    }


def print_dataset(console: Console, dataset: Dataset) -> None:
    """The data set's card."""
    card = describe_dataset(dataset)
    durations = [episode["duration"] for episode in card["episodes"]]
    rates = [episode["rate"] for episode in card["episodes"]]
    samples = sum(episode["samples"] for episode in card["episodes"])
    console.print(
        f"{counted(len(durations), 'episode')} of {_range(durations)} s at {_range(rates)} Hz, "
        f"{counted(samples, 'sample')}"
    )
    rows = [
        {
            "channel": row["name"],
            "role": row["role"],
            "kind": row["kind"].replace("linear", ""),
            "group": row["group"],
            "from": "–" if row["low"] is None else f"{row['low']:.4g}",
            "to": "–" if row["high"] is None else f"{row['high']:.4g}",
            "missing": f"{100 * row['missing']:.1f} %" if row["missing"] else "",
        }
        for row in card["channels"]
    ]
    console.print(_table(rows, numbers=("from", "to", "missing")), soft_wrap=False)
    console.print()
    print_groups(console, card["groups"])


def _table(rows: Sequence[dict[str, str]], numbers: Sequence[str]) -> Table:
    """A line a row, under a line for its role where there are two; less the columns in which nothing stands."""
    table = Table(box=None, pad_edge=False)
    titles = [title for title in rows[0] if title != "role" and any(row[title] for row in rows)]
    for title in titles:
        table.add_column(title, justify="right" if title in numbers else "left", no_wrap=title != "channel")
    table.columns[0].overflow, table.columns[0].min_width = "fold", 12
    roles = dict.fromkeys(row["role"] for row in rows)
    for role in roles:
        if len(roles) > 1:
            table.add_row(role, style="bold")
        for row in rows:
            if row["role"] == role:
                table.add_row(*(row[title] for title in titles))
    return table


def _range(values: Sequence[float]) -> str:
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} … {high}"
