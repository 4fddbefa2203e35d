"""From demonstrations to a model, nothing set by hand (2.3.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from inphase.basis import Basis, Gaussian, Layout, Periodic
from inphase.basis.fit import fit_weights, residuals
from inphase.channels import Kind, Role, quaternions, spread
from inphase.errors import DataError, OptionError, listing
from inphase.model import Model
from inphase.noise import Noise
from inphase.phase import PhaseModel
from inphase.preprocess.coordinates import Coordinates
from inphase.preprocess.scaling import Scaling
from inphase.tempo import Tempo
from inphase.training.active import windows
from inphase.training.calibrate import FEWEST, Alternative
from inphase.training.calibrate import calibrate as calibrated
from inphase.training.discrepancy import leave_one_out, seen_around
from inphase.training.noise import both, regression_noise
from inphase.training.reflex import learn_reflex
from inphase.training.selection import select_basis
from inphase.training.shrinkage import intensity
from inphase.training.tempo import learn_phase
from inphase.trajectory import Dataset
from inphase.weight_prior import WeightPrior
from inphase.workers import check_address

STILL = 1e-12  # of a channel's size: it does not move
DEFAULT_SIZE = 20  # basis functions a channel; what the demonstrations cannot support is left to the noise
OTHER_SIZES = (6, 8, 10, 12, 15, 17, 20, 25, 30, 40)  # of which one is proposed, and taken if it follows better


def fit(
    dataset: Dataset,
    *,
    basis: Basis | Mapping[str, Basis] | None = None,
    scaling: Scaling | None = None,
    prior: WeightPrior | None = None,
    noise: Noise | None = None,
    noise_bias: Mapping[str, float] | None = None,
    phase: PhaseModel | None = None,
    tempo: Tempo | None = None,
    shrinkage: str | float | None = None,
    active: Mapping[str, tuple[float, float]] | None = None,
    calibrate: bool = True,
    jobs: int = 1,
    cluster: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Model:
    """Learn how two partners move together.

    Everything is learned from the data set but what is named: a basis for all channels or by channel name or pattern
    (what is left out gets 20 functions; where none is named, all get as many as `select_basis` proposes, if held-out
    demonstrations are followed better with them), the scaling of the features, the prior over weights, the observation
    noise in scaled units (else that of the regression, Eq. 2.15, and that of leaving each demonstration out), the phase
    prior (`inphase.learn_phase` makes one of another order, or periodic), how a partner's tempo may differ, and the
    shrinkage of the prior between features ("between", "ledoit-wolf", "oas", or 0 … 1). active: phases (from, until) by
    channel name or pattern, outside of which a channel is not used for inference (`inphase.learn_active` finds them).
    noise_bias: standard deviations by channel name or pattern, in the channel's unit (quaternions: [rad]), that are
    added to the noise of what is read (4.2.4). Where there are four demonstrations or more, the rest is calibrated:
    demonstrations are held out and played, which takes up to some minutes; `calibrate=False` leaves that out. jobs: the
    processes that play. cluster: the address of a dask scheduler (tcp://host:port) whose workers play instead.
    progress: is told the share that is done.
    Raises DataError for fewer than two demonstrations, no controlled channel, or a channel that never moves;
    ChannelError for a pattern that fits nothing; OptionError for parts that do not fit each other
    or a cluster that does not answer.
    """
    if not isinstance(dataset, Dataset):
        raise DataError(f"expected a Dataset, as inphase.load makes one, got {type(dataset).__name__}")
    if cluster is not None:
        check_address(cluster)

    def learner(default: Basis | None, known: Scaling | None) -> Callable[[Dataset], Model]:
        return lambda part: _learn(
            part, basis, default, known, prior, noise, noise_bias, phase, tempo, shrinkage, active
        )

    model = learner(None, scaling)(dataset)
    if not calibrate or len(dataset) < FEWEST:
        return model
    fixed = [
        name
        for name, given in (
            ("noise lasts", noise is not None),
            ("trust", prior is not None),
            ("shrinkage", prior is not None or shrinkage is not None),
            ("usual tempo", tempo is not None),
        )
        if given
    ]
    # The scale is the whole data set's, so that what is chosen for a part is right for all.
    alternative, other = None, None if basis is not None or prior is not None else _proposed(dataset, model)
    if other is not None:
        learn_other = learner(other, model.scaling)
        alternative = Alternative(f"{other.size} functions", learn_other(dataset), learn_other)
    learn_fold = learner(None, model.scaling)
    return calibrated(
        dataset,
        model,
        learn_fold,
        alternative=alternative,
        fixed=fixed,
        jobs=jobs,
        cluster=cluster,
        progress=progress,
    )


def _proposed(dataset: Dataset, model: Model) -> Basis | None:
    """The default with the number of functions that held-out demonstrations ask for; None where that is the default."""
    periodic = model.phase.periodic
    candidates = [Periodic(size) if periodic else Gaussian(size) for size in OTHER_SIZES]
    selection = select_basis(dataset, candidates=candidates)
    chosen = selection.candidates[selection.chosen()[0]]
    return None if chosen.size == DEFAULT_SIZE else chosen


def _learn(
    dataset: Dataset,
    basis: Basis | Mapping[str, Basis] | None,
    default: Basis | None,
    scaling: Scaling | None,
    prior: WeightPrior | None,
    noise: Noise | None,
    noise_bias: Mapping[str, float] | None,
    phase: PhaseModel | None,
    tempo: Tempo | None,
    shrinkage: str | float | None,
    active: Mapping[str, tuple[float, float]] | None,
) -> Model:
    """The model of a data set, without playing anything."""
    _check(dataset)
    phase = phase if phase is not None else learn_phase(dataset)
    values = [demonstration.values for demonstration in dataset]
    coordinates = Coordinates.learn(dataset.channels, values)
    features = [coordinates.from_channels(v) for v in values]
    _check_movement(dataset, coordinates, features)
    scaling = scaling if scaling is not None else Scaling.learn(coordinates.groups, features)
    if len(scaling.low) != coordinates.count:
        raise OptionError(f"scaling: expected {coordinates.count} features, got {len(scaling.low)}")
    layout = Layout(_bases(basis, default, dataset, coordinates, phase.periodic))
    scaled = [scaling.scale(f) for f in features]
    times, phases = [d.times for d in dataset], [d.phases for d in dataset]
    weights, _ = fit_weights(layout, phases, scaled, names=coordinates.names)
    shown = [dataset.channels[positions[0]].role is Role.OBSERVED for positions in coordinates.channel_of]
    if noise is None or prior is None:
        seen = seen_around(phases, scaled, phase.periodic)
        left_out = leave_one_out(layout, weights, np.array(shown, dtype=float), 1 / phase.nominal_velocity, seen)
        noise = noise or both(regression_noise(times, residuals(layout, phases, scaled, weights)), left_out.noise)
        partner, blocks = layout.slices[shown.index(False)].start, tuple(basis.size for basis in layout.bases)
        prior = prior or WeightPrior(weights, trust=left_out.trust, partner=partner, blocks=blocks)
    if noise_bias:
        noise = replace(noise, var=noise.var + _bias_var(noise_bias, dataset, coordinates, scaling))
    if shrinkage is not None:
        prior = replace(prior, shrinkage=intensity(shrinkage, prior.samples, prior.blocks))
    return Model(
        channels=dataset.channels,
        coordinates=coordinates,
        scaling=scaling,
        layout=layout,
        prior=prior,
        noise=noise,
        phase=phase,
        spread=_spread(coordinates, features),
        provenance={**dataset.provenance, "demonstrations": str(len(dataset))},
        tempo=tempo if tempo is not None else Tempo(),
        reflex=learn_reflex(times, scaled, sum(shown)),
        active=windows(active, dataset, coordinates),
    )


def _bias_var(
    noise_bias: Mapping[str, float], dataset: Dataset, coordinates: Coordinates, scaling: Scaling
) -> Float[np.ndarray, " F"]:
    """The variance, in scaled units, that is added to the noise of every feature: 0 where nothing is named."""
    by_channel = spread(noise_bias, dataset.names)
    wrong = [f"{name}: {bias!r}" for name, bias in by_channel.items() if not 0 <= bias < np.inf]
    if wrong:
        raise OptionError(f"noise_bias: expected finite standard deviations >= 0, got {listing(wrong)}")
    bias = [by_channel.get(dataset.names[positions[0]], 0.0) for positions in coordinates.channel_of]
    return scaling.scale_var(np.square(np.array(bias, dtype=np.float64)))


def _check(dataset: Dataset) -> None:
    if len(dataset) < 2:
        raise DataError(f"expected at least 2 demonstrations to learn from, got 1 ({dataset[0].name})")
    for role, names in (("observed", dataset.observed), ("controlled", dataset.controlled)):
        if not names:
            raise DataError(
                f"expected at least one {role} channel, got none; the channels are {listing(dataset.names)}"
            )


def _check_movement(dataset: Dataset, coordinates: Coordinates, features: Sequence[Float[np.ndarray, "_ F"]]) -> None:
    """Every channel, and every quaternion as a whole, has to have been seen and to move, by more than full turns."""
    raw, everything = np.concatenate([demonstration.values for demonstration in dataset]), np.concatenate(features)
    for positions in dict.fromkeys(coordinates.channel_of):
        channel, count = dataset.channels[positions[0]], len(dataset)
        curves = everything[:, [f for f, of in enumerate(coordinates.channel_of) if of == positions]]
        seen = np.isfinite(curves).all(1)
        if not seen.any():
            raise DataError(f"channel {channel.name!r}: expected readings, got none in any of {count} demonstrations")
        size = np.abs(curves[seen]).max() if channel.kind is Kind.LINEAR else 1.0
        if (np.ptp(curves[seen], axis=0) <= STILL * size).all():
            raise DataError(
                f"channel {channel.name!r}: expected a channel that moves, got {raw[seen][0, positions[0]]:g} in every "
                f"sample of all {count} demonstrations; leave it out"
            )


def _spread(coordinates: Coordinates, features: Sequence[Float[np.ndarray, "_ F"]]) -> Float[np.ndarray, " D"]:
    """The standard deviation of every channel, on one branch of its circle; the four of a quaternion share theirs."""
    channels = [coordinates.to_channels(curve, np.zeros_like(curve))[0] for curve in features]
    over_all = np.nanstd(np.concatenate(channels), axis=0)
    for part in quaternions(coordinates.channels):
        over_all[list(part)] = np.sqrt(np.mean(over_all[list(part)] ** 2))
    return np.asarray(over_all)


def _bases(
    basis: Basis | Mapping[str, Basis] | None,
    default: Basis | None,
    dataset: Dataset,
    coordinates: Coordinates,
    periodic: bool,
) -> tuple[Basis, ...]:
    """One basis a feature; that of a feature is the one of its (first) channel."""
    default = default or (Periodic(DEFAULT_SIZE) if periodic else Gaussian(DEFAULT_SIZE))
    if basis is None:
        basis = default
    for one in basis.values() if isinstance(basis, Mapping) else [basis]:
        if not isinstance(one, Basis):
            raise OptionError(f"basis: expected one of inphase.basis, such as Gaussian(20), got {one!r}")
    if not isinstance(basis, Mapping):
        return (basis,) * coordinates.count
    by_channel = spread(basis, dataset.names)
    return tuple(by_channel.get(dataset.names[positions[0]], default) for positions in coordinates.channel_of)
