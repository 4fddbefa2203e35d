"""Filters: one file each, all with the face of `filter.Filter`."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from inphase.errors import OptionError, listing
from inphase.filters.belief import Belief, Course, EnsembleBelief, GaussianBelief
from inphase.filters.bip import Bip
from inphase.filters.ebip import Ebip
from inphase.filters.filter import Filter, StepInfo
from inphase.filters.particle import Particle, WeightedBelief
from inphase.filters.promp import Promp, PrompBelief
from inphase.filters.rbpf import ParticleBelief, Rbpf
from inphase.model import Model

FILTERS: dict[str, type[Bip | Ebip | Particle | Promp | Rbpf]] = {
    "bip": Bip,
    "ebip": Ebip,
    "particle": Particle,
    "promp": Promp,
    "rbpf": Rbpf,
}

RECOMMENDED = "rbpf"  # for whoever names none: docs/filters.md says why

__all__ = [
    "FILTERS",
    "RECOMMENDED",
    "Belief",
    "Bip",
    "Course",
    "Ebip",
    "EnsembleBelief",
    "Filter",
    "GaussianBelief",
    "Particle",
    "ParticleBelief",
    "Promp",
    "PrompBelief",
    "Rbpf",
    "StepInfo",
    "WeightedBelief",
    "make",
]


def make(name: str, model: Model, **options: Any) -> Filter[Any]:
    """The filter of that name for a model; `options` are the fields of its class.

    Raises OptionError for an unknown filter, or an option it does not have.
    """
    if name not in FILTERS:
        raise OptionError(f"unknown filter {name!r}; one of {listing(FILTERS)}")
    kind = FILTERS[name]
    valid = [field.name for field in fields(kind) if field.name != "model"]
    unknown = [option for option in options if option not in valid]
    if unknown:
        raise OptionError(f"filter {name!r} has no option {listing(unknown)}; it has {listing(valid)}")
    return kind(model, **options)
