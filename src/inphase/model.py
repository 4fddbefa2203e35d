"""A trained model: all that is needed to respond, and nothing that changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase.active import check_windows
from inphase.arrays import freeze, frozen
from inphase.basis.layout import Layout
from inphase.channels import Channel, Role, check_channels
from inphase.errors import OptionError, listing
from inphase.evidence import Evidence
from inphase.noise import Noise
from inphase.phase import PhaseModel
from inphase.preprocess.coordinates import Coordinates
from inphase.preprocess.scaling import Scaling
from inphase.reflex import Reflex
from inphase.tempo import Tempo
from inphase.weight_prior import WeightPrior

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from inphase.session import Session


@dataclass(frozen=True, eq=False)
class Model:
    """How two partners move together, learned from demonstrations.

    The data flow: channels (D) → `coordinates` → features (F) → `scaling` → `layout` → basis weights (B), believed to
    be drawn from `prior`, read with `noise`, at a phase that moves by `phase`; `tempo` says how a partner's may differ,
    `reflex` what was just seen says of the controlled features at once. spread: (D,) the standard deviation of every
    channel over the demonstrations, in its unit. band: what the standard deviation of a response is multiplied by, so
    that held-out demonstrations lie in it as often as it says. evidence: what the choices were made by. active: (F, 2)
    the phases (from, until) between which each feature is used for inference; by default the whole phase.
    Raises OptionError where the parts do not fit each other.
    """

    channels: tuple[Channel, ...]
    coordinates: Coordinates
    scaling: Scaling
    layout: Layout
    prior: WeightPrior
    noise: Noise
    phase: PhaseModel
    spread: Float[np.ndarray, " D"]
    provenance: Mapping[str, str] = field(default_factory=dict)
    tempo: Tempo = field(default_factory=Tempo)
    reflex: Reflex | None = None
    band: float = 1.0
    evidence: Evidence | None = None
    active: Float[np.ndarray, "_F 2"] = field(default_factory=lambda: np.empty((0, 2)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", tuple(self.channels))
        object.__setattr__(self, "provenance", dict(self.provenance))
        features, weights = self.coordinates.count, self.layout.size
        everywhere = np.tile([0.0, 1.0], (features, 1))
        freeze(self, spread=self.spread, active=self.active if self.active.size else everywhere)
        for what, expected, got in (
            ("channels of the coordinates", len(self.channels), len(self.coordinates.channels)),
            ("features of the scaling", features, len(self.scaling.low)),
            ("features of the basis layout", features, self.layout.count),
            ("features of the noise", features, len(self.noise.var)),
            ("weights of the prior", weights, self.prior.samples.shape[1]),
            ("channels of the spread", len(self.channels), len(self.spread)),
        ):
            if expected != got:
                raise OptionError(f"{what}: expected {expected}, got {got}")
        check_channels(self.channels)
        if not self.observed or not self.controlled:
            raise OptionError(f"expected observed and controlled channels, got {self.observed} and {self.controlled}")
        if not (np.isfinite(self.spread) & (self.spread > 0)).all():
            raise OptionError(f"expected a positive, finite spread of every channel, got {self.spread}")
        if not 0 < self.band < np.inf:
            raise OptionError(f"expected a finite band > 0, got {self.band}")
        if self.reflex is not None:
            shown = self.observed_features
            parts, fitting = (self.reflex.observed, len(self.reflex.mean)), (shown, features - shown)
            if parts != fitting:
                raise OptionError(f"reflex: expected {fitting} observed and controlled features, got {parts}")
        if self.phase.periodic != self.layout.periodic:
            raise OptionError(
                f"expected phase and basis to be both periodic or both not, got phase.periodic={self.phase.periodic} "
                f"and a basis with periodic={self.layout.periodic}"
            )
        check_windows(self.active, self.coordinates.names, self.phase.periodic)

    def __repr__(self) -> str:
        return (
            f"Model(observed: {listing(self.observed)}; controlled: {listing(self.controlled)}; "
            f"{len(self.prior.samples)} demonstrations of {1 / self.phase.nominal_velocity:.2f} s)"
        )

    @cached_property
    def observed_features(self) -> int:
        """How many features the observed channels have; they come first."""
        return len(self.coordinates.features_of(range(len(self.observed))))

    @cached_property
    def always_active(self) -> bool:
        """Whether every feature is used for inference at every phase."""
        return bool((self.active == (0.0, 1.0)).all())

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of all channels: the observed ones, then the controlled."""
        return tuple(channel.name for channel in self.channels)

    @cached_property
    def observed(self) -> tuple[str, ...]:
        """The names of the observed channels."""
        return tuple(channel.name for channel in self.channels if channel.role is Role.OBSERVED)

    @cached_property
    def controlled(self) -> tuple[str, ...]:
        """The names of the controlled channels."""
        return tuple(channel.name for channel in self.channels if channel.role is Role.CONTROLLED)

    def predict(self, phases: ArrayLike, weights: ArrayLike | None = None) -> Float[np.ndarray, "P D"]:
        """What the channels read at phases (P,): h(φ, w), for weights (B,), or those of the mean trajectory."""
        at, w = self._phases(phases), self.prior.mean if weights is None else np.asarray(weights, dtype=np.float64)
        if w.shape != (self.layout.size,):
            raise OptionError(f"expected weights of shape ({self.layout.size},), got {w.shape}")
        mean = self.layout.predict(at, w)
        return frozen(self.to_channels(mean, np.zeros_like(mean))[0])

    def distribution(self, phases: ArrayLike) -> tuple[Float[np.ndarray, "P D"], Float[np.ndarray, "P D"]]:
        """Mean and standard deviation (P, D) of the channels over new interactions, at phases (P,)."""
        at, everything = self._phases(phases), np.arange(self.layout.count)
        by_feature = self.prior.blocks == tuple(basis.size for basis in self.layout.bases)
        rows = self.prior.alone if by_feature else self.prior.factor
        var = (self.layout.project_each(at, rows, everything) ** 2).sum(1)
        mean, var = self.to_channels(self.layout.predict(at, self.prior.mean), var + self.noise.var)
        return frozen(mean), frozen(np.sqrt(var))

    def starting(self, phase: float, std: float) -> Model:
        """The same model for interactions that are first seen at `phase`, 0 … 1, give or take `std`; 0.5, 1: anywhere.

        Raises OptionError for a phase that is none, or a standard deviation that is negative or not finite.
        """
        return replace(self, phase=self.phase.starting(phase, std))

    def to_channels(
        self, mean: Float[np.ndarray, "S F"], var: Float[np.ndarray, "S F"]
    ) -> tuple[Float[np.ndarray, "S D"], Float[np.ndarray, "S D"]]:
        """Mean and variance of scaled features as mean and variance of the channels, in their units."""
        return self.coordinates.to_channels(self.scaling.unscale(mean), self.scaling.unscale_var(var))

    def _phases(self, phases: ArrayLike) -> Float[np.ndarray, " P"]:
        at = np.atleast_1d(np.asarray(phases, dtype=np.float64))
        if at.ndim != 1 or not np.isfinite(at).all():
            raise OptionError(f"expected finite phases (P,), got shape {at.shape}")
        return at

    # The doors upward (docs/decisions/0001-doors.md): what a user looks for on a model, wherever it lives.

    def session(self, filter: str | None = None, seed: int = 0, *, slips: bool = True, **options: Any) -> Session:
        """A session that follows one interaction live; `options` are those of the filter, None the recommended one.

        slips: whether a reading that surprises is held back for a moment, as it may be a slip of the sensor; False
        takes every reading at its word.
        Raises OptionError for an unknown filter or option, or another value of `slips`.
        """
        from inphase.session import Session

        return Session(self, filter, seed, slips=slips, **options)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the model to one file, whole or not at all."""
        from inphase.io.model_file import write_model

        write_model(self, path)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Model:
        """Read a model file; raises ModelFileError for anything that is not a whole one of a known version."""
        from inphase.io.model_file import read_model

        return read_model(path)

    def plot(self, *, channels: Sequence[str] | str | None = None, **options: Any) -> Figure:
        """A picture of each channel's mean and 90 % band over phase: `inphase.report.plot_model`, with its options.

        Raises ChannelError, and OptionError where matplotlib is missing.
        """
        from inphase.report.plots.model import plot_model

        return plot_model(self, channels=channels, **options)

    def _repr_html_(self) -> str:
        from inphase.report.notebook import model_html

        return model_html(self)
