"""Write analysis files (XML) as IntPrim's `StatCollector` did, for pages that were made to show them (4.2.9.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
from jaxtyping import Float, Int

from inphase.basis import Layout
from inphase.errors import OptionError
from inphase.io.atomic import whole_file

SAMPLES = 50  # of a density, for those who draw it
COMPONENTS = ("Component 1", "Component 2")


@dataclass(frozen=True, eq=False)
class AnalysisStep:
    """One step of an analysis file: the samples (T, D), the response (S, D) to them, and the state they led to.

    pdf: (2 + G, 2) mean and variance of phase, phase velocity and each generated DoF, in its units. plane: (E, 2) the
    ensemble along two directions, empty where there is none. cov: (B, B) of the basis weights.
    """

    clock: float
    observed: Float[np.ndarray, "T D"]
    generated: Float[np.ndarray, "S D"]
    pdf: Float[np.ndarray, "_ 2"]
    plane: Float[np.ndarray, "E 2"]
    cov: Float[np.ndarray, "B B"]


@dataclass(frozen=True, eq=False)
class AnalysisHead:
    """What an analysis file says of all its steps.

    names: of the DoFs, (D,); layout: where their weights are. observed, generated: the DoFs that are only observed, and
    those that are inferred. response_length: the most samples of a response. single_point: whether a response is a
    single state, at `phase`. bag: the recording that was played. Raises OptionError for a name with a comma, which
    parts names in the file.
    """

    names: tuple[str, ...]
    layout: Layout
    observed: Int[np.ndarray, " O"]
    generated: Int[np.ndarray, " G"]
    response_length: int = 0
    single_point: bool = False
    phase: float | str | None = None
    bag: str = ""

    def __post_init__(self) -> None:
        wrong = [name for name in self.names if "," in name]
        if wrong:
            raise OptionError(f"expected DoF names without commas, got {wrong[0]!r}")


def write_analysis(path: str | PathLike[str], head: AnalysisHead, steps: Sequence[AnalysisStep]) -> None:
    """Write steps, at least one, to an analysis file, whole or not at all; densities are in units of the DoFs."""
    shown = np.union1d(head.observed, head.generated).astype(int)
    places = {i: np.arange(head.layout.size)[head.layout.slices[i]] for i in shown}
    pdf_names = ["Phase", "Phase Velocity", *(head.names[dof] for dof in head.generated)]
    stats = Element("stats")
    _add(stats, "bag_name", head.bag)
    dof = SubElement(stats, "dof")
    _add(dof, "dof_names", ",".join(head.names))
    _add(dof, "observed_indices", head.observed)
    _add(dof, "generated_indices", head.generated)
    _add(dof, "ensemble_names", ",".join(COMPONENTS))
    _add(dof, "pdf_names", ",".join(pdf_names))
    pdf_info = _add(dof, "pdf_info", units="dof")
    pdfs = np.array([step.pdf for step in steps])
    spread = 4 * np.sqrt(pdfs[..., 1])
    lows, highs = (pdfs[..., 0] - spread).min(0), (pdfs[..., 0] + spread).max(0)
    for name, low, high in zip(pdf_names, [0.0, *lows[1:]], [1.0, *highs[1:]], strict=True):
        _add(pdf_info, "feature", name=name, num_samples=SAMPLES, min_range=low, max_range=high)
    _add(dof, "response_length", str(head.response_length))
    _add(dof, "single_point_trajectory", str(head.single_point), phase=head.phase)
    state_info = SubElement(dof, "latent_state_indices")
    for i in shown:
        _add(state_info, "feature", places[i], name=head.names[i])
    _add(dof, "max_oracle_clock", str(steps[-1].clock))
    _add(dof, "min_oracle_clock", str(steps[0].clock))

    timesteps = SubElement(stats, "timesteps")
    for step in steps:
        node = _add(timesteps, "timestep", clock=step.clock)
        _table(SubElement(node, "observed"), head.names, step.observed)
        _table(SubElement(node, "generated"), head.names, step.generated)
        SubElement(node, "oracle")  # what really came, which nobody knows when a file is written
        _table(SubElement(node, "ensemble"), COMPONENTS, step.plane)
        pdf_node = SubElement(node, "pdf")
        for name, (mean, var) in zip(pdf_names, step.pdf, strict=True):
            _add(pdf_node, "feature", name=name, mean=mean, cov=var)
        cov_node = SubElement(node, "covariance")
        for row, i in enumerate(shown):
            outer = _add(cov_node, "outer_cov", name=head.names[i])
            for j in shown[row:]:
                block = step.cov[np.ix_(places[i], places[j])]
                same = head.layout.bases[i] == head.layout.bases[j]
                _add(outer, "inner_cov", block, name=head.names[j], stride=len(block), same_mode=same)
    with whole_file(path) as part:
        part.write_bytes(tostring(stats, encoding="utf-8", xml_declaration=True))


def _add(parent: Element, tag: str, content: Any = "", **attributes: Any) -> Element:
    """A node with a text, or numbers parted by commas."""
    node = SubElement(parent, tag, {name: str(value) for name, value in attributes.items()})
    node.text = content if isinstance(content, str) else ",".join(f"{v:.9g}" for v in np.ravel(content))
    return node


def _table(parent: Element, names: Sequence[str], values: Float[np.ndarray, "T D"]) -> None:
    for name, column in zip(names, values.T, strict=True):
        _add(parent, "feature", column, name=name)
