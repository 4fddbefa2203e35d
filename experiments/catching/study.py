"""The study: its parts, and what is told of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from experiments.catching import told
from experiments.catching.closed_loop import in_the_loop, learned, strangers
from experiments.catching.demonstrations import make
from experiments.catching.film import filmed
from experiments.catching.prediction import Methods, cross_validated, learned_noise, methods
from experiments.catching.trade_off import by_members
from experiments.catching.trial import CONDITIONS, unmoved
from experiments.study import Part, Settings, Study, Task, task
from inphase import Dataset

DEMONSTRATIONS, FOLDS, THROWS = 221, 10, 200
CHUNK = 20
MEMBERS = (10, 25, 50, 80, 120, 198)


def _demonstrations(settings: Settings) -> dict[str, Task]:
    count = 36 if settings.quick else DEMONSTRATIONS
    chunk = 18 if settings.quick else CHUNK
    return {
        f"from-{begin:03d}": task(make, settings.seed, range(begin, min(begin + chunk, count)))
        for begin in range(0, count, chunk)
    }


def _prediction(settings: Settings) -> dict[str, Task]:
    return _folds(settings, partial(methods, calibrate=not settings.quick))


def _noise(settings: Settings) -> dict[str, Task]:
    return _folds(settings, learned_noise)


def _folds(settings: Settings, compared: Callable[[Dataset], Methods]) -> dict[str, Task]:
    found = settings.of("demonstrations")
    count, most = (1, 3) if settings.quick else (FOLDS, None)
    whole = partial(cross_validated, found, compared, FOLDS, seed=settings.seed, most=most)
    return {f"fold-{fold}": task(whole, fold=fold) for fold in range(count)}


def _trade_off(settings: Settings) -> dict[str, Task]:
    members = (10, 32) if settings.quick else MEMBERS
    tests = 2 if settings.quick else 22
    found = settings.of("demonstrations")
    return {f"members-{n:03d}": task(by_members, found, n, FOLDS, settings.seed, tests) for n in members}


def _model(settings: Settings) -> dict[str, Task]:
    return {"all": task(learned, settings.of("demonstrations"), calibrate=not settings.quick)}


def _catching(settings: Settings) -> dict[str, Task]:
    models = settings.of("model")
    throws, chunk = (1, 1) if settings.quick else (THROWS, 20)
    tasks: dict[str, Task] = {}
    for i, condition in enumerate(CONDITIONS):
        for begin in range(0, throws, chunk):
            numbers = range(begin, begin + chunk)
            tasks[f"{i}/from-{begin:03d}"] = task(in_the_loop, models, condition, numbers, settings.seed)
    for begin in range(0, throws, chunk):
        tasks[f"unmoved/from-{begin:03d}"] = task(unmoved, range(begin, begin + chunk), settings.seed)
    if not settings.quick:
        for begin in range(0, throws // 2, chunk):
            tasks[f"strangers/from-{begin:03d}"] = task(strangers, models, range(begin, begin + chunk), settings.seed)
    return tasks


def _film(settings: Settings) -> dict[str, Task]:
    shown = (0,) if settings.quick else (0, 1, 2)
    return {
        f"throw-{number}": task(filmed, settings.of("model"), number, settings.seed, 6 if settings.quick else 30)
        for number in shown
    }


STUDY = Study(
    title="Ball catching (3.3.1)",
    says=told.SAYS,
    parts={
        "demonstrations": Part("Demonstrations", _demonstrations, told.demonstrations),
        "prediction": Part(
            "What is foreseen of the catch (Tables 2 and 3, Fig. 28)",
            _prediction,
            told.prediction,
            needs=("demonstrations",),
        ),
        "noise": Part("The same with noise that is learned", _noise, told.noise, needs=("demonstrations",)),
        "trade-off": Part(
            "Time, accuracy and members (Fig. 29)", _trade_off, told.trade_off, needs=("demonstrations",)
        ),
        "model": Part("What the robot learned", _model, told.model, needs=("demonstrations",)),
        "catching": Part("Catching", _catching, told.catching, needs=("demonstrations", "model")),
        "film": Part("Three throws (Figs. 28 and 30)", _film, told.film, needs=("demonstrations", "model")),
    },
    modules=("matplotlib", "mujoco", "mink", "daqp", "PIL"),
)
