"""The study: its parts, and the tasks that they are made of."""

from __future__ import annotations

from experiments.hugging import told
from experiments.hugging.demonstrations import KEPT, MADE, some
from experiments.hugging.learned import learn
from experiments.hugging.online import CASES, FILTERS, PARTNERS, filmed, online
from experiments.hugging.showing import WAYS
from experiments.hugging.table4 import METHODS, cross_validated
from experiments.study import Part, Settings, Study, Task, task

QUICK_HUGS, QUICK_FOLDS, QUICK_PLAYED, QUICK_EVERY = 20, 2, 1, 5
QUICK_CASES = {"long": 1, "nothing": 1}


def _taught(settings: Settings) -> dict[str, Task]:
    count, many = (QUICK_HUGS, 6) if settings.quick else (MADE, 10)
    return {
        f"{first:03}": task(some, list(range(first, min(first + many, count))), settings.seed)
        for first in range(0, count, many)
    }


def _table4(settings: Settings) -> dict[str, Task]:
    folds = QUICK_FOLDS if settings.quick else 10
    methods = {name: METHODS[name] for name in ("as written", "rbpf")} if settings.quick else METHODS
    return {
        f"{way.replace(' + ', '-')}/{fold}": task(
            cross_validated,
            settings.of("taught"),
            way,
            methods,
            folds,
            fold,
            QUICK_PLAYED if settings.quick else KEPT,
            QUICK_EVERY if settings.quick else 2,
        )
        for fold in range(folds)
        for way in WAYS
    }


def _learned(settings: Settings) -> dict[str, Task]:
    return {"model": task(learn, settings.of("taught"), not settings.quick)}


def _online(settings: Settings) -> dict[str, Task]:
    cases = QUICK_CASES if settings.quick else CASES
    partners = {"novel 2": PARTNERS["novel 2"]} if settings.quick else PARTNERS
    filters = FILTERS[:1] if settings.quick else FILTERS
    return {
        f"{filter}/{name.replace(' ', '-')}/{kind}/{number}": task(
            online, settings.of("learned"), partner, kind, number, filter, settings.seed
        )
        for filter in filters
        for name, partner in partners.items()
        for kind, count in cases.items()
        for number in range(count)
    }


def _film(settings: Settings) -> dict[str, Task]:
    if settings.quick:
        return {}
    stored = settings.of("learned")
    return {"long": task(filmed, stored, PARTNERS["novel 2"], "long", 1, settings.seed, told.FPS, 60)}


STUDY = Study(
    title="Whole-body hugging (3.3.2, 3.4.2)",
    says=told.SAYS,
    parts={
        "taught": Part("Hugs that are taught", _taught, told.taught),
        "table4": Part("Table 4 and Fig. 32: four ways of showing force sensors", _table4, told.table4, ("taught",)),
        "learned": Part("The model that goes online", _learned, told.learned, ("taught",)),
        "online": Part("66 hugs online, Figs. 33 and 35", _online, told.online, ("taught", "learned")),
        "film": Part("Fig. 31: a hug", _film, told.film, ("taught", "learned")),
    },
    modules=("mujoco", "matplotlib"),
)
