"""A partner live: a sample and a response at a fixed rate, as a robot's control loop asks for them.

The loop runs by the clock: a cycle is one `observe` and one `respond` of two samples; where an interaction ends, the
next begins with `reset`, outside of the cycles. The garbage collector is left as it is. Then: a whole response beside
one update, the first update beside the others, and the memory of a session that lasts for hours.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import one_thread  # noqa: F401 - before numpy

# isort: split
import numpy as np
from session_memory import session_memory
from sizes import DURATION, Size, make_model, partner
from timing import duration, spread

import inphase
from inphase.errors import OptionError
from inphase.filters import FILTERS
from inphase.io.atomic import check_target, whole_file
from inphase.workers import workers

SPIN = 0.001  # [s] before its time, a cycle is awaited by looking at the clock: sleep comes back late
MEMBERS = {"ebip": "members", "particle": "particles", "rbpf": "particles"}
RESPONSE = Size(74, 8, 30)  # of the dissertation's sizes, that for which a whole response is wanted
WANTED = 0.1  # of an update, for a whole response
INTERACTIONS = 5  # different ones


def pace(
    cycle: Callable[[int], object], between: Callable[[int], object], count: int, period: float
) -> tuple[list[float], list[float]]:
    """How long each of so many cycles took, and how late it began [s]; they begin a `period` apart, by the clock.

    `between` is called after every cycle, and not counted. A cycle whose time has passed begins at once.
    """
    taken, late = [], []
    start = time.perf_counter() + period
    for i in range(count):
        due = start + i * period
        if (left := due - time.perf_counter() - SPIN) > 0:
            time.sleep(left)
        while (now := time.perf_counter()) < due:
            pass
        cycle(i)
        taken.append(time.perf_counter() - now)
        late.append(now - due)
        between(i)
    return taken, late


def loop(session: inphase.Session, rate: float, seconds: float, rng: np.random.Generator) -> dict[str, float]:
    """The figures of so many seconds of cycles at a rate."""
    samples, count = round(DURATION * rate), max(round(seconds * rate), 2)
    streams = [partner(session.model, samples, rng) for _ in range(INTERACTIONS)]
    resets: list[float] = []

    def cycle(i: int) -> None:
        interaction, k = divmod(i, samples)
        session.observe(k / rate, streams[interaction % INTERACTIONS][k])
        session.respond(samples=2)

    def between(i: int) -> None:
        if (i + 1) % samples == 0:
            resets.append(duration(lambda: session.reset(seed=i)))

    taken, late = pace(cycle, between, count, 1 / rate)
    return {
        "cycles": count,
        "period": 1e6 / rate,
        **spread(taken),
        "late_p99": spread(late)["p99"],
        "share_of_half_a_period": float(np.quantile(taken, 0.99)) * 2 * rate,
        "overruns": int((np.array(taken) > 1 / rate).sum()),
        "reset_max": 1e6 * max(resets, default=0.0),
    }


def responses(model: inphase.Model, name: str, options: dict[str, int], repeats: int) -> dict[str, float]:
    """A response of 50 samples with its band beside one update, by turns: medians [µs]."""
    session, taken = model.session(name, **options), []
    for k, row in enumerate(partner(model, repeats, np.random.default_rng(0))):
        update = duration(lambda k=k, row=row: session.observe(DURATION * k / repeats, row))
        taken.append((update, duration(lambda: session.respond(samples=50))))
    update, response = 1e6 * np.median(taken, axis=0)
    return {"update": float(update), "response": float(response), "ratio": float(response / update)}


def first_updates(path: str, name: str, options: dict[str, int], stream: np.ndarray) -> list[float]:
    """How long each update took [s] in a program that has just loaded its model."""
    with workers(1):
        session = inphase.Model.load(path).session(name, **options)
        steps = enumerate(stream)
        return [duration(lambda k=k, row=row: session.observe(DURATION * k / len(stream), row)) for k, row in steps]


def first(model: inphase.Model, name: str, options: dict[str, int], repeats: int, starts: int) -> dict[str, float]:
    """The first update beside the median of the rest [µs], in new processes that load the model from a file."""
    stream, found = partner(model, repeats, np.random.default_rng(0)), []
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "live.inphase")
        model.save(path)
        for _ in range(starts):
            with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as new:
                found.append(new.submit(first_updates, path, name, options, stream).result())
    begun, rest = 1e6 * min(one[0] for one in found), 1e6 * min(float(np.median(one[1:])) for one in found)
    return {"first": begun, "rest": rest, "ratio": begun / rest}


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a second at a small size: no evidence of anything")
    parser.add_argument("--seconds", type=float, metavar="S")
    parser.add_argument("--rate", type=float, default=500.0, metavar="HZ")
    parser.add_argument("--filter", choices=list(FILTERS), default="ebip")
    parser.add_argument("--channels", type=int)
    parser.add_argument("--basis", type=int)
    parser.add_argument("--members", type=int, help="or particles, and demonstrations")
    parser.add_argument("--hours", type=float, default=10.0, metavar="H", help="of the long session")
    parser.add_argument("--observes", type=int, metavar="N", help="so many samples of it are shown, at most")
    parser.add_argument("--json", metavar="FILE", help="where to write the figures")
    options = parser.parse_args()
    if options.json:
        try:
            check_target(options.json)
        except OptionError as error:
            parser.error(str(error))
    usual = (0.5, 4, 5, 20, 1000) if options.quick else (60.0, 62, 9, 80, 120_000)
    given = (options.seconds, options.channels, options.basis, options.members, options.observes)
    seconds, channels, basis, members, observes = (u if g is None else g for u, g in zip(usual, given, strict=True))
    size, rng, name = Size(channels, basis, members), np.random.default_rng(0), options.filter
    sized = {MEMBERS[name]: members} if name in MEMBERS else {}
    figures: dict[str, object] = {"version": inphase.__version__, "filter": name, "size": str(size)}
    with workers(1):  # scipy brings a BLAS of its own
        model = make_model(size, rng)
        print(f"{name}, {size}, {options.rate:g} Hz for {seconds:g} s")
        live = loop(model.session(name, **sized), options.rate, seconds, rng)
        figures["live"] = live
        print(
            f"  a cycle [µs]: median {live['median']:.0f}, p99 {live['p99']:.0f}, max {live['max']:.0f}; "
            f"p99 is {100 * live['share_of_half_a_period']:.0f} % of half a period\n"
            f"  {live['overruns']} of {live['cycles']} took more than a period; p99 of how late they began: "
            f"{live['late_p99']:.0f} µs; a reset takes up to {live['reset_max']:.0f} µs"
        )
        other, large = (size, model) if options.quick else (RESPONSE, make_model(RESPONSE, rng))
        response = responses(large, name, sized, 20 if options.quick else 200)
        figures["response"] = {"size": str(other), **response}
        print(
            f"a response of 50 samples, {other}: {response['response']:.0f} µs, "
            f"{response['ratio']:.2f} of an update of {response['update']:.0f} µs (wanted: {WANTED:g})"
        )
        begun = first(model, name, sized, 20 if options.quick else 100, 1 if options.quick else 3)
        figures["first"] = begun
        print(
            f"the first update: {begun['first']:.0f} µs, {begun['ratio']:.2f} times the others' {begun['rest']:.0f} µs"
        )
        memory = session_memory(model.session(name, **sized), partner(model, 60, rng), options.hours, observes)
        figures["memory"] = memory
        print(
            f"a session of {options.hours:g} hours, {memory['observes']} samples: resident memory "
            f"{memory['resident_before'] / 2**20:.1f} → {memory['resident_after'] / 2**20:.1f} MiB; the last "
            f"{memory['traced_observes']} left {memory['traced_growth'] / 1024:+.1f} KiB behind"
        )
    if options.json:
        with whole_file(options.json) as temporary:
            temporary.write_text(json.dumps(figures, indent=1), encoding="utf-8")
        print(f"wrote {options.json}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
