"""Bases for sparse signals: centres only where something happens (3.2.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from inphase.basis import Basis, Gaussian
from inphase.basis.basis import whole
from inphase.channels import match
from inphase.errors import DataError, OptionError, listing
from inphase.preprocess.coordinates import Coordinates
from inphase.training.orthogonal import CLOSEST, FEWEST, Curves, choose
from inphase.training.rest import rest
from inphase.trajectory import Dataset

WIDTHS = (0.03, 0.05, 0.08, 0.12)  # [phase], all functions of one basis have the same
TREMBLE = 6.0  # standard deviations of its noise that a resting channel may lie above its lowest reading


def sparse_basis(
    phases: Sequence[Float[np.ndarray, " _"]],
    values: Sequence[Float[np.ndarray, "_ ..."]],
    *,
    widths: Sequence[float] | float = WIDTHS,
    unexplained: float = 0.01,
    by_bic: bool = True,
    most: int = 20,
) -> Gaussian:
    """Gaussians whose centres lie where the signals of all demonstrations need them, the same for all of them.

    phases: (T,) a demonstration, from 0 to 1. values: (T,) readings, or (T, M) of M signals that are to share the
    centres, NaN where not seen; 0 is where the signal has nothing to say. Every demonstration has weights of its own;
    the error reduction ratio is summed over all. Functions are added until no more than a share `unexplained` of the
    power is left, or, `by_bic`, the Bayesian information criterion rises, or there are `most`. All functions of a basis
    are as wide [phase]; of several `widths` the one that needs fewest functions is taken, or, where none explains
    enough, the one with the lowest criterion. Samples count by bins of 1/500 of the phase. Never more functions
    come out than the samples can tell apart, and never fewer than two. Not for a periodic phase.
    Raises DataError for signals that are zero, never seen or do not fit their phases, OptionError for values that make
    no sense.
    """
    tried = _widths(widths)
    most = whole("most", most, least=FEWEST)
    if not 0 <= unexplained < 1:
        raise OptionError(f"unexplained: expected a share from 0 to 1, got {unexplained!r}")
    flat = [np.asarray(v, dtype=np.float64) for v in values]
    flat = [v[:, None] if v.ndim == 1 else v for v in flat]
    if not flat or [len(p) for p in phases] != [len(v) for v in flat] or len({v.shape[1] for v in flat}) > 1:
        got = f"{listing(len(p) for p in phases)} and {listing(v.shape for v in flat)}"
        raise DataError(f"expected phases (T,) and values (T,) or (T, M) of every demonstration, got {got}")
    if not all(np.isfinite(p).all() for p in phases) or any(np.isinf(v).any() for v in flat):
        raise DataError("expected finite phases, and values that are finite or NaN")
    curves = Curves.gather(phases, flat)
    if not curves.power.sum() > 0:
        raise DataError("expected a signal that is not zero everywhere, got none to choose centres for")
    found = [choose(curves, width, unexplained, by_bic, most) for width in tried]
    enough = [chosen for chosen in found if chosen.unexplained <= unexplained]
    if enough:
        return min(enough, key=lambda chosen: (len(chosen.centres), chosen.unexplained)).basis
    return min(found, key=lambda chosen: chosen.bic).basis


def sparse_bases(
    dataset: Dataset,
    channels: Sequence[str] | str,
    *,
    together: bool = False,
    widths: Sequence[float] | float = WIDTHS,
    unexplained: float = 0.01,
    by_bic: bool = True,
    most: int = 20,
) -> dict[str, Basis]:
    """A sparse basis for each of some channels, as `inphase.fit(..., basis=)` takes them: {name: basis}.

    channels: names or patterns. together: one basis for all of them, whose signals then count by their power; bases
    that channels share make a session faster. A signal is measured from its lowest reading, which is the zero of a
    model, or from its rest where that is as good as there. The rest as in `sparse_basis`. Raises ChannelError for a
    pattern that fits nothing, DataError for a channel that is never seen or does not move, OptionError.
    """
    coordinates = Coordinates.learn(dataset.channels, [d.values for d in dataset])
    features = [coordinates.from_channels(d.values) for d in dataset]
    columns, phases = match(channels, dataset.names), [d.phases for d in dataset]
    signals = {f: _signal(features, f, coordinates.names[f]) for f in coordinates.features_of(columns).tolist()}
    positions = {f: [dataset.names[i] for i in coordinates.channel_of[f]] for f in signals}
    sets: dict[tuple[str, ...], list[int]] = {}
    for f, names in positions.items():
        sets.setdefault(() if together else tuple(names), []).append(f)
    options = {"widths": widths, "unexplained": unexplained, "by_bic": by_bic, "most": most}
    bases: dict[str, Basis] = {}
    for members in sets.values():
        values = [np.stack(parts, axis=1) for parts in zip(*(signals[f] for f in members), strict=True)]
        basis = sparse_basis(phases, values, **options)  # type: ignore[arg-type]
        bases |= {name: basis for f in members for name in positions[f]}
    return {name: bases[name] for name in dataset.names if name in bases}


def _signal(features: Sequence[Float[np.ndarray, "_ F"]], f: int, name: str) -> list[Float[np.ndarray, " _"]]:
    """One feature of every demonstration, from its zero, in units of its root mean square."""
    readings = np.concatenate([curve[:, f] for curve in features])
    if np.isnan(readings).all():
        raise DataError(f"channel {name!r}: expected readings, got none in any of {len(features)} demonstrations")
    low = float(np.nanmin(readings))
    level, noise = rest(readings)
    zero = level if level - low <= TREMBLE * noise else low
    size = float(np.sqrt(np.nanmean((readings - zero) ** 2)))
    if not size > 1e-12 * max(abs(low), np.finfo(float).tiny):
        raise DataError(f"channel {name!r}: expected a channel that moves, got {low:g} everywhere; leave it out")
    return [(curve[:, f] - zero) / size for curve in features]


def _widths(widths: Sequence[float] | float) -> list[float]:
    tried = [widths] if isinstance(widths, (int, float)) else list(widths)
    if not tried or not all(isinstance(w, (int, float)) and CLOSEST <= w <= 1 for w in tried):
        raise OptionError(f"widths: expected one or more from {CLOSEST:g} to 1 [phase], got {widths!r}")
    return [float(w) for w in tried]
