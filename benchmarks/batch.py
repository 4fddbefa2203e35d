"""Many interactions at once: one after another, by processes side by side, or as one array; which is faster?"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from chance import STEP, Extent, make_model, observations
from sizes import DURATION
from timing import duration

import inphase
from inphase.filters import make
from inphase.workers import workers

SIZES = {"2 × 8": Extent(2, 8, 100, 62), "12 × 7": Extent(12, 7, 100, 62), "62 × 9": Extent(62, 9, 100, 62)}
FILTERS = ("ebip", "rbpf")
BATCHES = (1, 2, 4, 8, 16)
SAMPLES = 40  # of an interaction
PROCESSES = 2
TRIES = 2  # of every measurement, by turns: the shortest counts
REPEATS = 7


def play(model: inphase.Model, name: str, options: dict[str, int], stream: np.ndarray, seed: int) -> float:
    """One interaction, as an evaluation plays it; the processor time it takes [s]."""
    begun = time.process_time()
    session = model.session(name, seed, **options)
    for k, row in enumerate(stream):
        session.observe(STEP * DURATION * k, row)
        session.respond(samples=2)
    return time.process_time() - begun


def measure(title: str, extent: Extent, name: str, batches: tuple[int, ...], rng: np.random.Generator) -> list[dict]:
    """Rows by batch: seconds an interaction takes alone, and how many times faster the other ways are.

    workers: as it was, with whatever else the machine had to do. idle_workers: by processor time, were every process
    to have a core for itself. stacked: at most.
    """
    model = make_model(extent, rng)
    options = {"members" if name == "ebip" else "particles": extent.members}
    stream = np.array([observation.values for observation in observations(model, SAMPLES, rng)])
    rows = []
    with workers(PROCESSES) as team:
        team.run(play, [(model, name, options, stream[:2], 0)] * 2 * PROCESSES)  # they start, and import
        for batch in batches:
            tasks = [(model, name, options, stream, seed) for seed in range(batch)]
            taken = []
            for _ in range(TRIES):
                begun = time.perf_counter()
                alone = [play(*task) for task in tasks]
                middle = time.perf_counter()
                shared = team.run(play, tasks)
                taken.append((middle - begun, time.perf_counter() - middle, sum(alone), sum(shared)))
            one, two, one_work, two_work = np.min(taken, axis=0).tolist()
            stacked = ebip_stacked if name == "ebip" else rbpf_stacked
            rows.append(
                {
                    "size": title,
                    "filter": name,
                    "batch": batch,
                    "seconds": one / batch,
                    "workers": one / two,
                    "idle_workers": min(batch, PROCESSES) * one_work / two_work,
                    "stacked": stacked(model, extent, batch, rng),
                }
            )
    return rows


def rbpf_stacked(model: inphase.Model, extent: Extent, batch: int, rng: np.random.Generator) -> float:
    """How many times faster one step of batch · P particles is than `batch` steps of P: no batch can gain more."""
    filters = [make("rbpf", model, particles=count * extent.members) for count in (1, batch)]
    beliefs, taken = [filter.init(rng) for filter in filters], []
    for observation in observations(model, REPEATS + 1, rng):
        both = []
        for k, filter in enumerate(filters):
            begun = time.perf_counter()
            beliefs[k], _ = filter.step(beliefs[k], observation, STEP * DURATION, rng)
            both.append(time.perf_counter() - begun)
        taken.append(both)
    one, all_of_them = np.min(taken[1:], axis=0)
    return float(batch * one / all_of_them)


def ebip_stacked(model: inphase.Model, extent: Extent, batch: int, rng: np.random.Generator) -> float:
    """How many times faster the array work of `batch` ebip steps is with a leading batch dimension than in a loop."""
    members = rng.standard_normal((batch, extent.members, 2 + extent.weights))
    phases, values = rng.random((batch, extent.members)), rng.standard_normal(extent.observed)
    basis = model.layout.bases[0]

    def loop() -> None:
        for some, at in zip(members, phases, strict=True):
            ebip_products(some, at, basis, values)

    taken = [(duration(loop), duration(lambda: ebip_products(members, phases, basis, values))) for _ in range(REPEATS)]
    each, together = np.min(taken[1:], axis=0)
    return float(each / together)


def ebip_products(members: np.ndarray, phases: np.ndarray, basis: Any, values: np.ndarray) -> np.ndarray:
    """Eq. 3.2 to 3.7 without the noise, for members (*batch, E, 2 + B)."""
    count, shown = members.shape[-2], len(values)
    weights = members[..., 2 : 2 + shown * basis.size].reshape(*members.shape[:-1], shown, basis.size)
    readings = (weights @ basis(phases)[..., None])[..., 0]
    deviations = readings - readings.mean(-2, keepdims=True)
    turned = deviations.swapaxes(-1, -2)
    cov = turned @ deviations / (count - 1) + np.eye(shown)
    cross = turned @ (members - members.mean(-2, keepdims=True)) / (count - 1)
    root = np.linalg.cholesky(cov)
    gain = np.linalg.solve(root.swapaxes(-1, -2), np.linalg.solve(root, cross))
    return np.asarray(members + (values - readings) @ gain)


def fastest(row: dict) -> str:
    """Which of the three ways is fastest where cores are idle, by more than noise: a tenth."""
    ways = {"one after another": 1.1, f"{PROCESSES} workers": row["idle_workers"], "one array": row["stacked"]}
    return max(ways, key=ways.__getitem__)
