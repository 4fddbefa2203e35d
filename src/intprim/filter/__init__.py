"""Filters: how phase and weights are found from what is observed (4.2.7)."""

from intprim.filter import align, spatiotemporal
from intprim.filter.kf import KalmanFilter

__all__ = ["KalmanFilter", "align", "spatiotemporal"]
