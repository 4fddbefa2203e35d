"""The filters as plain loops over members, channels and states: what the library's own are measured and tested against.

The equations and the random draws are those of `inphase.filters`, and so are the numbers, to rounding. The manner is
that of the dissertation's library: every member is an array of its own, an inverse is an inverse, nothing is kept in a
smaller space. Covariances of an ensemble are products of two matrices, as Eq. 3.4 to 3.6 are printed. Where a filter
also tells how well it foresaw a sample, the loops do not: they pay for the belief alone. Interactions have an end;
periodic ones are not for them.

All loops are made of a model and a number of members, which those without members leave aside. `init` makes a state,
`step` the next one, `believed` tells of it the mean of phase and tempo, their covariance, and the mean weights.
"""

from __future__ import annotations

from typing import Any

from loops.bip import BipLoop
from loops.ebip import EbipLoop
from loops.particle import ParticleLoop
from loops.promp import PrompLoop
from loops.rbpf import RbpfLoop

LOOPS: dict[str, type[Any]] = {
    "bip": BipLoop,
    "ebip": EbipLoop,
    "particle": ParticleLoop,
    "promp": PrompLoop,
    "rbpf": RbpfLoop,
}
