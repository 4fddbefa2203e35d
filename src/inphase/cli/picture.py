"""What the picture needs of a replay."""

from __future__ import annotations

import numpy as np

from inphase.evaluation.replay import Replay
from inphase.metrics import MARKS
from inphase.model import Model
from inphase.report.replay_picture import ReplayPanel
from inphase.trajectory import Demonstration


def panel(title: str, model: Model, demonstration: Demonstration, played: Replay) -> ReplayPanel:
    """A replay to draw."""
    moments = played.moments
    mean = np.array([m.response.mean[0] for m in moments])
    return ReplayPanel(
        title,
        model,
        times=demonstration.times - demonstration.times[0],
        phases=demonstration.phases,
        # Angles and quaternions are drawn on the branch of the response: what is apart is wrong.
        truth=mean - np.array([m.now_error for m in moments]),
        estimates=[m.estimate for m in moments],
        responses=[m.response for m in moments],
        previews=dict(zip(MARKS, (m.preview for m in moments if m.preview is not None), strict=True)),
    )
