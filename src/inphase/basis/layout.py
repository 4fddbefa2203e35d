"""Layout: which stretch of the weight vector belongs to which feature, and h(φ, w) with its Jacobian."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np
from jaxtyping import Float, Int

from inphase.basis.basis import Basis
from inphase.basis.block import Plan, make_plan
from inphase.errors import OptionError, listing

REMEMBERED = 64  # plans: what is seen rarely changes, and must not fill the memory when it does


@dataclass(frozen=True)
class Layout:
    """One basis a feature; the weights (B,) are feature after feature (2.3.1).

    Each row of H in Eq. 2.6 is zero outside the slope and the weights of its own feature. No method but `jacobian`
    forms those zeros: a basis that features share is evaluated once, and multiplied with all their weights at once.
    `features`, wherever it is taken, is (M,) increasing indices and says which features are asked for, None for all F.
    Raises OptionError for no basis at all, a mixture of periodic ones with others, weights that are not B long, and
    features that do not exist or do not increase.
    """

    bases: tuple[Basis, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "bases", tuple(self.bases))
        if not self.bases:
            raise OptionError("expected a basis for each feature, got none")
        odd = [i for i, basis in enumerate(self.bases) if basis.periodic != self.bases[0].periodic]
        if odd:
            kind, other = ("periodic", "not") if self.bases[0].periodic else ("not periodic", "periodic")
            raise OptionError(
                f"expected all bases to be periodic or none, as there is but one phase: "
                f"that of feature 0 is {kind}, of features {listing(odd)} {other}"
            )

    @cached_property
    def size(self) -> int:
        """How many weights there are, B."""
        return sum(basis.size for basis in self.bases)

    @property
    def count(self) -> int:
        """How many features there are, F."""
        return len(self.bases)

    @property
    def periodic(self) -> bool:
        """Whether the phase rolls over from 1 to 0 (4.2.7.3)."""
        return self.bases[0].periodic

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Where each feature's weights are."""
        ends = accumulate((basis.size for basis in self.bases), initial=0)
        return tuple(slice(start, end) for start, end in pairwise(ends))

    def split(self, count: int) -> tuple[Layout, Layout]:
        """The layouts of the first `count` features and of the others; their weights are split in the same order."""
        parts = self._splits.get(count)
        if parts is None:
            parts = self._splits[count] = Layout(self.bases[:count]), Layout(self.bases[count:])
        return parts

    @cached_property
    def _splits(self) -> dict[int, tuple[Layout, Layout]]:
        return {}

    def predict(
        self,
        phases: Float[np.ndarray, " P"],
        weights: Float[np.ndarray, " B"],
        features: Int[np.ndarray, " M"] | None = None,
    ) -> Float[np.ndarray, "P M"]:
        """(P, M) h(φ, w): what the features read at each phase."""
        plan = self._plan(features, weights)
        return plan.join([block.basis(phases) @ block.weights(weights).T for block in plan.blocks], phases.shape)

    def predict_each(
        self,
        phases: Float[np.ndarray, "E S"],
        weights: Float[np.ndarray, "N B"],
        features: Int[np.ndarray, " M"] | None = None,
        which: Int[np.ndarray, " E"] | None = None,
    ) -> Float[np.ndarray, "E S M"]:
        """(E, S, M) h(φ, w) for every member of an ensemble, each at its own phases.

        which: the row of weights that each member has; None where every member has its own.
        """
        plan = self._plan(features, weights)
        parts = []
        for block in plan.blocks:
            own = block.weights(weights)
            own = own if which is None else own[which]
            parts.append(block.basis(phases) @ own.swapaxes(-1, -2))
        return plan.join(parts, phases.shape)

    def slope(
        self,
        phases: Float[np.ndarray, " P"],
        weights: Float[np.ndarray, " B"],
        features: Int[np.ndarray, " M"] | None = None,
    ) -> Float[np.ndarray, "P M"]:
        """(P, M) ∂h/∂φ: the first column of H in Eq. 2.6."""
        return self.predict_and_slope(phases, weights, features)[1]

    def predict_and_slope(
        self,
        phases: Float[np.ndarray, " P"],
        weights: Float[np.ndarray, " B"],
        features: Int[np.ndarray, " M"] | None = None,
    ) -> tuple[Float[np.ndarray, "P M"], Float[np.ndarray, "P M"]]:
        """(P, M) h(φ, w) and (P, M) ∂h/∂φ."""
        plan, values, slopes = self._plan(features, weights), [], []
        for block in plan.blocks:
            value, slope = block.basis.with_derivative(phases)
            own = block.weights(weights).T
            values.append(value @ own)
            slopes.append(slope @ own)
        return plan.join(values, phases.shape), plan.join(slopes, phases.shape)

    def project(
        self, phase: float, rows: Float[np.ndarray, "N B"], features: Int[np.ndarray, " M"] | None = None
    ) -> Float[np.ndarray, "N M"]:
        """(N, M) rows @ H_wᵀ, where H_w (M, B) are the columns of H in Eq. 2.6 that belong to the weights."""
        plan, at = self._plan(features, rows), np.asarray(phase, dtype=np.float64)
        # One product for all rows and features: a batch of small ones would take up to four times as long.
        parts = [block.weights(rows).reshape(-1, block.basis.size) @ block.basis(at) for block in plan.blocks]
        return plan.join(
            [part.reshape(len(rows), block.count) for part, block in zip(parts, plan.blocks, strict=True)],
            rows.shape[:1],
        )

    def project_each(
        self,
        phases: Float[np.ndarray, " P"],
        rows: Float[np.ndarray, "N B"],
        features: Int[np.ndarray, " M"] | None = None,
    ) -> Float[np.ndarray, "P N M"]:
        """(P, N, M) rows @ H_wᵀ at every phase: `project` for many phases at once."""
        plan = self._plan(features, rows)
        parts = [block.basis(phases) @ block.weights(rows).reshape(-1, block.basis.size).T for block in plan.blocks]
        shape = (len(phases), len(rows))
        return plan.join([p.reshape(*shape, b.count) for p, b in zip(parts, plan.blocks, strict=True)], shape)

    def predict_and_project(
        self,
        phases: Float[np.ndarray, " P"],
        weights: Float[np.ndarray, " B"],
        rows: Float[np.ndarray, "N B"],
        features: Int[np.ndarray, " M"] | None = None,
    ) -> tuple[Float[np.ndarray, "P M"], Float[np.ndarray, "P N M"]]:
        """(P, M) `predict` and (P, N, M) `project_each`, the bases evaluated once for both."""
        plan, means, parts, shape = self._plan(features, weights), [], [], (len(phases), len(rows))
        for block in plan.blocks:
            values = block.basis(phases)
            means.append(values @ block.weights(weights).T)
            across = values @ block.weights(rows).reshape(-1, block.basis.size).T
            parts.append(across.reshape(*shape, block.count))
        return plan.join(means, phases.shape), plan.join(parts, shape)

    def variance(
        self,
        phases: Float[np.ndarray, " P"],
        rows: Float[np.ndarray, "N B"],
        cov: Float[np.ndarray, "N N"],
        features: Int[np.ndarray, " M"] | None = None,
    ) -> Float[np.ndarray, "P M"]:
        """(P, M) the variance of the features at each phase, where w = mean + c @ rows and c has the covariance `cov`.

        Of each feature's own weights first: there are fewer of them than phases.
        """
        plan, parts = self._plan(features, rows), []
        for block in plan.blocks:
            own = block.weights(rows).transpose(1, 2, 0)  # (m, size, N)
            spread = (own.reshape(-1, len(rows)) @ cov).reshape(own.shape) @ own.swapaxes(1, 2)
            values = block.basis(phases)
            parts.append(((values @ spread) * values).sum(2).T)
        return plan.join(parts, phases.shape)

    def lift(
        self, phase: float, columns: Float[np.ndarray, "M K"], features: Int[np.ndarray, " M"] | None = None
    ) -> Float[np.ndarray, "B K"]:
        """(B, K) H_wᵀ @ columns, the adjoint of `project`; rows of features that are not asked for are zero."""
        plan, at = self._plan(features), np.asarray(phase, dtype=np.float64)
        lifted = np.zeros((self.size, columns.shape[1]))
        for block in plan.blocks:
            part = columns[block.columns][:, None, :] * block.basis(at)[:, None]
            lifted[block.places] = part.reshape(-1, columns.shape[1])
        return lifted

    def jacobian(
        self, phase: float, weights: Float[np.ndarray, " B"], features: Int[np.ndarray, " M"] | None = None
    ) -> Float[np.ndarray, "M 1+B"]:
        """(M, 1 + B) the dense [∂h/∂φ, H_w] of Eq. 2.6, nearly all zeros: for tests and for looking at."""
        slope = self.slope(np.array([phase]), weights, features)
        return np.concatenate([slope, self.project(phase, np.eye(self.size), features)]).T

    @cached_property
    def _plans(self) -> dict[bytes | None, Plan]:
        return {}

    def _plan(self, features: Int[np.ndarray, " M"] | None, weights: Float[np.ndarray, "*E B"] | None = None) -> Plan:
        """How to compute these features, made when they are first asked for."""
        if weights is not None and weights.shape[-1] != self.size:
            raise OptionError(f"expected {self.size} weights, got {weights.shape[-1]}")
        key = None if features is None else np.asarray(features, dtype=np.int64).tobytes()
        plan = self._plans.get(key)
        if plan is None:
            if len(self._plans) >= REMEMBERED:
                self._plans.clear()
            plan = make_plan(self.bases, self.slices, features)
            self._plans[key] = plan
        return plan
