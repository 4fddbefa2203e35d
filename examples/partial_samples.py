"""Sensors that come and go: samples by name, at any time, with any channel missing."""

import numpy as np

import inphase

NAMES = ["camera", "glove", "robot"]


def interaction(reach: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    times = np.linspace(0, duration, 60)
    phase = times / duration
    lift = np.sin(np.pi * phase)
    return times, np.stack([reach * phase, reach * lift, 0.5 * reach * phase + 0.2 * lift], axis=1)


def main() -> None:
    rng = np.random.default_rng(0)
    recorded = [interaction(rng.normal(1.0, 0.2), rng.uniform(1.8, 2.2)) for _ in range(15)]
    values = [v + 0.01 * rng.standard_normal(v.shape) for _, v in recorded]
    values[0][20:40, 1] = np.nan  # the glove had dropped out in one recording: that is fine
    demos = inphase.Dataset.from_arrays([t for t, _ in recorded], values, observed=NAMES[:2], controlled=NAMES[2:])
    session = inphase.fit(demos).session(filter="bip")

    times, truth = interaction(reach=1.3, duration=2.0)
    for i, (t, (camera, glove, robot)) in enumerate(zip(times, truth, strict=True)):
        if i % 4 == 0:
            sample = {"camera": camera, "glove": glove}
        elif i < 20 or i > 40:
            sample = {"glove": glove}  # the glove is faster than the camera …
        else:
            sample = {}  # … until it is lost: the session predicts
        estimate = session.observe(t, sample)
        if i % 10 == 9:
            answer = session.respond(samples=1)
            print(
                f"{t:.2f} s: phase {estimate.phase:.2f} ± {estimate.phase_std:.2f}, "
                f"robot {answer.mean[0, 0]:.2f} ± {answer.std[0, 0]:.2f} (really {robot:.2f}); {estimate.status.value}"
            )


if __name__ == "__main__":
    main()
