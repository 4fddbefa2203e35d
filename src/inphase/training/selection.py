"""Which basis functions suit the demonstrations: families, sizes and widths by three criteria (4.2.2)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from inphase.arrays import freeze
from inphase.basis import Basis, Gaussian, Periodic, Polynomial, Sigmoid
from inphase.errors import DataError, OptionError, listing
from inphase.preprocess.coordinates import Coordinates
from inphase.training.criteria import common_curves, common_phases, criteria
from inphase.trajectory import Dataset

CRITERIA = ("aic", "bic", "held-out")
PER = ("all", "group", "channel")
FAMILIES = ("gaussian", "sigmoid", "polynomial")
SIZES = (4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 17, 20, 25, 30, 40)
VARIANCES = (0.01, 0.02, 0.05, 0.1, 0.2)  # of Gaussians whose outer centres are 0 and 1, as IntPrim counts widths
STEPS = (0.02, 0.05, 0.1, 0.2)  # widths of logistic steps [phase]


@dataclass(frozen=True, eq=False)
class BasisSelection:
    """How well each candidate suits each unit: a channel, a group, or all of them; lower is better.

    units: their names. members: the channels of each. aic, bic: (U, C) the criteria of Akaike and Schwarz. scores:
    (U, C, N) -2 log likelihood of each demonstration under the Gaussian of all others. All are for a reading, and inf
    where a candidate has too many functions. error_std: (U, C) the root mean square of the residuals, in the spread of
    the channels, or the size of those that rest.
    """

    candidates: tuple[Basis, ...]
    units: tuple[str, ...]
    members: tuple[tuple[str, ...], ...]
    aic: Float[np.ndarray, "U C"]
    bic: Float[np.ndarray, "U C"]
    scores: Float[np.ndarray, "U C N"]
    error_std: Float[np.ndarray, "U C"]

    def __post_init__(self) -> None:
        freeze(self, aic=self.aic, bic=self.bic, scores=self.scores, error_std=self.error_std)

    @property
    def held_out(self) -> Float[np.ndarray, "U C"]:
        """(U, C) the mean score of the demonstrations."""
        return np.asarray(self.scores.mean(-1))

    def values(self, criterion: str = "held-out") -> Float[np.ndarray, "U C"]:
        """(U, C) the values of a criterion; raises OptionError for an unknown one."""
        if criterion not in CRITERIA:
            raise OptionError(f"unknown criterion {criterion!r}; one of {listing(CRITERIA)}")
        return {"aic": self.aic, "bic": self.bic, "held-out": self.held_out}[criterion]

    def ranking(self, unit: str | None = None, criterion: str = "held-out") -> list[tuple[Basis, float]]:
        """The candidates for a unit (the only one, if there is but one), the best first, with their values."""
        if unit is None and len(self.units) == 1:
            unit = self.units[0]
        if unit not in self.units:
            raise OptionError(f"unknown unit {unit!r}; one of {listing(self.units)}")
        values = self.values(criterion)[self.units.index(unit)]
        return [(self.candidates[i], float(values[i])) for i in np.argsort(values, kind="stable")]

    def chosen(self, criterion: str = "held-out") -> list[int]:
        """The candidate for each unit: that of the least criterion.

        Held out, the demonstrations differ: of those that score worse than the least by no more than the standard error
        of the difference, the one with the fewest functions.
        """
        values = self.values(criterion)
        if criterion != "held-out":
            return [int(i) for i in values.argmin(1)]
        sizes, chosen = np.array([basis.size for basis in self.candidates]), []
        for own, scores in zip(values, self.scores, strict=True):
            known = np.flatnonzero(np.isfinite(own))
            off = scores[known] - scores[own.argmin()]
            near = known[off.mean(1) <= off.std(1, ddof=1) / np.sqrt(off.shape[1])]
            chosen.append(int(min(near, key=lambda i: (sizes[i], own[i]))))
        return chosen

    def best(self, criterion: str = "held-out") -> dict[str, Basis]:
        """The chosen basis of every channel, as `inphase.fit(basis=…)` takes them."""
        chosen = self.chosen(criterion)
        return {name: self.candidates[i] for names, i in zip(self.members, chosen, strict=True) for name in names}


def select_basis(
    dataset: Dataset,
    *,
    candidates: Iterable[Basis] | None = None,
    families: Sequence[str] = FAMILIES,
    sizes: Sequence[int] = SIZES,
    per: str = "all",
    periodic: bool = False,
) -> BasisSelection:
    """Compare basis functions on demonstrations.

    candidates: what is compared; else every family with every size and a few widths (4.2.2). per: "channel", "group" or
    "all", what has a basis of its own. All demonstrations are brought to the same phases, as many as the shorter
    ones have readings, so that a candidate is fitted to all by one factorisation. Noise is estimated, not named.
    Raises DataError for fewer than three demonstrations (nothing could be held out) or a channel that was never seen,
    OptionError for names and numbers that make no grid.
    """
    if per not in PER:
        raise OptionError(f"per: expected one of {listing(PER)}, got {per!r}")
    if len(dataset) < 3:
        raise DataError(f"expected at least 3 demonstrations to compare bases on, got {len(dataset)}")
    chosen = tuple(candidates) if candidates is not None else tuple(grid(families, sizes, periodic))
    if not chosen:
        raise OptionError("expected at least one candidate, got none")
    coordinates = Coordinates.learn(dataset.channels, [d.values for d in dataset])
    around = [basis.periodic for basis in chosen]
    if any(around) and not all(around):
        raise OptionError("expected candidates that are all periodic or none, got both")
    curves = common_curves(dataset, coordinates, any(around))
    found = np.full((3 + len(dataset), coordinates.count, len(chosen)), np.inf)
    phases = common_phases(curves.shape[-1], any(around))
    for which in _alike(chosen):
        if chosen[which[0]].size <= len(phases) // 2:
            found[:, :, which] = criteria(np.stack([chosen[i](phases) for i in which]), curves)
    units = _units(dataset, coordinates, per)
    table = np.stack([found[:, of].mean(1) for of in units.values()], axis=1)
    members = tuple(_names(dataset, coordinates, features) for features in units.values())
    aic, bic, error, scores = table[0], table[1], table[2], np.moveaxis(table[3:], 0, -1)
    return BasisSelection(chosen, tuple(units), members, aic, bic, scores, np.sqrt(error))


def grid(families: Sequence[str] = FAMILIES, sizes: Sequence[int] = SIZES, periodic: bool = False) -> Iterator[Basis]:
    """The candidates: Gaussians as `fit` uses them and as IntPrim placed them, steps and polynomials of every size."""
    unknown = [name for name in families if name not in FAMILIES]
    if unknown:
        raise OptionError(f"unknown family {unknown[0]!r}; one of {listing(FAMILIES)}")
    for size in sizes:
        if periodic:
            yield Periodic(size)
            continue
        if "gaussian" in families:
            yield Gaussian(size)
            yield from (Gaussian(size, float(np.sqrt(var)), margin=0.0) for var in VARIANCES)
        if "sigmoid" in families:
            yield Sigmoid(size)
            yield from (Sigmoid(size, width) for width in STEPS)
        if "polynomial" in families:
            yield Polynomial(size - 1)


def _alike(candidates: Sequence[Basis]) -> list[list[int]]:
    """The candidates of each size, which are factorised together."""
    by_size: dict[int, list[int]] = {}
    for i, basis in enumerate(candidates):
        by_size.setdefault(basis.size, []).append(i)
    return list(by_size.values())


def _units(dataset: Dataset, coordinates: Coordinates, per: str) -> dict[str, list[int]]:
    """The features of each unit, by its name."""
    if per == "all":
        return {"all channels": list(range(coordinates.count))}
    names = coordinates.groups if per == "group" else [dataset.names[of[0]] for of in coordinates.channel_of]
    units: dict[str, list[int]] = {}
    for feature, name in enumerate(names):
        units.setdefault(name, []).append(feature)
    return units


def _names(dataset: Dataset, coordinates: Coordinates, features: Sequence[int]) -> tuple[str, ...]:
    """The channels that features are made of."""
    return tuple(dict.fromkeys(dataset.names[i] for f in features for i in coordinates.channel_of[f]))
