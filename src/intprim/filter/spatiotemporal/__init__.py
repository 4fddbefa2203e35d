"""Filters that find phase and weights together (4.2.7.1)."""

from intprim.filter.spatiotemporal.ekf import ExtendedKalmanFilter
from intprim.filter.spatiotemporal.enkf import EnsembleKalmanFilter
from intprim.filter.spatiotemporal.pf import ParticleFilter

__all__ = ["EnsembleKalmanFilter", "ExtendedKalmanFilter", "ParticleFilter"]
