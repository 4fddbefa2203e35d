"""Dynamic time warping with an open end: where in an expected trajectory an observed one has come to (4.2.7.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from intprim.checks import numbers


def fastdtw(observed_trajectory: ArrayLike, predicted_trajectory: ArrayLike) -> int:
    """The index in the predicted trajectory (N, M) where the cheapest path of the whole observed one (T, M) ends.

    Both begin together. A path goes on by a sample of one, the other or both, and pays the Euclidean distance of every
    pair that it visits (Sakoe and Chiba 1978, without a slope constraint). Raises DataError for other shapes.
    """
    predicted = numbers("predicted_trajectory", predicted_trajectory, "N M")
    observed = numbers("observed_trajectory", observed_trajectory, "T M", M=predicted.shape[1])
    costs = np.full(len(predicted), np.inf)
    for step, sample in enumerate(observed):
        price = np.linalg.norm(predicted - sample, axis=1)
        before = np.minimum(costs, np.concatenate([[np.inf if step else 0.0], costs[:-1]]))
        # Along a row of the table: the cheapest place to have come from, and all that was paid since.
        paid = np.cumsum(price)
        costs = paid + np.minimum.accumulate(before - np.concatenate([[0.0], paid[:-1]]))
    return int(costs.argmin())
