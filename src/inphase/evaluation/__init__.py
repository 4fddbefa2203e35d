"""Evaluation: how well a model follows interactions it has not seen."""

from inphase.evaluation.metrics import Scores, difference
from inphase.evaluation.replay import Replay, replay

__all__ = ["Replay", "Scores", "difference", "replay"]
