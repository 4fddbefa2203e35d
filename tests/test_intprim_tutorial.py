"""Section 4.2 of the dissertation runs as printed, and what its text says of the results is so."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pytest

import intprim
from inphase.io import read_analysis

TUTORIAL = Path(__file__).with_name("intprim_tutorial.py")
FILTERED = {  # the blocks that follow a trajectory: after how many samples each they plot, and how long it is
    "4.2.8 Inference (1)": (32, 145),
    "4.2.8 Inference (2)": (32, 145),
    "4.2.8.1 Inferred Trajectory Length (1)": (32, 145),
    "4.2.8.2 Starting Phase (1)": (16, 45),
    "4.2.8.2 Starting Phase (2)": (16, 45),
    "4.2.8.3 Phase Lookahead (1)": (16, 45),
}


class Call(NamedTuple):
    """One call of `generate_probable_trajectory_recursive`: what it was given, and what it said."""

    samples: np.ndarray
    options: dict[str, Any]
    trajectory: np.ndarray
    phase: float
    mean: np.ndarray


class Block:
    """What running a block printed, drew and called, and the names that there were after it."""

    def __init__(self) -> None:
        self.printed, self.figures, self.collected = "", 0, 0
        self.calls: list[Call] = []
        self.names: dict[str, Any] = {}


def code_of_blocks() -> dict[str, str]:
    """The blocks by their headings, on the lines they have in the file, for those who read where it failed."""
    text = TUTORIAL.read_text(encoding="utf-8")
    heads = list(re.finditer(r"^# %% (.+)\n", text, re.MULTILINE))
    ends = [head.start() for head in heads[1:]] + [len(text)]
    return {
        head[1]: "\n" * text.count("\n", 0, head.end()) + text[head.end() : end]
        for head, end in zip(heads, ends, strict=True)
    }


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the blocks run, and leave their files."""
    return tmp_path_factory.mktemp("tutorial")


