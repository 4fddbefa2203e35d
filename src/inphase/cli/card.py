"""A model or a data set in a table."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from inphase.model import Model
from inphase.trajectory import Dataset


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
            "basis": str(basis),
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
        "typical_duration": 1 / model.phase.nominal_velocity,
        "tempo_std": float(phase_std[1] / model.phase.nominal_velocity) if len(phase_std) > 1 else None,
        "order": model.phase.order,
        "periodic": model.phase.periodic,
        "provenance": dict(model.provenance),
        "features": features,
    }


def print_model(console: Console, model: Model) -> None:
    """The model's card."""
    card = describe_model(model)
    tempo = f", tempo ± {100 * card['tempo_std']:.0f} %" if card["tempo_std"] is not None else ""
    console.print(
        f"{len(card['observed'])} observed and {len(card['controlled'])} controlled channels, "
        f"{card['demonstrations']} demonstrations, {card['weights']} basis weights\n"
        f"typical duration {card['typical_duration']:.2f} s{tempo}, phase of order {card['order']}"
        f"{', periodic' if card['periodic'] else ''}"
    )
    table = Table(box=None, pad_edge=False)
    for title, side in (("channel", "left"), ("role", "left"), ("unit", "left"), ("kind", "left"), ("basis", "left")):
        table.add_column(title, justify=side, no_wrap=True)  # type: ignore[arg-type]
    for title in ("low", "high", "noise ±", "correlated [s]"):
        table.add_column(title, justify="right", no_wrap=True)
    for row in card["features"]:
        numbers = (row["low"], row["high"], row["noise_std"], row["noise_correlation_time"])
        table.add_row(
            row["feature"], row["role"], row["unit"], row["kind"], row["basis"], *(f"{n:.3g}" for n in numbers)
        )
    console.print(table)


def describe_dataset(dataset: Dataset) -> dict[str, Any]:
    """What a data set holds, as plain values for people and machines."""
    everything = np.concatenate([d.values for d in dataset])
    steps = [float(np.median(np.diff(d.times))) for d in dataset]
    return {
        "episodes": [
            {"name": d.name, "samples": len(d), "duration": d.duration, "rate": 1 / step}
            for d, step in zip(dataset, steps, strict=True)
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
    }


def print_dataset(console: Console, dataset: Dataset) -> None:
    """The data set's card."""
    card = describe_dataset(dataset)
    durations = [episode["duration"] for episode in card["episodes"]]
    rates = [episode["rate"] for episode in card["episodes"]]
    console.print(
        f"{len(durations)} episodes of {min(durations):.2f} … {max(durations):.2f} s "
        f"(median {np.median(durations):.2f} s) at {_range(rates)} Hz, "
        f"{sum(episode['samples'] for episode in card['episodes'])} samples"
    )
    table = Table(box=None, pad_edge=False)
    for title in ("channel", "role", "kind", "group"):
        table.add_column(title, no_wrap=True)
    for title in ("low", "high", "missing"):
        table.add_column(title, justify="right", no_wrap=True)
    for row in card["channels"]:
        low, high = ("–" if row[key] is None else f"{row[key]:.4g}" for key in ("low", "high"))
        table.add_row(row["name"], row["role"], row["kind"], row["group"], low, high, f"{100 * row['missing']:.1f} %")
    console.print(table)


def _range(values: list[float]) -> str:
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} … {high}"
