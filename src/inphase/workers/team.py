"""Who works: this process, others beside it, or those of a cluster, each with one BLAS thread."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np

from inphase.errors import OptionError, WorkerError
from inphase.workers.cluster import connected, ignore_interrupts

Task: TypeAlias = Callable[[], Any]
Run: TypeAlias = Callable[[Callable[..., Any], Iterable[tuple[Any, ...]]], list[Any]]
Label = TypeVar("Label")

AHEAD = 2  # tasks a worker: the next one is there when the last is done


@dataclass(frozen=True)
class Team:
    """Where tasks are done. start: begins one. room: how many may be under way now."""

    start: Callable[[Task], Future[Any]]
    room: Callable[[], int]

    def run(self, function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]) -> list[Any]:
        """What a function returns for each tuple of arguments, in their order."""
        found = dict(self.as_done(deque(enumerate(partial(function, *task) for task in tasks))))
        return [found[i] for i in range(len(found))]

    def as_done(self, waiting: deque[tuple[Label, Task]]) -> Iterator[tuple[Label, Any]]:
        """Labels of tasks with what these returned, as they are done; more may be put into `waiting` meanwhile."""
        running: dict[Future[Any], Label] = {}
        while waiting or running:
            free = max(self.room(), 1) - len(running)
            for _ in range(min(free, len(waiting))):
                label, task = waiting.popleft()
                running[self.start(task)] = label
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in sorted(done, key=lambda future: future.exception() is not None):  # first what is done well
                yield running.pop(future), future.result()


@contextmanager
def workers(jobs: int = 1, cluster: str | None = None, modules: Path | None = None) -> Iterator[Team]:
    """One process, which is this one, or more, or instead of them the workers of a dask cluster.

    cluster: the address of its scheduler (tcp://host:port). modules: a folder that all workers see, where those of a
    cluster look for modules, too; others look where this process does. What workers are sent may be closures. Raises
    OptionError for less than one job and for a cluster that does not answer, WorkerError where workers are lost for
    good.
    """
    if not (isinstance(jobs, (int, np.integer)) and jobs >= 1):
        raise OptionError(f"jobs: expected a whole number of at least 1, got {jobs!r}")
    if cluster is not None:
        with connected(cluster, modules) as (submit, threads):
            yield Team(lambda task: submit(_elsewhere, task), lambda: AHEAD * threads())
    elif jobs == 1:
        import scipy.linalg  # noqa: F401 - it brings a BLAS of its own, which can be limited once it is there
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1):
            yield Team(_here, lambda: 1)
    else:
        with _processes(jobs) as submit:
            yield Team(lambda task: submit(_elsewhere, task), lambda: AHEAD * jobs)


@contextmanager
def _processes(jobs: int) -> Iterator[Callable[..., Future[Any]]]:
    """Processes of this computer; they stay for those who come next, unless something went wrong."""
    from concurrent.futures.process import BrokenProcessPool

    from joblib.externals.loky import get_reusable_executor  # type: ignore[import-untyped]
    from joblib.externals.loky.process_executor import TerminatedWorkerError  # type: ignore[import-untyped]

    pool = get_reusable_executor(int(jobs), timeout=300, initializer=ignore_interrupts)
    try:
        yield pool.submit
    except BaseException as error:
        with _quietly():
            pool.shutdown(kill_workers=True)
        if isinstance(error, TerminatedWorkerError):
            raise WorkerError(f"one of {jobs} processes was killed; where memory is short, try fewer jobs") from None
        if isinstance(error, BrokenProcessPool):  # it could not read its task: a function of a module it does not find
            cause = str(error.__cause__ or error).strip('" \n').splitlines()[-1]
            raise WorkerError(f"one of {jobs} processes could not read its work: {cause}") from None
        raise


@contextmanager
def _quietly() -> Iterator[None]:
    """The thread that hands out tasks may look for some that were dropped while it ends: nobody misses them."""
    usual = threading.excepthook

    def hook(told: threading.ExceptHookArgs) -> None:
        if not (issubclass(told.exc_type, KeyError) and type(told.thread).__module__.startswith("joblib.")):
            usual(told)

    threading.excepthook = hook
    try:
        yield
    finally:
        threading.excepthook = usual


def _here(task: Task) -> Future[Any]:
    done: Future[Any] = Future()
    done.set_result(task())
    return done


def _elsewhere(task: Task) -> Any:
    """A worker keeps to one BLAS thread: more would be in each other's way, and might add up in another order."""
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_limits

    threadpool_limits(limits=1)
    return task()
