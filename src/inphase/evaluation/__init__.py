"""Evaluation: how well a model follows interactions it has not seen."""

from inphase.evaluation.baselines import BASELINES
from inphase.evaluation.conditions import CONDITIONS, warp
from inphase.evaluation.predictor import Filtered, Learner, Predictor, play
from inphase.evaluation.protocol import evaluate
from inphase.evaluation.replay import Replay, replay
from inphase.evaluation.results import METRICS, Evaluation, Figure, Row
from inphase.metrics import Errors, Scores, difference

__all__ = [
    "BASELINES",
    "CONDITIONS",
    "METRICS",
    "Errors",
    "Evaluation",
    "Figure",
    "Filtered",
    "Learner",
    "Predictor",
    "Replay",
    "Row",
    "Scores",
    "difference",
    "evaluate",
    "play",
    "replay",
    "warp",
]
