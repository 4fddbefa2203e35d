"""How many processes work side by side."""

from __future__ import annotations

from typing import Annotated

import tyro

from inphase.errors import OptionError

Jobs = Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")]


def processes(jobs: int | None) -> int:
    """As many as were asked for, or one for every processor that may be used; raises OptionError for less than one."""
    if jobs is not None:
        if jobs < 1:
            raise OptionError(f"--jobs: expected at least 1, got {jobs}")
        return jobs
    from joblib import cpu_count  # type: ignore[import-untyped]

    return int(cpu_count())
