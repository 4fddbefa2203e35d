"""Who works: processes of this computer, or a cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any

import tyro

from inphase.errors import OptionError
from inphase.workers import check_address, local_cluster

Count = Annotated[int | None, tyro.conf.arg(metavar="INT", help_behavior_hint="")]


@dataclass(frozen=True)
class Jobs:
    """Who works: processes of this computer, or a cluster."""

    jobs: Count = None
    """processes that work side by side; otherwise one a processor"""
    workers: Count = None
    """work on a dask cluster that is started here with so many workers, and ends with the command"""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="TCP://HOST:PORT", help_behavior_hint="")] = None
    """work on the dask cluster with the scheduler at this address"""

    def check(self) -> None:
        """Worth asking before long work; raises OptionError for less than one, two of them, or nobody at an address."""
        named = {name: value for name, value in vars(self).items() if value is not None}
        if len(named) > 1:
            raise OptionError(f"expected one of --jobs, --workers and --cluster, got --{' and --'.join(named)}")
        for name in ("jobs", "workers"):
            if named.get(name, 1) < 1:
                raise OptionError(f"--{name}: expected at least 1, got {named[name]}")
        if self.cluster is not None:
            check_address(self.cluster)

    @contextmanager
    def opened(self) -> Iterator[dict[str, Any]]:
        """The options `jobs` and `cluster` of the library."""
        if self.workers is not None:
            with local_cluster(self.workers) as address:
                yield {"cluster": address}
        elif self.cluster is not None:
            yield {"cluster": self.cluster}
        else:
            yield {"jobs": processes() if self.jobs is None else self.jobs}


def processes() -> int:
    """One for every processor that may be used."""
    from joblib import cpu_count  # type: ignore[import-untyped]

    return int(cpu_count())
