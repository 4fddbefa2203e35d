"""Time alignment for the spatial filter (4.2.7.2)."""

from intprim.filter.align import dtw

__all__ = ["dtw"]
