"""A studio that runs, and its page in a browser; recordings to be seen in it."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from browser import watched
from interactions import CONTROLLED, OBSERVED, curves

WAIT = 60_000  # [ms] for a command to end, on a machine that is busy


def write(
    folder: Path, names: Sequence[str] = (*OBSERVED, *CONTROLLED), episodes: int = 6, called: str = "episode"
) -> None:
    """Recordings of a partner and a robot."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(1)
    for i in range(episodes):
        times = np.arange(0, 2, 0.03)
        values = curves(times / times[-1], rng.standard_normal(2)) + 1e-3 * rng.standard_normal((len(times), 4))
        rows = np.column_stack([times, values])
        np.savetxt(folder / f"{called}_{i}.csv", rows, delimiter=",", comments="", header=",".join(["time", *names]))


@contextmanager
def studio(folder: Path, says: str = "", **environment: str) -> Iterator[str]:
    """The address of a studio that runs, and that ends well.

    says: what is on its standard error, a regular expression; of its secret there is nothing.
    """
    command = [sys.executable, "-m", "inphase.cli", "studio", str(folder)]
    process = subprocess.Popen(
        command,
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        assert process.stdout is not None
        process.stdout.readline()
        address = process.stdout.readline().strip()
        yield address
        process.send_signal(signal.SIGINT)
        output, said = process.communicate(timeout=60)
        assert (process.returncode, output) == (0, "studio ended\n"), said
        assert re.fullmatch(says, said), said
        assert urlsplit(address).path.strip("/") not in said
    finally:
        process.kill()
        process.communicate()


@contextmanager
def opened(started: Any, address: str, **context: Any) -> Iterator[Any]:
    """The page of a studio in a browser; nothing in it may go wrong, and it asks for nothing but the studio."""
    with watched(started, home=(address,), **context) as seen:
        seen.page.set_default_timeout(WAIT)
        seen.page.goto(address)
        yield seen.page


def tab(page: Any, name: str) -> Any:
    """Go to a tab; what is in it."""
    page.get_by_role("tab", name=name).click()
    return page.locator(f"#panel-{name.lower()}")


def picture(page: Any, name: str) -> None:
    """Keep a picture of it, where pictures are asked for."""
    if wanted := os.environ.get("INPHASE_SCREENSHOTS"):
        Path(wanted).mkdir(parents=True, exist_ok=True)
        page.screenshot(path=Path(wanted) / f"{name}.png", full_page=True)
