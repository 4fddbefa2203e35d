"""The metrics, where evaluation looks for them."""

from inphase.metrics import MARKS, NINETY, Errors, Scores, difference

__all__ = ["MARKS", "NINETY", "Errors", "Scores", "difference"]
