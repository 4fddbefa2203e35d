"""What all tests share: array shapes checked while they run, hypothesis profiles, a generator, the recordings."""

from __future__ import annotations

import os
from pathlib import Path

import hypothesis
import numpy as np
import pytest
from jaxtyping import install_import_hook

# Before anything imports the library: from here on every annotation in it is a law.
install_import_hook(["inphase", "intprim"], "beartype.beartype")

os.environ.setdefault("MPLBACKEND", "Agg")  # pictures go to files, here and in the programs that tests start

hypothesis.settings.register_profile("ci", derandomize=True, deadline=None, print_blob=True)
hypothesis.settings.register_profile("dev", deadline=None)
hypothesis.settings.load_profile("ci" if os.environ.get("CI") else "dev")


@pytest.fixture
def rng() -> np.random.Generator:
    """A random generator that is the same in every run."""
    return np.random.default_rng(0)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings; it lies beside the repository and is not part of it."""
    folder = Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the recordings of ../shared/data are not beside the repository")
    return folder
