"""What a user of a session waits for: a sample taken in, and answers of two lengths."""

from __future__ import annotations

from typing import Any

import numpy as np
from sizes import DURATION, Size, partner, untouched
from step_rows import options
from timing import duration, durations, spread

import inphase

FIRST = 5  # sessions whose first sample is timed
SHORT, LONG = 2, 50  # samples of a response


def measure_session(model: inphase.Model, name: str, size: Size, *, repeats: int) -> dict[str, Any]:
    """Times [µs] of observe and respond along an interaction.

    first: the first sample of a session whose model has not been used, over the median of all samples after it.
    """
    stream = partner(model, repeats, np.random.default_rng(0))

    def session(model: inphase.Model) -> inphase.Session:
        return model.session(name, seed=0, **options(name, size))

    one, observing, short, long = session(model), [], [], []
    for i, values in enumerate(stream):
        observing.append(duration(lambda at=DURATION * i / repeats, values=values: one.observe(at, values)))
        short.append(duration(lambda: one.respond(samples=SHORT)))
        long.append(duration(lambda: one.respond(samples=LONG)))
    fresh = [session(untouched(model)) for _ in range(FIRST)]
    first = float(np.median(durations(lambda i: fresh[i].observe(0.0, stream[0]), FIRST)))
    times = (("observe", observing[1:]), ("respond_2", short), ("respond_50", long))
    return {
        "size": str(size),
        "filter": name,
        **{f"{what}_{key}": value for what, taken in times for key, value in spread(taken).items()},
        "first": first / float(np.median(observing[1:])),
    }
