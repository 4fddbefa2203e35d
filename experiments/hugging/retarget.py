"""Force-based retargeting (3.2.1): joints that are wanted are changed until contact is as strong as it is wanted.

An admittance: what is missing of a contact force moves the joints that press there, by the transpose of the Jacobian,
so that they follow a body of any size and softness. Where nothing is touched they go no further than `most`, and where
nothing is wanted the change is forgotten.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

WANTED = 12.0  # [raw] from which a contact is meant
TOO_STRONG = 5.0  # times as bad as too weak


@dataclass
class Retargeting:
    """What the joints (J,) are changed by. gain: [rad/s per raw], of a place that a joint moves by 1 m per rad.

    most: [rad] the largest change of a joint. forget: [1/s] how fast it goes back where no contact is wanted.
    """

    joints: int
    gain: float = 0.006
    most: float = 0.40
    forget: float = 3.0
    change: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        self.change = np.zeros(self.joints)

    def step(self, wanted: np.ndarray, felt: np.ndarray, inward: np.ndarray, dt: float) -> np.ndarray:
        """(J,) the change, dt [s] later. wanted, felt: (G,) [raw] by group. inward: (G, J) [m/rad], see below.

        inward: how fast every group moves towards what it presses, as a joint turns.
        """
        meant = wanted > WANTED
        missing = np.where(meant | (felt > wanted + WANTED), wanted - felt, 0.0)  # too strong is never meant
        missing = np.where(missing < 0, TOO_STRONG * missing, missing)
        held = np.any((np.abs(inward) > 0.05) & (meant | (missing < 0))[:, None], axis=0)
        self.change += dt * self.gain * (inward.T @ missing)
        self.change[~held] *= np.exp(-self.forget * dt)
        self.change = np.clip(self.change, -self.most, self.most)
        return self.change.copy()
