"""How channels, and the basis weights below them, are believed to move together: numbers to be drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from inphase.channels import match
from inphase.errors import OptionError
from inphase.filters import Belief
from inphase.model import Model

PHASES = 50  # at which an interaction is looked at, where it is the whole one
STILL = 1e-12  # of the widest standard deviation: rounding, not a movement


def channel_correlation(
    model: Model, belief: Belief | None = None, phase: float | None = None
) -> Float[np.ndarray, "D D"]:
    """(D, D) the correlation of the channels h(φ, w) at a phase, over the weights; None: over the whole interaction.

    belief: of a filter of this model, whose weights they are; None is the prior, what demonstrations say before a
    partner is seen. Over an interaction, variances and covariances are averaged over its phases. A channel that does
    not vary correlates with itself alone. Noise of the readings is left out: it is each channel's own. Quaternions are
    taken to first order around the mean. Raises OptionError for a phase that is not finite.
    """
    if phase is not None and not np.isfinite(phase):
        raise OptionError(f"expected a finite phase, got {phase}")
    phases = (np.arange(PHASES) + 0.5) / PHASES if phase is None else np.array([phase], dtype=np.float64)
    mean = model.layout.predict(phases, model.prior.mean if belief is None else belief.weights_mean)
    span, total = model.scaling.span, np.zeros((len(model.channels), len(model.channels)))
    rows = None if belief is None and _by_block(model) else _factor(model, belief)
    for at, state in zip(phases.tolist(), model.scaling.unscale(mean), strict=True):
        cov = _prior_cov(model, at) if rows is None else _square(model.layout.project(at, rows))
        slopes = model.coordinates.jacobian(state)
        cov = cov * np.outer(span, span)
        total += cov if slopes is None else slopes @ cov @ slopes.T
    return _correlation(total)


def weight_correlation(
    model: Model, belief: Belief | None = None, channels: Sequence[str] | str = "*"
) -> tuple[tuple[str, ...], Float[np.ndarray, "W W"]]:
    """(W,) names and (W, W) the correlation of the basis weights of some channels, by names or patterns.

    A weight is named after its feature and its place, `hand_x 1` … `hand_x 9`. belief: as in `channel_correlation`.
    With many channels, ask for some: this is a number for every pair of weights. Raises ChannelError.
    """
    features = model.coordinates.features_of(match(channels, model.names))
    slices = [model.layout.slices[i] for i in features]
    places = np.concatenate([np.arange(part.start, part.stop) for part in slices])
    if belief is None and _by_block(model):
        # The prior of these features alone: to the factor of all, a shrunk one has some rows for every feature.
        prior, sizes = model.prior, tuple(part.stop - part.start for part in slices)
        partner = int((places < prior.partner).sum())
        cov = replace(prior, samples=prior.samples[:, places], partner=partner, blocks=sizes).cov
    else:
        cov = _square(_factor(model, belief)[:, places])
    names = [
        f"{model.coordinates.names[i]} {number + 1}" for i in features for number in range(model.layout.bases[i].size)
    ]
    return tuple(names), _correlation(cov)


def _factor(model: Model, belief: Belief | None) -> Float[np.ndarray, "N B"]:
    return model.prior.factor if belief is None else belief.weights_factor()


def _square(rows: Float[np.ndarray, "N M"]) -> Float[np.ndarray, "M M"]:
    return np.asarray(rows.T @ rows)


def _by_block(model: Model) -> bool:
    """Whether the prior's blocks are the features, as they are in every model that was learned."""
    prior, slices = model.prior, model.layout.slices
    known = prior.blocks == tuple(part.stop - part.start for part in slices)
    return known and prior.partner in (0, *(part.stop for part in slices))


def _prior_cov(model: Model, phase: float) -> Float[np.ndarray, "F F"]:
    """(F, F) the covariance of the scaled features at a phase before a partner is seen.

    What shrinkage and trust do to weights, block by block, they do to features: a row for every demonstration says all,
    where the factor of a shrunk prior has some for every feature.
    """
    prior, layout = model.prior, model.layout
    cov = _square(layout.project(phase, prior.samples - prior.mean)) / (len(prior.samples) - 1)
    own = cov.diagonal().copy()
    cov *= 1 - prior.shrinkage
    partner = np.array([part.start < prior.partner for part in layout.slices])
    cov[np.not_equal.outer(partner, partner)] *= prior.trust
    np.fill_diagonal(cov, own)
    return cov


def _correlation(cov: Float[np.ndarray, "M M"]) -> Float[np.ndarray, "M M"]:
    var = cov.diagonal()
    still = ~(var > STILL**2 * var.max(initial=0.0))
    scale = 1 / np.sqrt(np.where(still, 1.0, var))
    correlation = np.clip(cov * np.outer(scale, scale), -1.0, 1.0)
    correlation[still], correlation[:, still] = 0.0, 0.0
    np.fill_diagonal(correlation, 1.0)
    return (correlation + correlation.T) / 2
