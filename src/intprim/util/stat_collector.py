"""`StatCollector`: what a filter believed at every step, and the analysis file (XML) that tells of it (4.2.9.1)."""

from __future__ import annotations

from datetime import datetime
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase import DataError, OptionError
from intprim.basis.basis_model import dofs_of

SAMPLES = 50  # of a density, for those who draw it
COMPONENTS = ("Component 1", "Component 2")


class Step(NamedTuple):
    """One call of `collect`: the samples (T, D) and the response (S, D), and the filter's state [phase …, weights]."""

    clock: float | None
    observed: Float[np.ndarray, "T D"]
    generated: Float[np.ndarray, "S D"]
    mean: Float[np.ndarray, " n"]
    cov: Float[np.ndarray, "n n"]
    members: Float[np.ndarray, "E B"] | None


class StatCollector:
    """Collects the state of a filter at every step, and exports it.

    generated_indices, observed_indices: DoFs that are inferred, and those that are only observed. Raises OptionError
    for a DoF that does not exist, or a name with a comma, which parts names in the file.
    """

    def __init__(self, bip_instance: Any, generated_indices: ArrayLike, observed_indices: ArrayLike) -> None:
        names = bip_instance.basis_model.observed_dof_names
        self.generated_indices = dofs_of(generated_indices, len(names), "generated_indices")
        self.observed_indices = dofs_of(observed_indices, len(names), "observed_indices")
        self.steps: list[Step] = []
        wrong = [name for name in names if "," in name]
        if wrong:
            raise OptionError(f"expected DoF names without commas, got {wrong[0]!r}")

    def collect(
        self,
        bip_instance: Any,
        observed_trajectory: ArrayLike,
        generated_trajectory: ArrayLike,
        timestamp: float | int | None,
    ) -> None:
        """Keep the samples (T, D) of this step, the response (S, D) to them, and the state of the filter.

        timestamp: a clock that increases; None for the state before the first sample. Raises DataError for another
        shape or clock, OptionError where no filter is set.
        """
        used, count = bip_instance.filter, bip_instance.basis_model.num_observed_dof
        if used is None:
            raise OptionError("expected a filter, got none: call set_filter first")
        last = self.steps[-1].clock if self.steps else -np.inf
        if (timestamp is None and self.steps) or (None not in (timestamp, last) and not timestamp > last):  # type: ignore[operator]
            raise DataError(f"timestamp: expected one after {last}, or None for the first step, got {timestamp}")
        mean = np.array(used.get_mean())
        mean[0] = mean[0] % 1.0 if getattr(used, "cyclical", False) else np.clip(mean[0], 0.0, 1.0)
        self.steps.append(
            Step(
                None if timestamp is None else float(timestamp),
                _rows(observed_trajectory, count, "observed_trajectory"),
                _rows(generated_trajectory, count, "generated_trajectory"),
                mean,
                used.get_covariance(),
                used.ensemble[used.system_size :].T.copy() if hasattr(used, "ensemble") else None,
            )
        )

    def export(
        self,
        bip_instance: Any,
        export_dir_path: str | PathLike[str],
        debug_bag_file: str,
        response_length: int,
        use_spt: bool,
        spt_phase: float | int | str | None,
    ) -> Path:
        """Write stat_collection_<date>_<time>.xml into a folder and say where; the densities are in units of the DoFs.

        debug_bag_file: the recording that was played, if any. response_length: the most samples of a response.
        use_spt, spt_phase: whether responses were single states, and at which phase (None or "current": at the
        estimate). Raises DataError where nothing was collected, OptionError where the folder does not exist.
        """
        folder = Path(export_dir_path)
        if not self.steps:
            raise DataError("expected steps to export, got none: call collect after every inference")
        if not folder.is_dir():
            raise OptionError(f"export_dir_path: expected a folder, got {folder}")
        model, fixed = bip_instance.basis_model, use_spt and spt_phase not in (None, "current")
        names, order = model.observed_dof_names, bip_instance.filter.system_size
        shown = np.union1d(self.observed_indices, self.generated_indices).astype(int)
        pdf_names = ["Phase", "Phase Velocity", *(names[dof] for dof in self.generated_indices)]
        clocks = self._clocks()
        pdfs = np.array([self._pdf(bip_instance, step, float(spt_phase) if fixed else None) for step in self.steps])  # type: ignore[arg-type]
        planes = self._planes()

        stats = Element("stats")
        _add(stats, "bag_name", debug_bag_file)
        dof = SubElement(stats, "dof")
        _add(dof, "dof_names", ",".join(names))
        _add(dof, "observed_indices", self.observed_indices)
        _add(dof, "generated_indices", self.generated_indices)
        _add(dof, "ensemble_names", ",".join(COMPONENTS))
        _add(dof, "pdf_names", ",".join(pdf_names))
        pdf_info = _add(dof, "pdf_info", units="dof")
        spread = 4 * np.sqrt(pdfs[..., 1])
        lows, highs = (pdfs[..., 0] - spread).min(0), (pdfs[..., 0] + spread).max(0)
        for name, low, high in zip(pdf_names, [0.0, *lows[1:]], [1.0, *highs[1:]], strict=True):
            _add(pdf_info, "feature", name=name, num_samples=SAMPLES, min_range=low, max_range=high)
        _add(dof, "response_length", str(response_length))
        _add(dof, "single_point_trajectory", str(bool(use_spt)), phase=spt_phase)
        places = {i: model.observed_to_state_indices(i) for i in shown}
        state_info = SubElement(dof, "latent_state_indices")
        for i in shown:
            _add(state_info, "feature", places[i], name=names[i])
        _add(dof, "max_oracle_clock", str(clocks[-1]))
        _add(dof, "min_oracle_clock", str(clocks[0]))

        timesteps = SubElement(stats, "timesteps")
        for step, clock, pdf, plane in zip(self.steps, clocks, pdfs, planes, strict=True):
            node = _add(timesteps, "timestep", clock=clock)
            for tag, columns, values in (("observed", names, step.observed), ("generated", names, step.generated)):
                _table(SubElement(node, tag), columns, values)
            SubElement(node, "oracle")
            _table(SubElement(node, "ensemble"), COMPONENTS, plane)
            pdf_node = SubElement(node, "pdf")
            for name, (mean, var) in zip(pdf_names, pdf, strict=True):
                _add(pdf_node, "feature", name=name, mean=mean, cov=var)
            cov_node, cov = SubElement(node, "covariance"), step.cov[order:, order:]
            for row, i in enumerate(shown):
                outer = _add(cov_node, "outer_cov", name=names[i])
                for j in shown[row:]:
                    same = model.layout.bases[i] == model.layout.bases[j]
                    block = cov[np.ix_(places[i], places[j])]
                    _add(outer, "inner_cov", block, name=names[j], stride=len(block), same_mode=same)

        path = folder / datetime.now().strftime("stat_collection_%Y-%m-%d_%H-%M-%S.xml")
        unfinished = path.with_suffix(".part")
        unfinished.write_bytes(tostring(stats, encoding="utf-8", xml_declaration=True))
        return unfinished.replace(path)

    def _clocks(self) -> list[float]:
        """The clock of every step; the state before the first sample is one step earlier."""
        known = [step.clock for step in self.steps if step.clock is not None]
        if len(known) < len(self.steps):
            known.insert(0, 2 * known[0] - known[1] if len(known) > 1 else known[0] - 1 if known else 0.0)
        return known

    def _pdf(self, primitive: Any, step: Step, phase: float | None) -> list[tuple[float, float]]:
        """Mean and variance of phase, phase velocity and the generated DoFs, these at the phase or the estimate's."""
        order, dofs = primitive.filter.system_size, self.generated_indices
        system = [(step.mean[k], step.cov[k, k]) if k < order else (0.0, 0.0) for k in range(2)]
        layout = primitive.basis_model.layout
        rows = layout.project(float(step.mean[0]) if phase is None else phase, np.eye(layout.size))  # (B, D)
        var = np.einsum("bd,bc,cd->d", rows, step.cov[order:, order:], rows, optimize=True)
        means = primitive.scaling.unscale(step.mean[order:] @ rows)[dofs]
        return [*system, *zip(means, primitive.scaling.unscale_var(np.maximum(var, 0.0))[dofs], strict=True)]

    def _planes(self) -> list[Float[np.ndarray, "E 2"]]:
        """The weights of every member of each ensemble along the two principal directions of them all (4.2.9.2)."""
        members = [step.members for step in self.steps if step.members is not None]
        if len(members) < len(self.steps):
            return [np.empty((0, 2)) for _ in self.steps]
        everyone = np.concatenate(members)
        centre = everyone.mean(0)
        directions = np.linalg.eigh((everyone - centre).T @ (everyone - centre))[1][:, :-3:-1]
        return [(each - centre) @ directions for each in members]


def _rows(values: ArrayLike, count: int, name: str) -> Float[np.ndarray, "T D"]:
    array = np.array(values, dtype=np.float64)
    array = np.empty((0, count)) if array.size == 0 else np.atleast_2d(array)
    if array.ndim != 2 or array.shape[1] != count:
        raise DataError(f"{name}: expected (T, {count}), time first, got {np.shape(values)}")
    return array


def _add(parent: Element, tag: str, content: Any = "", **attributes: Any) -> Element:
    """A node with a text, or numbers parted by commas."""
    node = SubElement(parent, tag, {name: str(value) for name, value in attributes.items()})
    node.text = content if isinstance(content, str) else ",".join(f"{v:.9g}" for v in np.ravel(content))
    return node


def _table(parent: Element, names: Any, values: Float[np.ndarray, "T D"]) -> None:
    for name, column in zip(names, values.T, strict=True):
        _add(parent, "feature", column, name=name)
