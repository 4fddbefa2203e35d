"""Four ways of showing 61 force sensors to a model (3.2.2): all, those selected, groups, and groups with sparse bases."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import inphase
from experiments.hugging.pads import SENSORS
from inphase.basis import Basis, Gaussian

UNIFORM = Gaussian(8)  # 664 - 392 weights of 61 - 27 channels in Table 4


@dataclass(frozen=True)
class Shown:
    """What becomes of a data set, and the bases of its channels. says: what was chosen."""

    dataset: inphase.Dataset
    bases: Basis | dict[str, Basis]
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
    sparse = inphase.sparse_bases(shown.dataset, ["group_*", "force_*"])
    usual = dict.fromkeys(shown.dataset.names, UNIFORM)
    sizes = [basis.size for basis in sparse.values()]
    return replace(shown, bases=usual | sparse, says=f"{min(sizes)} to {max(sizes)} functions a channel")


WAYS: dict[str, Callable[[inphase.Dataset], Shown]] = {
    "All": everything,
    "MIFS": selected,
    "Group": grouped,
    "Group + OLS": grouped_sparse,
}
