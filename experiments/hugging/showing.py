"""Ways of showing 61 force sensors to a model (3.2.2): all, those selected, groups, and groups with sparse bases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import inphase
from experiments.hugging import camera
from experiments.hugging.pads import BACK, SENSORS
from inphase.basis import Basis, Gaussian

UNIFORM = Gaussian(8)  # 664 - 392 weights of 61 - 27 channels in Table 4
MOST = 7  # functions of a sparse basis: with sharper ones OLS would take twice as many as there are, and save nothing


@dataclass(frozen=True)
class Shown:
    """What becomes of a data set, and its bases, None for those that are learned. says: what was chosen."""

    dataset: inphase.Dataset
    bases: Basis | dict[str, Basis] | None
    change: Callable[[inphase.Dataset], inphase.Dataset]
    says: str = ""


def everything(train: inphase.Dataset) -> Shown:
    """All force sensors."""
    return Shown(train, UNIFORM, lambda dataset: dataset)


def selected(train: inphase.Dataset) -> Shown:
    """The sensors that say something of the robot's own forces."""
    selection = inphase.select_channels(train, channels="touch_*", about="force_*")
    says = f"{len(selection.chosen)} sensors: {', '.join(name.removeprefix('touch_') for name in selection.chosen)}"
    return Shown(train.select(selection.names), UNIFORM, lambda dataset: dataset.select(selection.names), says)


REDUCTION = inphase.Reduction({f"group_{group}": (names, "max") for group, names in SENSORS.items()})


def grouped(train: inphase.Dataset) -> Shown:
    """The largest reading of every group."""
    return Shown(REDUCTION.dataset(train), UNIFORM, REDUCTION.dataset)


def grouped_sparse(train: inphase.Dataset) -> Shown:
    """The same, with bases where there is contact."""
    shown = grouped(train)
    sparse = inphase.sparse_bases(shown.dataset, ["group_*", "force_*"], most=MOST)
    usual = dict.fromkeys(shown.dataset.names, UNIFORM)
    sizes = [basis.size for basis in sparse.values()]
    return replace(shown, bases=usual | sparse, says=f"{min(sizes)} to {max(sizes)} functions a channel")


HANDS = inphase.Reduction({f"group_{group}": (SENSORS[group], "max") for group in BACK})
PRESSED = tuple(f"group_{group}" for group in BACK)


def partner_alone(train: inphase.Dataset) -> Shown:
    """Groups of the back alone, which the partner's arms press, and none that the robot's own arms press, too.

    What the robot does itself would tell it to go on doing it: a robot that holds loosely feels a loose hug. Readings
    are logarithms: whether somebody is there at all says more of the phase than how hard they press.
    """

    def change(dataset: inphase.Dataset) -> inphase.Dataset:
        back = [name for group in BACK for name in SENSORS[group]]
        shown = HANDS.dataset(dataset.select([*camera.NAMES, *back]))
        columns = [shown.names.index(name) for name in PRESSED]
        demonstrations = []
        for demonstration in shown:
            values = demonstration.values.copy()
            values[:, columns] = _logarithm(values[:, columns])
            demonstrations.append(replace(demonstration, values=values))
        return replace(shown, demonstrations=tuple(demonstrations))

    return Shown(change(train), None, change)


def partner_now(row: dict[str, float]) -> dict[str, float]:
    """The same of one row of all sensors, by name."""
    seen = HANDS.sample(row)
    return {name: seen[name] for name in camera.NAMES} | {name: float(_logarithm(seen[name])) for name in PRESSED}


def _logarithm(reading: Any) -> Any:
    return np.log1p(np.maximum(reading, 0.0))


WAYS: dict[str, Callable[[inphase.Dataset], Shown]] = {
    "All": everything,
    "MIFS": selected,
    "Group": grouped,
    "Group + OLS": grouped_sparse,
    "Back": partner_alone,
}