@pytest.fixture(scope="module")
def blocks(folder):
    """The blocks by their headings, after all of them ran, in one namespace."""
    from matplotlib import pyplot as plt

    plt.switch_backend("agg")
    names, ran = {}, {}
    primitive, collector = intprim.BayesianInteractionPrimitive, intprim.util.StatCollector
    infer, collect = primitive.generate_probable_trajectory_recursive, collector.collect
    random_state = np.random.get_state()  # noqa: NPY002 - the first block seeds these numbers

    def watched_infer(self, samples, *args, **options):
        said = infer(self, samples, *args, **options)
        block.calls.append(Call(samples.copy(), options, *said[:3]))
        return said

    def watched_collect(self, *args, **options):
        block.collected += 1
        return collect(self, *args, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(plt, "show", lambda **_: None)  # with a display, it warns that there is no window
        patch.setattr(primitive, "generate_probable_trajectory_recursive", watched_infer)
        patch.setattr(collector, "collect", watched_collect)
        try:
            for heading, code in code_of_blocks().items():
                block = ran[heading] = Block()
                with contextlib.redirect_stdout(io.StringIO()) as printed:
                    exec(compile(code, str(TUTORIAL), "exec", dont_inherit=True), names)
                figures = [plt.figure(number) for number in plt.get_fignums()]
                block.figures = sum(any(axes.lines for axes in figure.axes) for figure in figures)
                block.printed, block.names = printed.getvalue(), dict(names)
                plt.close("all")
        finally:
            plt.close("all")
            np.random.set_state(random_state)  # noqa: NPY002
    return ran


# ------------------------------------------------------------------------------------- what the text says, by itself


def gaussians(phases, degree):
    """(T, degree) Gaussians of variance 0.1, uniform from phase 0 to 1 (4.2.1)."""
    return np.exp(-((phases[:, None] - np.linspace(0, 1, degree)) ** 2) / (2 * 0.1))


def sigmoids(phases, degree):
    return 1 / (1 + np.exp(-(phases[:, None] - np.linspace(0, 1, degree)) / 0.1))


def extremes(trajectories):
    """What scaling makes 0 and 1 where both DoFs are in one group (4.2.5)."""
    return min(t.min() for t in trajectories), max(t.max() for t in trajectories)


def reading(block, weights, phases):
    """(2, T) what the weights of 4.2.8, of 9 Gaussians a DoF, say in the units of the DoFs."""
    low, high = extremes(block.names["training_trajectories"])
    return low + (high - low) * (gaussians(np.asarray(phases), 9) @ weights.reshape(2, 9).T).T


def error_of_regression(trajectories, degree):
    """Mean and standard deviation of the MSE that noise alone leaves (4.2.4): one of T samples keeps T - degree squares
    of it; of each demonstration it is the mean over T, and then that over the demonstrations."""
    lengths = np.array([t.shape[1] for t in trajectories])
    var = 0.01**2
    std = var * np.sqrt(np.sum(2 * (lengths - degree) / lengths**2)) / len(lengths)
    return var * np.mean((lengths - degree) / lengths), std


def observed_in_analysis(path):
    """The samples that an analysis file holds, by the names of the DoFs."""
    dataset = read_analysis(path).dataset
    (demonstration,) = dataset
    return dict(zip((*dataset.observed, *dataset.controlled), demonstration.values.T, strict=True))


# --------------------------------------------------------------------------------------------------------------- laws


def test_every_block_runs_and_every_plot_is_drawn(blocks):
    sections = " ".join(heading.split()[0].removeprefix("4.2.") for heading in blocks)
    assert sections == "1 1 1 2 3 4 5 5 6.1 6.2 7.1 7.1 7.1 7.1 7.1 7.1 7.2 7.3 8 8 8.1 8.2 8.2 8.3 9.1"
    # The functions of either basis, weighted ones for X and for Y; then one for every look at what is inferred.
    figures = {"4.2.1 Basis Spaces (1)": 1, "4.2.1 Basis Spaces (2)": 2, "4.2.1 Basis Spaces (3)": 1}
    figures |= {heading: len(range(step, length, step)) for heading, (step, length) in FILTERED.items()}
    assert {heading: block.figures for heading, block in blocks.items() if block.figures} == figures


def test_selection_finds_the_basis_of_the_data_as_near_as_its_grid_has_it(blocks, capsys):
    block = blocks["4.2.2 Choosing an Appropriate Basis Space (1)"]

    def best(printed):
        found = re.findall(r"(AIC|BIC)\b.*\b(\w+)Model\D+(\d+)\D+([\d.]+)", printed)
        return {criterion: (kind, int(degree), float(scale)) for criterion, kind, degree, scale in found}

    # The data is of 8 Gaussians, but from 5 in steps of 2 there are odd degrees only: 7 cannot follow it, 9 can.
    assert best(block.printed) == {"AIC": ("Gaussian", 9, 0.1), "BIC": ("Gaussian", 9, 0.1)}
    selection = intprim.basis.Selection(block.names["dof_names"])
    selection.degree_step = 1
    for trajectory in block.names["training_trajectories"]:
        selection.add_demonstration(trajectory)
    selection.get_best_model(*selection.get_information_criteria(np.array([0, 1])))
    assert best(capsys.readouterr().out) == {"AIC": ("Gaussian", 8, 0.1), "BIC": ("Gaussian", 8, 0.1)}


def test_the_error_of_the_right_basis_is_the_noise_and_that_of_a_wrong_one_is_far_larger(blocks):
    names = blocks["4.2.4 Computing Observation Noise (1)"].names
    x, y = names["observation_noise"].diagonal()
    expected, std = error_of_regression(names["training_trajectories"], 8)
    # A translation is no sum of Gaussians, but so nearly one that this adds less than one of these four.
    assert abs(x - expected) < 4 * std
    assert f"{x:.0e}" == "9e-05"  # as the text has it
    assert y > 50 * x  # 1e-2 in the text


def test_scaling_makes_the_error_much_smaller(blocks):
    before, scaled = (
        blocks[heading].names["observation_noise"].diagonal()
        for heading in ("4.2.4 Computing Observation Noise (1)", "4.2.5 Scaling (2)")
    )
    assert (scaled < before / 50).all()
    names = blocks["4.2.8 Inference (1)"].names
    low, high = extremes(names["training_trajectories"])
    expected, std = error_of_regression(names["training_trajectories"], 9)
    y = names["observation_noise"][1, 1]  # that of X is set to 10000
    assert abs(y * (high - low) ** 2 - expected) < 4 * std
    assert y < 0.01**2 / 100


def test_an_exported_primitive_is_the_one_that_is_imported(blocks, folder):
    names = blocks["4.2.6.2 Import (1)"].names
    demonstrations = names["training_trajectories"]
    low, high = extremes(demonstrations)

    def weights(trajectory):
        phases = np.linspace(0, 1, trajectory.shape[1])
        bases = gaussians(phases, 8), sigmoids(phases, 8)
        scaled = (trajectory - low) / (high - low)
        fits = [np.linalg.lstsq(basis, row, rcond=None)[0] for basis, row in zip(bases, scaled, strict=True)]
        return np.concatenate(fits)

    expected = np.array([weights(trajectory) for trajectory in demonstrations])
    fresh = intprim.BayesianInteractionPrimitive(names["basis_model_mixture"])
    fresh.import_data(folder / "some_file_name.bip")
    np.testing.assert_array_equal(fresh.basis_weights, names["primitive"].basis_weights)
    np.testing.assert_allclose(fresh.basis_weights, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    # Only with the same scaling it moves as the demonstrations do on average, in their units.
    phases, (x, y) = np.linspace(0, 1, 50), expected.mean(0).reshape(2, 8)
    moved = low + (high - low) * np.stack([gaussians(phases, 8) @ x, sigmoids(phases, 8) @ y])
    for primitive in (fresh, names["primitive"]):
        mean_trajectory = primitive.get_mean_trajectory(num_samples=50)
        np.testing.assert_allclose(mean_trajectory, moved, rtol=0, atol=1e-6 * (high - low))


# The second has 8 times the noise, of which the filter is not told. "This remains true", says the text: with its seed
# it does; with 11 of the seeds from 0 to 29 the phase gets lost, with none where the right noise is told.
@pytest.mark.parametrize("heading", ["4.2.8 Inference (1)", "4.2.8 Inference (2)"])
def test_a_translated_and_longer_movement_is_tracked_in_space_and_time(blocks, heading):
    block = blocks[heading]
    (truth,), seen = block.names["test_trajectories"], 0
    assert truth.shape == (2, 145)
    for call in block.calls:
        assert not call.samples[0].any()  # X is never seen
        seen += call.samples.shape[1]
        # Without adapting, it would be elsewhere by far: at the tempo and place of the demonstrations.
        unadapted = seen * block.names["phase_velocity_mean"]
        assert abs(call.phase - seen / 145) < 0.05 < (unadapted - seen / 145) / 2
        error = np.abs(call.trajectory[0] - truth[0, seen:]).mean()
        apart = np.abs(block.names["mean_trajectory"][0].mean() - truth[0].mean())
        assert error < 0.5 < apart / 10  # of the 10 that it is translated by: 5 %
    assert [call.samples.shape[1] for call in block.calls] == [32, 32, 32, 32]


def test_as_many_samples_are_inferred_as_a_division_leaves(blocks):
    block = blocks["4.2.8.1 Inferred Trajectory Length (1)"]
    wanted = [(145 - seen) / 20 for seen in (32, 64, 96)] + [2.0]  # 0.85 after 128 samples: not fewer than 2
    assert [call.options["num_samples"] for call in block.calls] == wanted
    assert [call.trajectory.shape for call in block.calls] == [(2, 5), (2, 4), (2, 2), (2, 2)]


STARTS = {  # where the inferred trajectory begins, of the phase
    "4.2.8 Inference (1)": lambda phase: phase,
    "4.2.8.1 Inferred Trajectory Length (1)": lambda phase: phase,
    "4.2.8.2 Starting Phase (1)": lambda phase: 0.0,
    "4.2.8.2 Starting Phase (2)": lambda phase: 0.7,
    "4.2.8.3 Phase Lookahead (1)": lambda phase: phase + 0.1,
}


@pytest.mark.parametrize("heading", STARTS)
def test_a_trajectory_begins_at_its_starting_phase_and_ends_with_the_movement(blocks, heading):
    assert blocks[heading].calls
    for call in blocks[heading].calls:
        start = STARTS[heading](call.phase)
        assert start < 1
        expected = reading(blocks[heading], call.mean, np.linspace(start, 1, call.trajectory.shape[1]))
        np.testing.assert_allclose(call.trajectory, expected, rtol=0, atol=1e-6)


def test_the_analysis_file_holds_every_step_and_the_samples(blocks, folder):
    block = blocks["4.2.9.1 Exporting Analysis File (1)"]
    (path,) = folder.glob("*.xml")
    steps = ElementTree.parse(path).getroot().findall(".//timestep")
    assert len(steps) == block.collected == 1 + 44  # before the first sample, and after each but the last
    assert [float(step.attrib["clock"]) for step in steps[1:]] == list(range(1, 45))
    (truth,), found = block.names["test_trajectories"], observed_in_analysis(path)
    for name, row in zip(block.names["dof_names"], truth, strict=True):
        np.testing.assert_allclose(found[name], row[:44], rtol=1e-8)  # nine digits are written
