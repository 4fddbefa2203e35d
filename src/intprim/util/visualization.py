"""The pictures of the tutorial (4.2.8): trajectories (D, T), what was inferred of them, and distributions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inphase import DataError
from intprim.checks import numbers


def plot_distribution(dof_names: Sequence[str], mean: ArrayLike, upper_bound: ArrayLike, lower_bound: ArrayLike) -> Any:
    """Show the mean (D, T) of each DoF within its bounds."""
    figure, axes = _figure(f"Trajectory distribution for degree {name}" for name in dof_names)
    for own, middle, upper, lower in zip(axes, *map(_matrix, (mean, upper_bound, lower_bound)), strict=True):
        phases = np.linspace(0, 1, len(middle))
        own.fill_between(phases, lower, upper, color="#ccf5ff")
        own.plot(phases, middle, color="#000000")
    return _shown(figure)


def plot_trajectory(
    dof_names: Sequence[str],
    trajectory: ArrayLike,
    observed_trajectory: ArrayLike,
    mean_trajectory: ArrayLike | None = None,
) -> Any:
    """Show an inferred trajectory (D, T) beside the observed one, DoF by DoF over the phase."""
    figure, axes = _figure(f"Trajectory for degree {name}" for name in dof_names)
    for label, values in (("Inferred", trajectory), ("Observed", observed_trajectory), ("Mean", mean_trajectory)):
        for own, row in zip(axes, _matrix(values), strict=True) if values is not None else ():
            own.plot(np.linspace(0, 1, len(row)), row, label=label)
            own.legend()
    return _shown(figure)


def plot_partial_trajectory(
    trajectory: ArrayLike, partial_observed_trajectory: ArrayLike, mean_trajectory: ArrayLike | None = None
) -> Any:
    """Show the first two DoFs (D, T) in a plane: what was observed so far, and what was inferred of the rest."""
    figure, (axes,) = _figure([f"Observed samples: {np.shape(partial_observed_trajectory)[-1]}"])
    for label, values, style in (
        ("Observed", partial_observed_trajectory, {"color": "#6ba3ff", "linewidth": 3.0}),
        ("Inferred", trajectory, {"color": "#ff6a6a", "linewidth": 2.0, "linestyle": "--"}),
        ("Mean", mean_trajectory, {"color": "#85d87f"}),
    ):
        if values is not None:
            matrix = _matrix(values)
            if len(matrix) < 2:
                raise DataError(f"{label.lower()} trajectory: expected at least two DoFs, got {len(matrix)}")
            axes.plot(matrix[0], matrix[1], label=label, **style)
    axes.legend()
    return _shown(figure)


def plot_approximation(
    dof_names: Sequence[str], trajectory: ArrayLike, approx_trajectory: ArrayLike, approx_trajectory_deriv: ArrayLike
) -> Any:
    """Show each DoF (D, T) as recorded, as its weights tell it, and the slope of that, over the phase."""
    kinds = ("Original {} Data", "Approximated {} Data", "Approximated {} Derivative")
    figure, axes = _figure(kind.format(name) for name in dof_names for kind in kinds)
    for first, values in enumerate((trajectory, approx_trajectory, approx_trajectory_deriv)):
        for own, row in zip(axes[first::3], _matrix(values), strict=True):
            own.plot(np.linspace(0, 1, len(row)), row)
    return _shown(figure)


def plot_weights(weight_matrix: ArrayLike) -> Any:
    """Show a matrix of weights, or their covariance, as shades."""
    figure, (axes,) = _figure(["Weights"])
    figure.colorbar(axes.imshow(_matrix(weight_matrix), cmap="gray", interpolation="none"))
    return _shown(figure)


def plot_functions(title: str, functions: Callable[[Any], Any], weights: Any = 1.0) -> Any:
    """Show functions of the phase, (T,) -> (T, degree), together in one picture, each times its weight."""
    figure, (axes,) = _figure([title])
    phases = np.linspace(0.0, 1.0, 100)
    axes.plot(phases, functions(phases) * weights)
    return _shown(figure)


def _figure(titles: Iterable[str]) -> tuple[Any, Any]:
    from matplotlib import pyplot as plt

    titles = list(titles)
    size = (6.4, max(4.8, 2 * len(titles)))
    figure, axes = plt.subplots(len(titles), squeeze=False, layout="constrained", figsize=size)
    for own, title in zip(axes[:, 0], titles, strict=True):
        own.set_title(title)
    return figure, axes[:, 0]


def _shown(figure: Any) -> Any:
    from matplotlib import pyplot as plt

    plt.show()
    return figure


def _matrix(values: ArrayLike) -> Any:
    return numbers("trajectory", values, "D T", finite=False)
