"""The basis models of IntPrim, and the selection of one (4.2.1 to 4.2.4)."""

from intprim.basis.basis_model import BasisModel, SharedBasisModel
from intprim.basis.gaussian_model import GaussianModel
from intprim.basis.mixture_model import MixtureModel
from intprim.basis.polynomial_model import PolynomialModel
from intprim.basis.selection import Selection
from intprim.basis.sigmoidal_model import SigmoidalModel

__all__ = [
    "BasisModel",
    "GaussianModel",
    "MixtureModel",
    "PolynomialModel",
    "Selection",
    "SharedBasisModel",
    "SigmoidalModel",
]
