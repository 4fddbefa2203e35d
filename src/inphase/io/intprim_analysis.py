"""Read analysis files (XML) of IntPrim's `StatCollector`, the old library's too, as a `Recording` (4.2.9.1)."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, TreeBuilder, XMLParser

import numpy as np
from jaxtyping import Float

from inphase.channels import make_channels
from inphase.errors import DataError
from inphase.recording import Recording
from inphase.result import Estimate, Response, Status
from inphase.trajectory import guess_quaternions


class _NoDoctype(TreeBuilder):
    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise DataError(f"refused: it declares a document type {name!r}, with which a file can grow without bound")


def read_analysis(path: str | PathLike[str]) -> Recording:
    """The interaction, estimates and responses in an analysis file.

    Its generated DoFs are the controlled channels and all others observed ones; time is the clock of the file. The
    samples of a step lie evenly between its clock and the one before; a response runs from the estimated phase, or that
    of a single point, to 1. What the file does not hold is NaN: log-likelihoods, and standard deviations of responses
    but for the first sample of generated DoFs, which old files give in other units.
    Raises DataError for a file that is damaged, is none, or declares entities.
    """
    try:
        parser = XMLParser(target=_NoDoctype())  # noqa: S314 - without a document type there are no entities
        parser.feed(Path(path).read_bytes())
        return _analysis(parser.close(), Path(path).stem)
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    except (ParseError, ValueError, LookupError) as error:
        raise DataError(f"{path}: expected an analysis file of IntPrim, got {error}") from None


def _analysis(stats: Element, name: str) -> Recording:
    names = _text(stats, "dof/dof_names").split(",")
    generated = [int(i) for i in _numbers(_node(stats, "dof/generated_indices"))]
    order = [i for i in range(len(names)) if i not in generated] + generated
    steps = stats.findall("timesteps/timestep")
    clocks = [float(step.attrib["clock"]) for step in steps]
    stride = float(np.median(np.diff(clocks))) if len(clocks) > 1 else 1.0
    point = _node(stats, "dof/single_point_trajectory")
    start = point.get("phase", "None") if point.text == "True" else "None"
    start_phase = None if start in ("None", "current") else float(start)
    in_units = _node(stats, "dof/pdf_info").get("units") == "dof"

    times, values, estimates, responses = [], [], [], []
    for step, clock, before in zip(steps, clocks, [c - stride for c in clocks[:1]] + clocks, strict=False):
        seen = _table(_node(step, "observed"), names)
        times.append(np.linspace(before, clock, len(seen) + 1)[1:])
        values.append(seen[:, order])
        pdfs = {node.attrib["name"]: _moments(node) for node in step.findall("pdf/feature")}
        (phase, phase_std), (velocity, velocity_std) = pdfs["Phase"], pdfs["Phase Velocity"]
        status = Status.FOLLOWING if len(seen) else Status.NOTHING_SEEN
        estimates.append(Estimate(clock, phase, phase_std, velocity, velocity_std, np.nan, status))
        mean = _table(_node(step, "generated"), names)
        std = np.full(mean.shape, np.nan)
        if in_units and len(std):
            std[0, generated] = [pdfs[names[i]][1] for i in generated]
        phases = np.linspace(phase if start_phase is None else start_phase, 1.0, len(mean))
        ahead = (phases - phase) / (velocity if velocity > 0 else np.nan)
        channels = tuple(names[i] for i in order)
        responses.append(Response(clock + ahead, phases, mean[:, order], std[:, order], channels))
    observed, controlled = [names[i] for i in order[: len(order) - len(generated)]], [names[i] for i in generated]
    readings = np.concatenate([np.empty((0, len(names))), *values])
    return Recording(
        name,
        make_channels(observed, controlled, kinds=guess_quaternions([*observed, *controlled], [readings])),
        np.concatenate([np.empty(0), *times]),
        readings,
        tuple(estimates),
        tuple(responses),
        {"bag": _text(stats, "bag_name")},
    )


def _node(parent: Element, path: str) -> Element:
    node = parent.find(path)
    if node is None:
        raise DataError(f"expected an analysis file of IntPrim, got one without {path} in {parent.tag}")
    return node


def _text(parent: Element, path: str) -> str:
    return _node(parent, path).text or ""


def _numbers(node: Element) -> Float[np.ndarray, " T"]:
    text = (node.text or "").strip()
    return np.array(text.split(",") if text else [], dtype=np.float64)


def _moments(node: Element) -> tuple[float, float]:
    """Mean and standard deviation."""
    return float(node.attrib["mean"]), float(np.sqrt(max(float(node.attrib["cov"]), 0.0)))


def _table(parent: Element, names: list[str]) -> Float[np.ndarray, "T D"]:
    columns = {node.attrib["name"]: _numbers(node) for node in parent.findall("feature")}
    lengths = {len(column) for column in columns.values()}
    if set(columns) != set(names) or len(lengths) != 1:
        raise DataError(f"expected as many samples of each of {', '.join(names)} in {parent.tag}, got others")
    return np.stack([columns[name] for name in names], axis=1)
