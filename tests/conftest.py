"""What all tests share: array shapes checked while they run, hypothesis profiles, a generator, the recordings."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import hypothesis
import numpy as np
import pytest
from jaxtyping import install_import_hook

# Before anything imports the library: from here on every annotation in it is a law.
install_import_hook(["inphase", "intprim"], "beartype.beartype")

os.environ.setdefault("MPLBACKEND", "Agg")  # pictures go to files, here and in the programs that tests start

# A shell's background job ignores Ctrl-C, and hands that down: the programs that tests start and interrupt must not.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

hypothesis.settings.register_profile("ci", derandomize=True, deadline=None, print_blob=True)
hypothesis.settings.register_profile("dev", deadline=None)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "dev")

# What takes longest begins first: a slow file that is begun last keeps one processor busy and the others waiting.
SLOWEST = [
    "test_experiment",
    "test_studio_browser",
    "test_examples",
    "test_report_page",
    "test_train_tab",
    "test_report_pages",
    "test_readme",
    "test_filters",
    "test_session",
    "test_orderings",
]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The slowest files first, all others as they are."""
    items.sort(key=lambda item: SLOWEST.index(item.path.stem) if item.path.stem in SLOWEST else len(SLOWEST))


@pytest.fixture
def rng() -> np.random.Generator:
    """A random generator that is the same in every run."""
    return np.random.default_rng(0)


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run a command in this process: exit code, output, errors."""
    from inphase.cli import main

    def command(*arguments: object) -> tuple[int, str, str]:
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as end:
            code = int(end.code or 0)
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return command


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings; it lies beside the repository and is not part of it."""
    folder = Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the recordings of ../shared/data are not beside the repository")
    return folder
