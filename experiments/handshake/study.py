"""The handshake of 2.5.3: an arm of pneumatic muscles that learns from people who shook its hand."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from experiments.handshake import figures, phases, tell
from experiments.handshake.demonstrations import PEOPLE, REPETITIONS, TRAINERS
from experiments.handshake.film import SHOWN, acted
from experiments.handshake.trajectories import TRAINING
from experiments.handshake.work import MODELS, against_method, against_static, learn, teach
from experiments.study import Found, Page, Part, Settings, Study, Task, task

SAYS = """
An arm of 10 joints with 27 McKibben muscles in MuJoCo, each with its force law, valve and braid friction, of which a
model sees nothing but pressures, and a person's hand by camera at 30 Hz. Training is by response elicitation (2.4):
12 trajectories of pressures that were made beforehand, and three partners who adapt. Tests are with those three and
five more: four scenarios with other trajectories that do not heed anybody (static), and five in which the partner
leads, fast, normal, slow, not moving at all, or with a pause. **bip** is the dissertation's: 450 weights, noise of
Eq. 2.15, inference and response at 3 Hz, played at 10 Hz through an alpha-beta filter. **ebip** and **rbpf** are
inphase with nothing set: `fit`, and the live loop at its own rates.
"""


def people(settings: Settings) -> tuple[int, ...]:
    """Who takes part in the tests."""
    return (0, 3) if settings.quick else PEOPLE


def _training(settings: Settings) -> Mapping[str, Task]:
    repetitions, count = (1, 6) if settings.quick else (REPETITIONS, 2)
    return {
        f"trainer{person}-from{first}": task(teach, person, first, count, repetitions, settings.seed)
        for person in TRAINERS
        for first in range(0, len(TRAINING), count)
    }


def _models(settings: Settings) -> Mapping[str, Task]:
    lessons = settings.of("training")
    return {which: task(learn, which, lessons, settings.quick) for which in sorted(set(MODELS.values()))}


def _static(settings: Settings) -> Mapping[str, Task]:
    again = 1 if settings.quick else 2
    return {f"person{person}": task(against_static, person, again, settings.seed) for person in people(settings)}


def _leading(settings: Settings) -> Mapping[str, Task]:
    again, models = 1 if settings.quick else 2, settings.of("models")
    return {
        f"{method}/person{person}": task(against_method, method, person, again, models, settings.seed)
        for person in people(settings)
        for method in MODELS
        if method != "ebip" or not settings.quick
    }


def _films(settings: Settings) -> Mapping[str, Task]:
    models = settings.of("models")
    return {} if settings.quick else {name: task(acted, name, models, settings.seed) for name in SHOWN}


def _none(settings: Settings) -> Mapping[str, Task]:
    return {}


def _quiet(settings: Settings, found: Found, page: Page) -> None:
    del settings, found, page


def _taught(settings: Settings, found: Found, page: Page) -> None:
    read = np.concatenate([f["read"] for f in found.values()])
    truth = np.concatenate([f["truth"] for f in found.values()])
    ends = truth[:, -1, :3]
    page.say(
        f"{len(read)} demonstrations of {len(read[0])} samples. The robot's hand ended within "
        + ", ".join(
            f"{name} {low:.2f} … {high:.2f} m" for name, low, high in zip("xyz", ends.min(0), ends.max(0), strict=True)
        )
        + f"; the hands were {1000 * np.median(tell.ends_apart(truth)):.0f} mm apart at the end (median)."
    )


STUDY = Study(
    title="Handshake with a musculoskeletal robot (2.5.3)",
    says=SAYS,
    parts={
        "training": Part("Demonstrations by response elicitation (2.4)", _training, _taught),
        "models": Part("Models", _models, _quiet, needs=("training",)),
        "static": Part("Static trajectories", _static, _quiet),
        "leading": Part("Did they shake hands?", _leading, tell.met, needs=("models", "static")),
        "completion": Part("Time-to-Completion (Table 1)", _none, tell.completion, needs=("leading", "static")),
        "phase": Part("Phase and phase velocity (Figs. 15, 16)", _none, phases.phase, needs=("training", "leading")),
        "prediction": Part("Predicted pressures (Fig. 17)", _none, figures.prediction, needs=("leading",)),
        "profiles": Part("Positions and velocities (Fig. 18)", _none, figures.profiles, needs=("leading", "static")),
        "correlation": Part("Correlations (Figs. 19, 20)", _none, figures.correlation, needs=("leading", "static")),
        "film": Part("Films (Figs. 12 to 14)", _films, figures.film, needs=("models",)),
    },
    modules=("mujoco", "matplotlib", "PIL"),
)
