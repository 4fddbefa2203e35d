"""What all filters of IntPrim share: the model they follow, the samples they take in, the state they tell."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase import Channel, Coordinates, Model, Noise, Observation, OptionError, PhaseModel, Role, Scaling, WeightPrior
from inphase.basis import Layout, Polynomial
from inphase.filters import make
from intprim.basis.basis_model import BasisModel
from intprim.checks import dofs_of, numbers
from intprim.filter.cyclical import Cyclical

State = tuple[float, Float[np.ndarray, " n"], Float[np.ndarray, "n n"]]


class System:
    """A filter of `inphase` that remembers its belief: phase and derivatives (K), then basis weights (B).

    Its random numbers come from a seed that is drawn where it is made, so `np.random.seed` makes runs repeat; a deep
    copy draws the same ones as the original.
    """

    belief: Any

    def __init__(
        self,
        basis_model: BasisModel,
        phase: PhaseModel,
        prior: WeightPrior,
        name: str,
        time_delta: float | int = 1.0,
        **options: Any,
    ) -> None:
        self.basis_model, self.time_delta, self.cyclical = basis_model, time_delta, phase.periodic
        self.system_size, self.system_order = len(phase.mean), phase.order
        self.model = _model(basis_model, phase, prior)
        self.filter = make(name, self.model, **options)
        self._rng = np.random.default_rng(np.random.randint(2**31))  # noqa: NPY002 - scripts call np.random.seed
        self.belief = self.filter.init(self._rng)

    def __deepcopy__(self, memo: dict[int, Any]) -> System:
        other = copy.copy(self)  # models and beliefs never change
        other._rng = copy.deepcopy(self._rng, memo)
        return other

    def get_mean(self) -> Float[np.ndarray, " n"]:
        """(K + B,) the mean of the state."""
        return np.asarray(self.belief.state_moments[0][:-1])

    def get_covariance(self) -> Float[np.ndarray, "n n"]:
        """(K + B, K + B) the covariance of the state."""
        return np.asarray(self.belief.state_moments[1][:-1, :-1])

    def localize(
        self,
        measurement: ArrayLike,
        measurement_noise: ArrayLike,
        active_dofs: ArrayLike,
        return_phase_variance: bool = False,
    ) -> State:
        """Take in samples (T, D), one time step after the other, and say phase, mean and covariance of the state.

        measurement_noise: (D, D), diagonal; active_dofs: (M,) those that are seen, the others do not exist, and NaN
        was not seen. Mean and covariance are those of the weights, (B,), or with `return_phase_variance` (K + B,).
        Raises DataError, OptionError.
        """
        for sample in self._samples(measurement, measurement_noise, active_dofs):
            self.belief, _ = self.filter.step(self.belief, sample, self.time_delta, self._rng)
        return self._state(return_phase_variance)

    def _state(self, whole: bool) -> State:
        own = slice(0 if whole else self.system_size, None)
        phase = float(self.belief.phase_mean[0])
        phase = phase % 1.0 if self.cyclical else min(max(phase, 0.0), 1.0)
        return phase, self.get_mean()[own], self.get_covariance()[own, own]

    def _samples(self, measurement: ArrayLike, noise: ArrayLike, active_dofs: ArrayLike) -> list[Observation]:
        count = self.basis_model.num_observed_dof
        values = numbers("measurement", measurement, "T D", finite=False, D=count)
        noise = numbers("observation_noise", noise, "D D", finite=False, error=OptionError, D=count)
        active = np.unique(dofs_of(active_dofs, count, "active_dofs"))
        own = noise[np.ix_(active, active)]
        if (own != np.diag(own.diagonal())).any() or not (np.isfinite(own).all() and (own.diagonal() > 0).all()):
            wanted = "a diagonal matrix with variances > 0 of the active DoFs"
            raise OptionError(f"observation_noise: expected {wanted}, got {own.tolist()}")
        seen = [active[np.isfinite(row[active])] for row in values]
        return [Observation(at, row[at], noise[at, at]) for at, row in zip(seen, values, strict=True)]


def phase_model(
    mean: ArrayLike, var: ArrayLike, proc_var: float | int, time_delta: float | int, cyclical: bool
) -> PhaseModel:
    """The phase prior of 4.2.7.1: mean and variance (K,) of phase, velocity and acceleration, as far as given.

    proc_var: the variance that a time step adds to the highest of them, over time_delta² where that is the velocity.
    Raises OptionError.
    """
    mean = numbers("initial_phase_mean", mean, "K", error=OptionError)
    var = numbers("initial_phase_var", var, "K", error=OptionError, K=len(mean))
    if not 1 <= len(mean) <= 3 or not (var >= 0).all():
        raise OptionError(f"initial_phase_var: expected 1, 2 or 3 variances >= 0, got {var.tolist()}")
    if not (0 < time_delta < np.inf and 0 <= proc_var < np.inf):
        raise OptionError(f"expected time_delta > 0 and proc_var >= 0, got {time_delta} and {proc_var}")
    per_step = proc_var * (time_delta**2 if len(mean) == 2 else 1.0)
    return PhaseModel(mean, np.diag(var), per_step / time_delta, nominal_velocity=1.0, periodic=cyclical)  # not read


def gaussian_prior(basis_model: BasisModel, mean: ArrayLike, cov: ArrayLike | None) -> WeightPrior:
    """The prior of weights with mean (B,) and covariance (B, B). Raises OptionError."""
    size = basis_model.layout.size
    mean = numbers("mean_basis_weights", mean, "B", error=OptionError, B=size)
    cov = numbers("cov_basis_weights", cov, "B B", error=OptionError, B=size)
    try:
        return WeightPrior.from_moments(mean, cov)
    except OptionError as error:
        raise OptionError(f"cov_basis_weights: {error}") from None


def _model(basis_model: BasisModel, phase: PhaseModel, prior: WeightPrior) -> Model:
    """The model of `inphase`: any DoF may be observed, and one beside them, always 0, is controlled by nobody."""
    names = [f"{i} {name}" for i, name in enumerate(basis_model.observed_dof_names)]
    channels = (*(Channel(name, Role.OBSERVED) for name in names), Channel("nobody", Role.CONTROLLED))
    bases, count = (*basis_model.layout.bases, Polynomial(0)), len(channels)
    return Model(
        channels=channels,
        coordinates=Coordinates(channels, np.zeros(count)),
        scaling=Scaling.none(count),
        layout=Layout(tuple(Cyclical(basis) for basis in bases) if phase.periodic else bases),
        prior=WeightPrior(np.pad(prior.samples, ((0, 0), (0, 1)))),
        noise=Noise(np.ones(count), np.zeros(count)),  # that of the samples is an argument
        phase=phase,
        spread=np.ones(count),
    )
