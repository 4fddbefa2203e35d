"""A rhythmic interaction, such as turning a rope together: the phase rolls over and the session goes on and on."""

import numpy as np

import inphase


def cycle(size: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    times = np.linspace(0, duration, 50)
    angle = 2 * np.pi * times / duration
    return times, size * np.stack([np.cos(angle), np.sin(angle), np.cos(angle + 0.5)], axis=1)


def main() -> None:
    rng = np.random.default_rng(0)
    recorded = [cycle(rng.normal(0.4, 0.05), rng.uniform(0.9, 1.1)) for _ in range(12)]
    demos = inphase.Dataset.from_arrays(
        times=[t for t, _ in recorded],
        values=[v + 0.005 * rng.standard_normal(v.shape) for _, v in recorded],
        observed=["hand_x", "hand_y"],
        controlled=["robot_x"],
    )
    model = inphase.fit(demos, phase=inphase.learn_phase(demos, periodic=True))
    session = model.session(seed=0)

    for i in range(240):  # eight seconds at 30 Hz, faster than any demonstration
        t = i / 30
        angle = 2 * np.pi * t / 0.85
        estimate = session.observe(t, 0.42 * np.array([np.cos(angle), np.sin(angle)]))
        if i % 30 == 29:
            ahead = session.respond(samples=5)
            print(
                f"{t:.2f} s: phase {estimate.phase:.2f} (really {(t / 0.85) % 1:.2f}), "
                f"{1 / estimate.phase_velocity:.2f} s a turn, robot next "
                + ", ".join(f"{x:+.2f}" for x in ahead.mean[:, 0])
            )


if __name__ == "__main__":
    main()
