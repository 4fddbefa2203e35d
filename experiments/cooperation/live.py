"""The robot answers in the world itself, and the person waits for it as people do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from experiments.cooperation.demonstrations import PLACES
from experiments.cooperation.guide import led
from experiments.cooperation.methods import JOINTS, METHODS
from experiments.cooperation.plan import plan
from experiments.cooperation.sensors import TICK
from experiments.cooperation.tasks import learned
from experiments.cooperation.trial import Robot, act, leading
from experiments.study import Settings, Stored
from experiments.study.follower import Follower

LED = "led"  # by whoever demonstrates: the best there is
TAU = 0.06  # [s] within which the servos are led to a new answer
FIRST = 10_000  # trials from here on were never demonstrated
PATIENCE = 4.0  # [s] that a person waits for the robot


class Answering:
    """A robot that does what a follower foretells for now, and moves on between two rows."""

    def __init__(self, follower: Follower, begin: np.ndarray) -> None:
        self.follower = follower
        self.phases: list[float] = []
        self._goal, self._now = begin.copy(), begin.copy()

    def __call__(self, tick: int, row: np.ndarray | None) -> tuple[np.ndarray, float]:
        if row is not None:
            self.phases.append(self.follower.observe(tick * TICK, row))
            self._goal = np.asarray(self.follower.foretell()[0])
        self._now += (1 - np.exp(-TICK / TAU)) * (self._goal - self._now)
        return self._now[:JOINTS], float(self._now[JOINTS])


def answer(
    settings: Settings,
    models: Stored,
    labels: Mapping[str, str],
    place: str,
    method: str,
    trials: Sequence[int],
    film: bool = False,
) -> Mapping[str, np.ndarray]:
    """{done, waited, error, phases}: how trials end; with film, pictures of the first at 13 a second."""
    known = learned(models, labels) if method != LED else {}
    done, waited, off = [], [], []
    found: dict[str, np.ndarray] = {}
    for trial in trials:
        acted = plan(PLACES[place], settings.seed, FIRST + trial)
        rng = np.random.default_rng([settings.seed, 6000, place == "lift", trial])
        robot: Robot
        if method == LED:
            robot = leading(acted, led(acted))
        else:
            of = METHODS[method]
            follower = of.make(known[of.model], trial)
            robot = Answering(follower, follower.foretell()[0])
        pictures = ("film", 9) if film and trial == trials[0] else None
        seen = act(acted, robot, rng, pictures, patience=PATIENCE)
        done.append(seen.done)
        waited.append(seen.waited)
        off.append(seen.says["nearest"])
        if pictures:
            found["frames"] = np.array(seen.frames)
    return found | {"done": np.array(done), "waited": np.array(waited), "nearest": np.array(off)}
