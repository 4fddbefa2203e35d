"""The study: its parts, and the tasks that they are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from experiments.cooperation import live, scope, tasks, told
from experiments.cooperation.demonstrations import AT_ONCE, PLACES, record
from experiments.cooperation.methods import METHODS
from experiments.study import Part, Settings, Study, Task, task
from experiments.study.follower import OURS, WRITTEN


def _labels(settings: Settings, place: str, fold: int | None) -> dict[str, str]:
    """Of the models that do not know a demonstration, by their kind; of those that know all where none is named.

    Ours is calibrated, which takes minutes: it is made five times, each without five demonstrations.
    """
    group = fold if settings.quick or fold is None else fold // AT_ONCE
    which = {WRITTEN: fold, OURS: group}
    return {kind: f"{kind}/{place}/{'all' if i is None else i}" for kind, i in which.items()}


def _demonstrations(settings: Settings) -> Mapping[str, Task]:
    at_once = 3 if settings.quick else AT_ONCE
    return {
        f"{place}/{first}": task(record, settings, place, range(first, min(first + at_once, scope.count(settings))))
        for place in PLACES
        for first in range(0, scope.count(settings), at_once)
    }


def _models(settings: Settings) -> Mapping[str, Task]:
    stored = settings.of("demonstrations")
    found: dict[str, Task] = {}
    for place in PLACES:
        for fold in (*scope.folds(settings), None):
            for kind, label in _labels(settings, place, fold).items():
                if fold is None:
                    out: Sequence[int] = ()
                elif settings.quick or kind == WRITTEN:
                    out = (fold,)
                else:
                    out = range(AT_ONCE * (fold // AT_ONCE), AT_ONCE * (fold // AT_ONCE + 1))
                found[label] = task(tasks.learn, settings, stored, place, kind, tuple(out))
    ours_first = sorted(found, key=lambda label: not label.startswith(OURS))  # what takes long begins first
    return {label: found[label] for label in ours_first}


def _played(
    settings: Settings, worn: Sequence[str], ratios: Sequence[float], methods: Sequence[str]
) -> dict[str, Task]:
    stored, models = settings.of("demonstrations"), settings.of("models")
    return {
        f"{place}/{what}/{fold}": task(
            tasks.play,
            settings,
            stored,
            models,
            _labels(settings, place, fold),
            place,
            what,
            fold,
            tuple(ratios),
            tuple(methods),
        )
        for place, what, fold in scope.played(settings, worn)
    }


def _temporal(settings: Settings) -> Mapping[str, Task]:
    return _played(settings, ("all",), scope.ratios(settings), tuple(METHODS))


def _worn(settings: Settings) -> Mapping[str, Task]:
    return _played(settings, [name for name in tasks.WORN if name != "all"], (1.0,), scope.COMPARED)


def _time(settings: Settings) -> Mapping[str, Task]:
    stored, models = settings.of("demonstrations"), settings.of("models")
    ratios = scope.TIMED[:2] if settings.quick else scope.TIMED
    return {
        place: task(tasks.take_time, settings, stored, models, _labels(settings, place, 0), place, ratios)
        for place in PLACES
    }


def _live(settings: Settings) -> Mapping[str, Task]:
    models, count = settings.of("models"), scope.trials(settings)
    at_once = min(10, count)
    methods = ("rbpf",) if settings.quick else scope.LIVE
    return {
        f"{place}/{scope.slug(method)}/{first}": task(
            live.answer,
            settings,
            models,
            _labels(settings, place, None),
            place,
            method,
            range(first, first + at_once),
            film=method == "rbpf" and first == 0 and not settings.quick,
        )
        for place in PLACES
        for method in methods
        for first in range(0, count, at_once)
    }


STUDY = Study(
    title="Cooperation (2.5.2, Figs. 9 to 11)",
    says=told.SAYS,
    parts={
        "demonstrations": Part("Demonstrations", _demonstrations, told.demonstrations),
        "models": Part("Models", _models, told.models, needs=("demonstrations",)),
        "temporal": Part("Other tempos (Fig. 9)", _temporal, told.temporal, needs=("demonstrations", "models")),
        "partial": Part("A part of it (Fig. 10)", lambda _: {}, told.partial, needs=("temporal",)),
        "worn": Part("What the modalities are worth", _worn, told.worn, needs=("temporal", "models")),
        "live": Part("Done together", _live, told.live, needs=("models",)),
        "time": Part("What it costs (Fig. 11)", _time, told.time, needs=("demonstrations", "models")),
    },
    modules=("matplotlib", "mujoco", "mink"),
)
