"""The names of chapter 4 of the dissertation, for scripts written for IntPrim, over `inphase`."""

from intprim import basis, constants, examples, filter, util
from intprim.bayesian_interaction_primitives import BayesianInteractionPrimitive

__all__ = ["BayesianInteractionPrimitive", "basis", "constants", "examples", "filter", "util"]
