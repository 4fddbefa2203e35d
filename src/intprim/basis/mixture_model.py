"""Several basis models, one after the other, for different degrees of freedom (4.2.3)."""

from __future__ import annotations

from collections.abc import Sequence

from inphase import OptionError
from intprim.basis.basis_model import BasisModel, SharedBasisModel


class MixtureModel(BasisModel):
    """The DoFs of the models in their order, each with its own basis. Not a mixture of densities.

    Raises OptionError without models, for what is no basis model, and for one that is itself a mixture.
    """

    def __init__(self, basis_models: Sequence[BasisModel]) -> None:
        for model in basis_models:
            if not isinstance(model, SharedBasisModel):
                kind = type(model).__name__
                raise OptionError(f"basis_models: expected Gaussian-, Sigmoidal- or PolynomialModels, got a {kind}")
        if not len(basis_models):
            raise OptionError("basis_models: expected at least one basis model, got none")
        self.basis_models = list(basis_models)
        super().__init__(
            [basis for model in self.basis_models for basis in model.layout.bases],
            [basis for model in self.basis_models for basis in model._old_bases],
            [name for model in self.basis_models for name in model.observed_dof_names],
        )
