"""`StatCollector`: what a filter believed at every step, and the analysis file (XML) that tells of it (4.2.9.1)."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from inphase import DataError, OptionError
from inphase.io import AnalysisHead, AnalysisStep, write_analysis
from intprim.checks import dofs_of, numbers


class Step(NamedTuple):
    """One call of `collect`: the samples (T, D) and the response (S, D), and the filter's state [phase …, weights]."""

    clock: float | None
    observed: Float[np.ndarray, "T D"]
    generated: Float[np.ndarray, "S D"]
    mean: Float[np.ndarray, " n"]
    cov: Float[np.ndarray, "n n"]
    members: Float[np.ndarray, "E B"]


class StatCollector:
    """Collects the state of a filter at every step, and exports it.

    generated_indices, observed_indices: DoFs that are inferred, and those that are only observed. Raises OptionError
    for a DoF that does not exist, or a name with a comma, which parts names in the file.
    """

    def __init__(self, bip_instance: Any, generated_indices: ArrayLike, observed_indices: ArrayLike) -> None:
        model = bip_instance.basis_model
        self.generated_indices = dofs_of(generated_indices, model.num_observed_dof, "generated_indices")
        self.observed_indices = dofs_of(observed_indices, model.num_observed_dof, "observed_indices")
        self.steps: list[Step] = []
        self._head = AnalysisHead(
            tuple(model.observed_dof_names), model.layout, self.observed_indices, self.generated_indices
        )

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
        last = self.steps[-1].clock if self.steps else None
        if self.steps and (timestamp is None or (last is not None and not timestamp > last)):
            raise DataError(f"timestamp: expected one after {last}, or None for the first step, got {timestamp}")
        mean = np.array(used.get_mean())
        mean[0] = mean[0] % 1.0 if getattr(used, "cyclical", False) else np.clip(mean[0], 0.0, 1.0)
        members = used.ensemble[used.system_size :].T if hasattr(used, "ensemble") else np.empty((0, 2))
        observed = (
            np.reshape(observed_trajectory, (0, count)) if np.size(observed_trajectory) == 0 else observed_trajectory
        )
        observed = numbers("observed_trajectory", observed, "T D", finite=False, D=count)
        generated = numbers("generated_trajectory", generated_trajectory, "T D", D=count)
        clock = None if timestamp is None else float(timestamp)
        self.steps.append(Step(clock, observed, generated, mean, used.get_covariance(), members))

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
        if not self.steps:
            raise DataError("expected steps to export, got none: call collect after every inference")
        fixed = float(spt_phase) if use_spt and spt_phase not in (None, "current") else None
        head = replace(
            self._head, response_length=response_length, single_point=bool(use_spt), phase=spt_phase, bag=debug_bag_file
        )
        everyone = np.concatenate([step.members for step in self.steps])
        directions = np.linalg.eigh(np.cov(everyone.T))[1][:, :-3:-1] if len(everyone) else np.eye(2)
        centre = everyone.mean(0) if len(everyone) else 0.0
        steps = [
            AnalysisStep(
                clock=clock,
                observed=step.observed,
                generated=step.generated,
                pdf=self._pdf(bip_instance, step, fixed),
                plane=(step.members - centre) @ directions,  # the two principal directions of all steps (4.2.9.2)
                cov=step.cov[bip_instance.filter.system_size :, bip_instance.filter.system_size :],
            )
            for clock, step in zip(self._clocks(), self.steps, strict=True)
        ]
        path = Path(export_dir_path) / datetime.now().strftime("stat_collection_%Y-%m-%d_%H-%M-%S.xml")
        write_analysis(path, head, steps)
        return path

    def _clocks(self) -> list[float]:
        """The clock of every step; the state before the first sample is one step earlier."""
        known = [step.clock for step in self.steps if step.clock is not None]
        if len(known) < len(self.steps):
            known.insert(0, 2 * known[0] - known[1] if len(known) > 1 else known[0] - 1 if known else 0.0)
        return known

    def _pdf(self, primitive: Any, step: Step, phase: float | None) -> Float[np.ndarray, "_ 2"]:
        """Mean and variance of phase, phase velocity and the generated DoFs, these at the phase or the estimate's."""
        order, dofs, layout = primitive.filter.system_size, self.generated_indices, primitive.basis_model.layout
        system = [(step.mean[k], step.cov[k, k]) if k < order else (0.0, 0.0) for k in range(2)]
        rows = layout.project(float(step.mean[0]) if phase is None else phase, np.eye(layout.size))  # (B, D)
        var = np.einsum("bd,bc,cd->d", rows, step.cov[order:, order:], rows, optimize=True)
        means = primitive.scaling.unscale(step.mean[order:] @ rows)[dofs]
        return np.array([*system, *zip(means, primitive.scaling.unscale_var(np.maximum(var, 0.0))[dofs], strict=True)])
