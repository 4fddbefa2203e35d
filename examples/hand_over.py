"""Learn a hand-over from a few demonstrations, then follow a person who reaches somewhere new, at another pace."""

import numpy as np

import inphase

OBSERVED, CONTROLLED = ["person_x", "person_y", "person_z"], ["robot_x", "robot_y", "robot_z"]
REST_PERSON, REST_ROBOT = np.array([0.0, 0.0, 0.9]), np.array([1.2, 0.0, 0.8])


def interaction(goal: np.ndarray, duration: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Both hands glide from where they rest to the goal; the robot's starts a little later."""
    times = np.arange(0, duration, 1 / rate)
    phase = (times / times[-1])[:, None]
    glide = lambda s: 10 * s**3 - 15 * s**4 + 6 * s**5  # noqa: E731  (minimum jerk)
    person = REST_PERSON + (goal - REST_PERSON) * glide(phase)
    robot = REST_ROBOT + (goal - REST_ROBOT) * glide(np.clip((phase - 0.2) / 0.8, 0, 1))
    return times, np.hstack([person, robot])


def main() -> None:
    rng = np.random.default_rng(0)
    goals = np.array([0.6, 0.0, 1.0]) + rng.uniform(-1, 1, size=(20, 3)) * [0.05, 0.3, 0.2]
    recorded = [interaction(goal, rng.uniform(1.5, 2.5), rate=60) for goal in goals]
    demos = inphase.Dataset.from_arrays(
        times=[times for times, _ in recorded],
        values=[values + 0.005 * rng.standard_normal(values.shape) for _, values in recorded],
        observed=OBSERVED,
        controlled=CONTROLLED,
        units={"*": "m"},
    )
    model = inphase.fit(demos)
    session = model.session(seed=0)

    goal = np.array([0.63, 0.2, 1.1])
    times, values = interaction(goal, duration=2.2, rate=30)
    for i, (t, row) in enumerate(zip(times, values, strict=True)):
        estimate = session.observe(t, row[:3])
        if i % 10 == 0:
            response = session.respond(samples=2)
            off = 100 * np.linalg.norm(response.mean[-1] - goal)
            spread = 100 * np.linalg.norm(response.std[-1])
            print(
                f"{t:.2f} s: {100 * estimate.phase:3.0f} % done, "
                f"hand-over point foreseen {off:4.1f} cm off (± {spread:.1f} cm), {estimate.status.value}"
            )


if __name__ == "__main__":
    main()
