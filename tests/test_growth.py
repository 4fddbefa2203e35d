"""The programs that tell how cost grows and how a live loop keeps its time; and that a session's memory is flat."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import growth
import live

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
FLAT = 16_000  # bytes, over 2,000 samples: 8 a sample, and no Python object is as small


@pytest.mark.parametrize(("exponent", "expected"), [(0, 0.0), (1, 1.0), (2, 2.0), (2.5, 2.5)])
def test_the_slope_of_a_power_is_its_exponent(exponent, expected):
    sizes = np.array([4, 8, 16, 31, 62, 125])
    assert growth.slope(sizes, 3e-4 * sizes**exponent) == pytest.approx(expected, abs=1e-12)


def test_the_slope_is_that_of_the_upper_half():
    sizes = np.array([1, 2, 4, 8, 16, 32])
    assert growth.slope(sizes, np.maximum(sizes, 8) ** 2) == pytest.approx(2)
    assert growth.slope([10, 20], [1, 4]) == pytest.approx(2)
    assert math.isnan(growth.slope([10], [1]))


def test_the_work_of_ebip_is_the_smaller_of_two_products():
    """Section 3.1: E² n where members are few; with more members than readings it need only be in proportion to E."""
    one = growth.Extent(channels=2000, basis=8, members=16, demonstrations=62)
    for extent, factor in ((one, 4), (growth.replace(one, channels=4, members=2000), 2)):
        doubled = growth.replace(extent, members=2 * extent.members)
        assert growth.WORK["ebip"](doubled) / growth.WORK["ebip"](extent) == pytest.approx(factor, rel=0.05)


def test_sizes_are_those_that_were_asked_for():
    rows = growth.grow("channels", (4, 8), growth.QUICK_MIDDLE, ["ebip", "bip"])
    assert [(row["filter"], row["channels"]) for row in rows] == [("ebip", 4), ("bip", 4), ("ebip", 8), ("bip", 8)]
    assert {row["members"] for row in rows} == {growth.QUICK_MIDDLE.members}
    assert [row["filter"] for row in growth.grow("members", (10,), growth.QUICK_MIDDLE, growth.FILTERS)] == [
        "ebip",
        "particle",
        "rbpf",
    ]


def test_models_of_chance_are_followed_without_trouble():
    """What is measured is a step that uses its sample."""
    rng = np.random.default_rng(0)
    model = growth.make_model(growth.Extent(channels=12, basis=7, members=50, demonstrations=40), rng)
    for name in growth.FILTERS:
        filter = growth.make(name, model)
        belief = filter.init(rng)
        for k, observation in enumerate(growth.observations(model, 50, rng)):
            belief, info = filter.step(belief, observation, 2 * growth.STEP if k else 0.0, rng)
            assert info.healthy, name
        # Particles are too few for partners as different as these: they may take one for another.
        if name in ("bip", "ebip"):
            assert belief.phase_mean[0] == pytest.approx(0.49, abs=0.1), name


def test_cycles_begin_by_the_clock(monkeypatch):
    """A cycle that takes too long makes the next one late, not all of them."""
    now = [100.0]

    class Clock:
        @staticmethod
        def perf_counter() -> float:
            now[0] += 1e-5  # to look at the clock takes time, too
            return now[0]

        @staticmethod
        def sleep(seconds: float) -> None:
            now[0] += seconds

    def cycle(i: int) -> None:
        now[0] += 0.025 if i == 3 else 0.001

    monkeypatch.setattr(live, "time", Clock)
    between = []
    taken, late = live.pace(cycle, between.append, 10, 0.01)
    assert between == list(range(10))
    assert taken == pytest.approx([0.001] * 3 + [0.025] + [0.001] * 6, abs=1e-4)
    assert late == pytest.approx([0, 0, 0, 0, 0.015, 0.006, 0, 0, 0, 0], abs=1e-4)
    assert now[0] == pytest.approx(100 + 10 * 0.01 + 0.001, abs=1e-3)


LONG_SESSION = """
import gc, sys, tracemalloc
import numpy as np
from inphase.basis import Gaussian
from interactions import curves, dataset, taught

name, option = sys.argv[1:]
model = taught(dataset(np.random.default_rng(0)), basis=Gaussian(5))
stream = curves(np.linspace(0, 1, 100), np.zeros(2))[:, :2]
stream[::7, 0] = np.nan
tracemalloc.start()
session = model.session(name, **{option: 20})
for k in range(4001):
    session.observe(k / 50, stream[k % 100])
    if k % 10 == 0:
        session.respond(samples=2)
    if k in (2000, 4000):
        gc.collect()
        print(tracemalloc.get_traced_memory()[0])
"""


@pytest.mark.parametrize(("name", "option"), [("ebip", "members"), ("rbpf", "particles")])
def test_the_memory_of_a_session_is_flat(name, option):
    """Whatever a session keeps of what it has seen, it keeps no more of it after 4,000 samples than after 2,000.

    As users run the library: where shapes are checked, every call of a function within a function leaves some behind.
    """
    command = [sys.executable, "-W", "error", "-c", LONG_SESSION, name, option]
    result = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parent)
    assert result.returncode == 0, result.stderr
    before, after = map(int, result.stdout.split())
    assert abs(after - before) < FLAT


def run(program: str, *arguments: object) -> str:
    command = [sys.executable, "-W", "error", BENCHMARKS / program, *map(str, arguments)]
    result = subprocess.run(command, capture_output=True, text=True)
    assert (result.returncode, result.stderr) == (0, "")
    return result.stdout


def test_growth_is_told_written_and_drawn(tmp_path):
    told = run("growth.py", "--quick", "--json", tmp_path / "growth.json", "--output", tmp_path / "growth.png")
    assert "one array, at most" in told
    figures = json.loads((tmp_path / "growth.json").read_text(encoding="utf-8"))
    assert {row["axis"] for row in figures["slopes"]} == {"channels", "basis", "members", "demonstrations"}
    assert all(math.isfinite(row["measured"]) and math.isfinite(row["work"]) for row in figures["slopes"])
    assert all(row["seconds"] > 0 for row in figures["rows"])
    assert {(row["filter"], row["batch"]) for row in figures["batches"]} == {
        (name, batch) for name in ("ebip", "rbpf") for batch in (1, 2)
    }
    picture = (tmp_path / "growth.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert int.from_bytes(picture[16:20], "big") == 1200
    assert sorted(path.name for path in tmp_path.iterdir()) == ["growth.json", "growth.png"]


def test_a_live_loop_is_told_and_written(tmp_path):
    told = run("live.py", "--quick", "--json", tmp_path / "live.json")
    assert "of half a period" in told
    figures = json.loads((tmp_path / "live.json").read_text(encoding="utf-8"))
    assert figures["live"]["cycles"] == 250
    assert 0 < figures["live"]["median"] <= figures["live"]["p99"] <= figures["live"]["max"]
    assert figures["response"]["ratio"] > 0
    assert figures["first"]["first"] > 0
    assert figures["memory"]["observes"] == 1020  # whole stretches
    assert figures["memory"]["resident_before"] > 0


@pytest.mark.parametrize("program", ["growth.py", "live.py"])
def test_a_file_that_cannot_be_written_is_told_before_the_work(program, tmp_path):
    command = [sys.executable, BENCHMARKS / program, "--json", tmp_path / "none" / "a.json"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 2
    assert "expected the folder" in result.stderr
    assert result.stdout == ""
