"""Workers of a dask cluster (https://distributed.dask.org): one that runs somewhere, or one of this computer's own."""

from __future__ import annotations

import asyncio
import importlib.metadata
import re
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from functools import partial
from logging import CRITICAL
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from inphase.errors import OptionError, WorkerError

ANSWER = 4.0  # [s] for a scheduler to answer, and once more to let us in
GREETING = 2**20  # bytes: it is shorter than that
ADDRESS = re.compile(r"(?P<scheme>tcp|tls)://(?P<host>\[[0-9a-fA-F:.]+\]|[^\s:/\[\]]+):(?P<port>\d{1,5})")
LOCAL = "127.0.0.1"  # nobody else's computer reaches it


def check_address(address: str) -> None:
    """Raises OptionError for an address where no scheduler of dask answers, or where distributed is not installed."""
    _check_installed()
    found = ADDRESS.fullmatch(address) if isinstance(address, str) else None
    if found is None or not 0 < int(found["port"]) < 2**16:
        raise OptionError(f"cluster: expected an address such as tcp://127.0.0.1:8786, got {address!r}")
    try:
        place = found["host"].strip("[]"), int(found["port"])
        with socket.create_connection(place, timeout=ANSWER) as connection:
            # A scheduler greets those who come. Its client would wait for that as long as it takes, or take the first
            # eight bytes of any other greeting for a length, and reserve as much memory.
            if found["scheme"] == "tcp" and not 0 < int.from_bytes(connection.recv(8), "little") < GREETING:
                raise OSError("expected its greeting, got another or none")
    except (OSError, UnicodeError) as error:
        raise OptionError(f"cluster {address}: no scheduler of dask answers there ({error})") from None


@contextmanager
def connected(
    address: str, modules: Path | None = None
) -> Iterator[tuple[Callable[..., Future[Any]], Callable[[], int]]]:
    """What submits work to a cluster, and what counts the threads of its workers.

    modules: a folder where scheduler and workers look for modules, too; those who come later as well. The work of a
    worker that dies is given to another. Raises OptionError where none answers, the cluster has no workers or theirs is
    another inphase, and WorkerError for a cluster that is lost, or work that kills its workers.
    """
    check_address(address)
    from distributed import Client, KilledWorker
    from distributed.utils import silence_logging_cmgr

    with silence_logging_cmgr(CRITICAL):  # what has to be said is raised
        try:
            client = Client(address, timeout=ANSWER, set_as_default=False)
        except (OSError, ValueError, asyncio.TimeoutError) as error:
            raise OptionError(f"cluster {address}: no scheduler of dask answers there ({error})") from None
        with client:
            _check_workers(client, address)
            if modules is not None:
                client.run_on_scheduler(look_in, str(modules))  # it reads what there is to do, too
                client.register_worker_callbacks(partial(look_in, str(modules)))
            try:
                # Every task runs for itself: equal ones are not the same.
                yield client.get_executor(pure=False).submit, lambda: sum(client.nthreads().values())
            except KilledWorker:
                raise WorkerError(
                    f"cluster {address}: several workers died of the same work; have they enough memory?"
                ) from None
            except (CancelledError, OSError) as error:
                if isinstance(error, CancelledError) or client.status != "running":
                    raise WorkerError(f"cluster {address}: the connection is lost") from None
                raise


def _check_workers(client: Any, address: str) -> None:
    expected, found = version(), client.run(version, on_error="return")
    if not found:
        raise OptionError(f"cluster {address}: expected at least one worker, got none")
    for worker, got in found.items():
        if got != expected:
            raise OptionError(f"cluster {address}: expected inphase {expected} on {worker}, got {got}")


def look_in(folder: str) -> None:
    """Find modules there, too, where this is called."""
    if folder not in sys.path:
        sys.path.insert(0, folder)


def version() -> str:
    """Of the library, where this is called."""
    return importlib.metadata.version("inphase")


@contextmanager
def local_cluster(workers: int) -> Iterator[str]:
    """The address of a cluster of so many processes of this computer, with a thread each; others cannot reach it."""
    if workers < 1:
        raise OptionError(f"workers: expected at least 1, got {workers}")
    _check_installed()
    from distributed import LocalCluster

    with (
        TemporaryDirectory(prefix="inphase-") as scratch,
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            memory_limit=0,  # else a worker is stopped for taking more than its share
            host=LOCAL,
            dashboard_address=f"{LOCAL}:0",  # without one the scheduler asks for port 8787
            scheduler_kwargs={"dashboard": False},
            local_directory=scratch,
            silence_logs=CRITICAL,
            preload=__name__,
        ) as cluster,
    ):
        yield cluster.scheduler_address


def ignore_interrupts() -> None:
    """Ctrl-C reaches every process of a terminal; the one that started the others sees to them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def dask_setup(worker: object) -> None:
    """What dask calls in every worker of `local_cluster`."""
    ignore_interrupts()


def _check_installed() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise OptionError("a cluster needs distributed: pip install 'inphase[cluster]'") from None
