"""How long one observe and one respond take, by filter and size, in one sitting with one BLAS thread.

Times on a shared machine are worth little by themselves: the last column is the ratio to a fixed piece of numpy work
(a 200 x 200 matrix product) timed in the same run. `--json FILE` writes the figures.
"""

from __future__ import annotations

import argparse
import json
import os
import time

for variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"  # before numpy is loaded: two threads make short products slower, and unsteady

import numpy as np  # noqa: E402

import inphase  # noqa: E402
from inphase.filters import FILTERS  # noqa: E402

# channels, basis functions a channel, demonstrations, of the dissertation's experiments (2.5, 3.3)
SIZES = ((2, 8, 50), (12, 7, 100), (30, 15, 108), (74, 8, 30), (62, 9, 80))
QUICK = SIZES[:2]


def make_model(channels: int, size: int, demonstrations: int, rng: np.random.Generator) -> inphase.Model:
    """A model of smooth random curves; half of the channels are observed."""
    phases = np.linspace(0, 1, 60)
    basis = inphase.basis.Gaussian(size)
    curves = [basis(phases) @ rng.standard_normal((size, channels)) for _ in range(demonstrations)]
    names = [f"channel_{i}" for i in range(channels)]
    dataset = inphase.Dataset.from_arrays(
        times=[2 * phases] * demonstrations,
        values=[curve + 0.01 * rng.standard_normal(curve.shape) for curve in curves],
        observed=names[: channels // 2],
        controlled=names[channels // 2 :],
    )
    return inphase.fit(dataset, basis=basis)


def durations(call: object, repeats: int) -> np.ndarray:
    """The time of every call [s]."""
    taken = []
    for i in range(repeats):
        begun = time.perf_counter()
        call(i)  # type: ignore[operator]
        taken.append(time.perf_counter() - begun)
    return np.array(taken)


def measure(model: inphase.Model, name: str, repeats: int, rng: np.random.Generator) -> dict[str, float]:
    """Median and 99th percentile of observe and respond [ms]."""
    session = model.session(name, seed=0)
    curve = model.predict(np.linspace(0, 1, repeats))[:, : len(model.observed)]
    stream = curve + 0.01 * rng.standard_normal(curve.shape)
    observe = 1e3 * durations(lambda i: session.observe(2 * i / repeats, stream[i]), repeats)
    respond = 1e3 * durations(lambda i: session.respond(samples=2), repeats)
    return {
        "observe": float(np.median(observe)),
        "observe_p99": float(np.quantile(observe, 0.99)),
        "respond": float(np.median(respond)),
        "respond_p99": float(np.quantile(respond, 0.99)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two small sizes, few repeats")
    parser.add_argument("--json", metavar="FILE")
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    matrix = rng.standard_normal((200, 200))
    yardstick = 1e3 * float(np.median(durations(lambda i: matrix @ matrix, 200)))
    print(f"yardstick, a 200 x 200 product: {yardstick:.3f} ms")
    print(
        f"{'channels x basis, demonstrations':34s} {'filter':6s} {'observe':>9s} {'p99':>9s}"
        f" {'respond':>9s} {'p99':>9s}  ratio"
    )
    rows = []
    for channels, size, demonstrations in QUICK if options.quick else SIZES:
        model = make_model(channels, size, demonstrations, rng)
        for name in FILTERS:
            row = measure(model, name, 30 if options.quick else 300, rng)
            row |= {"ratio": (row["observe"] + row["respond"]) / yardstick}
            rows.append({"channels": channels, "basis": size, "demonstrations": demonstrations, "filter": name, **row})
            print(
                f"{f'{channels} x {size}, {demonstrations}':34s} {name:6s}"
                + "".join(f" {row[key]:6.3f} ms" for key in ("observe", "observe_p99", "respond", "respond_p99"))
                + f"  {row['ratio']:5.1f}",
                flush=True,
            )
    if options.json:
        with open(options.json, "w") as file:
            json.dump({"yardstick_ms": yardstick, "rows": rows}, file, indent=1)
        print(f"wrote {options.json}")


if __name__ == "__main__":
    main()
