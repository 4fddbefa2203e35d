"""The floor under one step of a filter: the matrix products and factorisations of its equations, and nothing else.

One call does them once, with numpy and on arrays of the right shapes that lie ready: no draws, no sums, no copies, no
Python around them. What is left out is left out of the floor, so the ratio of a step to it errs to the strict side.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

import inphase
from inphase.filters.alignment import NODES
from inphase.filters.promp import PHASES
from inphase.filters.rbpf import Rbpf

Array = np.ndarray
RNG = np.random.default_rng(0)


def floor(filter_name: str, model: inphase.Model, members: int, features: Array) -> Callable[[], object]:
    """The unavoidable work of one step in which these features are seen, with so many members or particles."""
    return FLOORS[filter_name](model, members, len(features))


def ebip(model: inphase.Model, members: int, seen: int) -> Callable[[], object]:
    """Readings of every member, their covariance, its factor, and the gain times the innovations (Eq. 3.2 to 3.7)."""
    basis, phases = model.layout.bases[0], RNG.random((members, 1))
    partner = model.layout.split(model.observed_features)[0].size
    carried = RNG.random((members, 2 + partner + min(members, model.layout.size - partner)))
    weights, readings = RNG.random((members, basis.size, seen)), RNG.random((members, seen))
    cov = some_cov(seen)

    def work() -> None:
        basis(phases) @ weights
        readings.T @ readings
        root, _ = dpotrf(cov, lower=1)
        np.linalg.multi_dot([dpotrs(root, readings.T, lower=1)[0].T, readings.T, carried])

    return work


def particle(model: inphase.Model, members: int, seen: int) -> Callable[[], object]:
    """Readings of every particle, their covariance, its factor, and every particle's squared distance."""
    basis, phases = model.layout.bases[0], RNG.random((members, 1))
    weights, readings = RNG.random((members, basis.size, seen)), RNG.random((members, seen))
    cov, share, precision = some_cov(seen), RNG.random(members), RNG.random(seen)

    def work() -> None:
        basis(phases) @ weights
        readings.T @ readings
        dpotrf(cov, lower=1)
        share @ readings
        readings @ precision

    return work


def bip(model: inphase.Model, members: int, seen: int) -> Callable[[], object]:
    """H, Σ Hᵀ, S and its factor, the gain, and what it takes from Σ (Eq. 2.6 to 2.10)."""
    basis, directions = model.layout.bases[0], len(model.prior.factor)
    size = 2 + directions
    cov, jacobian, innovation_cov = some_cov(size), RNG.random((seen, size)), some_cov(seen)
    weights = RNG.random((directions * seen, basis.size))

    def work() -> None:
        weights @ basis(np.array(0.5))
        cross = cov @ jacobian.T
        jacobian @ cross
        root, _ = dpotrf(innovation_cov, lower=1)
        dpotrs(root, cross.T, lower=1)[0].T @ cross.T

    return work


def rbpf(model: inphase.Model, members: int, seen: int) -> Callable[[], object]:
    """For every particle H, what a sample says of the weights, and the factor of all that was said."""
    basis, phases, directions = model.layout.bases[0], RNG.random(members), len(Rbpf(model).directions.rows)
    weights = RNG.random((basis.size, directions * seen))
    information = np.tile(some_cov(directions + 1), (members, 1, 1))
    scaled = RNG.random((members, directions + 1, seen))

    def work() -> None:
        basis(phases) @ weights
        scaled @ scaled.transpose(0, 2, 1)
        np.linalg.cholesky(information)

    return work


def promp(model: inphase.Model, members: int, seen: int) -> Callable[[], object]:
    """What is expected along the reference and at the nodes, with its variance, and one update of the weights."""
    basis, directions = model.layout.bases[0], len(model.prior.factor)
    cov, phases, grid = some_cov(directions), RNG.random(NODES), RNG.random(PHASES)
    weights = RNG.random((basis.size, directions * seen))
    own, at_nodes = RNG.random((seen, basis.size, directions)), RNG.random((NODES, directions, seen))
    across = RNG.random((seen, directions))
    innovation_covs, innovation_cov = np.tile(some_cov(seen), (NODES, 1, 1)), some_cov(seen)

    def work() -> None:
        basis(grid) @ ((own @ cov) @ own.swapaxes(1, 2))
        basis(phases) @ weights
        at_nodes.transpose(0, 2, 1) @ (cov @ at_nodes)
        np.linalg.cholesky(innovation_covs)
        cross = across @ cov
        cross @ across.T
        root, _ = dpotrf(innovation_cov, lower=1)
        dpotrs(root, cross, lower=1)[0].T @ cross

    return work


def some_cov(size: int) -> Array:
    """(size, size) a covariance that is well conditioned."""
    rows = RNG.standard_normal((size, size))
    return rows @ rows.T / size + np.eye(size)


FLOORS = {"bip": bip, "ebip": ebip, "particle": particle, "promp": promp, "rbpf": rbpf}
