"""The model as the dissertation writes it (2.3.2, 4.2.4), for its own filters: nothing of what was added since."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

import inphase
from inphase.basis import Basis
from inphase.basis.fit import residuals
from inphase.noise import Noise
from inphase.training.noise import regression_noise


def as_written(dataset: inphase.Dataset, basis: Basis | Mapping[str, Basis], *, white: bool = True) -> inphase.Model:
    """Weights as the demonstrations have them, their sample covariance, and white noise of the regression (Eq. 2.15).

    No shrinkage, no trust less than whole, no reflex, nothing held out: what chapters 2 and 3 compare, where filters
    take every reading at its word, too (`slips=False`). The spread of the tempo alone is the library's, at least a
    fifth: demonstrations that were cut to one length have none. white: False for the noise that `inphase.fit` learns,
    and all else as written, to see what the noise does.
    """
    model = inphase.fit(dataset, basis=basis, shrinkage=0.0, calibrate=False)
    written = replace(model, prior=replace(model.prior, trust=1.0), reflex=None)
    if not white:
        return written
    scaled = [model.scaling.scale(model.coordinates.from_channels(demonstration.values)) for demonstration in dataset]
    left = residuals(model.layout, [d.phases for d in dataset], scaled, model.prior.samples)
    var = regression_noise([d.times for d in dataset], left).var
    return replace(written, noise=Noise(var, np.zeros(len(var))))
