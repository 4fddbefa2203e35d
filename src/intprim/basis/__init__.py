"""The basis models of IntPrim, and the selection of one (4.2.1 to 4.2.4)."""

from intprim.basis.basis_model import BasisModel
from intprim.basis.families import GaussianModel, MixtureModel, PolynomialModel, SigmoidalModel
from intprim.basis.selection import Selection

__all__ = ["BasisModel", "GaussianModel", "MixtureModel", "PolynomialModel", "Selection", "SigmoidalModel"]
