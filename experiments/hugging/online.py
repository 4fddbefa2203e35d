"""66 hugs with three people, two of whom the robot has never met (3.3.2.3)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from experiments.hugging.demonstrations import TRAINED, people
from experiments.hugging.hug import Hug, hug
from experiments.hugging.learned import Learned, model
from experiments.hugging.success import judge
from experiments.hugging.world import world
from experiments.study.film import camera

FILTERS = ("rbpf", "ebip")
CASES = {"long": 6, "short": 6, "nothing": 2, "late": 2, "raised": 2, "air": 2, "apart": 2}  # times, a person
PARTNERS = {"trained": 0, "novel 1": TRAINED, "novel 2": TRAINED + 1}  # among those of demonstrations.people
NAMES = {
    "long": "long hug",
    "short": "short hug",
    "nothing": "doing nothing",
    "late": "delay before hugging",
    "raised": "delay after raising arms",
    "air": "hugging the air, not moving",
    "apart": "hugging without contact",
}


def online(
    stored: Mapping[str, Mapping[str, Any]], partner: int, kind: str, number: int, filter: str, seed: int
) -> dict[str, Any]:
    """One of them, and what is told of it."""
    played, mover = play(stored, partner, kind, number, filter, seed)
    asked, visit = judge(played), played.visit
    return {
        "asked": list(asked),
        "so": list(asked.values()),
        "times": played.times,
        "beliefs": np.array(mover.beliefs),
        "read": played.read.astype(np.float32),
        "wanted": played.wanted,
        "clock": played.clock,
        "pressing": played.pressing,
        "holding": played.holding,
        "near": played.near,
        "gap": played.gap,
        "raised": played.raised,
        "marks": [visit.starts, visit.raises, visit.wraps, visit.holds_from, visit.withdraws, visit.gone],
    }


def play(
    stored: Mapping[str, Mapping[str, Any]],
    partner: int,
    kind: str,
    number: int,
    filter: str,
    seed: int,
    watch: Any = None,
) -> tuple[Hug, Learned]:
    """One hug with the robot moved by the model. watch: is given what every period looks like."""
    kinds = list(CASES)
    rng = np.random.default_rng([seed, 3, partner, kinds.index(kind), number])
    who = people(seed)[partner]
    place, visit = world(who.body), who.once(rng, kind)
    with threadpool_limits(limits=1):
        mover = Learned(model(stored["model"]).session(filter, seed=number))
        return hug(place, visit, mover, rng, matches=False, watch=watch), mover


def filmed(
    stored: Mapping[str, Mapping[str, Any]], partner: int, kind: str, number: int, seed: int, fps: float, rate: int
) -> dict[str, Any]:
    """Frames (T, H, W, 3) of one hug, `fps` a second of it, and when they were [s]. rate: periods a second."""
    frames: list[np.ndarray] = []
    times: list[float] = []
    with camera(world(people(seed)[partner].body).model, "film") as look:
        every, count = round(rate / fps), 0

        def watch(data: Any) -> None:
            nonlocal count
            if count % every == 0:
                frames.append(look(data))
                times.append(count / rate)
            count += 1

        played, _ = play(stored, partner, kind, number, "rbpf", seed, watch)
    visit = played.visit
    marks = [visit.starts, visit.raises, visit.wraps, visit.holds_from, visit.withdraws, visit.gone]
    return {"frames": np.array(frames), "times": times, "marks": marks}
