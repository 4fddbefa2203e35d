"""What a throw looks like, and what the robot believed on the way."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.catching.closed_loop import loaded
from experiments.catching.demonstrations import TESTED, thrown
from experiments.catching.trial import RATE, played
from experiments.catching.world import World, built
from experiments.study import Found
from experiments.study.film import camera
from inphase.runtime import Loop

JOINT = "elbow"  # the third, as in Fig. 28
AT = np.linspace(0, 1, 40)  # phases of what is foreseen


def filmed(models: Found, number: int, seed: int, fps: int) -> dict[str, Any]:
    """Frames (T, H, W, 3) of a throw, slowed down by half where fps is 30, and the course of one joint's belief.

    times: (T,) [s]. mean, std: (T, 40) of the joint over the whole phase. phase: (T,). truth: (T,) where it was.
    """
    model = loaded(models)
    every = round(RATE / fps)
    frames, course, count = [], [], [0]
    happens, _ = thrown(seed, number, TESTED)
    with camera(built(happens.style.height), "side") as look:

        def watching(world: World, loop: Loop) -> None:
            count[0] += 1
            if world.entered is not None and world.time > world.entered + 0.4:
                return
            if count[0] % every == 0:
                world.show()
                frames.append(look(world.data))
            if loop.estimate is not None and world.entered is None:
                foreseen = loop.perception.session.respond(start=0.0, samples=len(AT), channels=[JOINT])
                joint = world.joints[2]
                course.append((world.time, loop.estimate.phase, joint, foreseen.mean[:, 0], foreseen.std[:, 0]))

        outcome = played(model.session(seed=seed), number, "all modalities", seed, seen=True, watching=watching)
    times, phase, truth, mean, std = (np.array(column) for column in zip(*course, strict=True))
    return {
        "frames": np.array(frames),
        "times": times,
        "phase": phase,
        "truth": truth,
        "mean": mean,
        "std": std,
        "caught": outcome.caught,
        "every": every / RATE,
        "release": outcome.world.throw.release,
        "entered": np.nan if outcome.world.entered is None else outcome.world.entered,
    }
