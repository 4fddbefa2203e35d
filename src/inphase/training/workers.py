"""Independent work on one process or on several, each with one BLAS thread."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, TypeAlias

from inphase.errors import OptionError

Run: TypeAlias = Callable[[Callable[..., Any], Iterable[tuple[Any, ...]]], list[Any]]


@contextmanager
def workers(jobs: int) -> Iterator[Run]:
    """run(function, argument tuples) → results in their order, the same for any number of processes.

    Raises OptionError for less than one.
    """
    if not isinstance(jobs, int) or jobs < 1:
        raise OptionError(f"expected a whole number of at least 1 jobs, got {jobs!r}")
    import scipy.linalg  # noqa: F401 - it brings a BLAS of its own, which can be limited once it is there
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        if jobs == 1:
            yield lambda function, tasks: [function(*task) for task in tasks]
        else:
            from joblib import Parallel, delayed  # type: ignore[import-untyped]

            with Parallel(n_jobs=jobs, inner_max_num_threads=1, backend="loky") as pool:
                yield lambda function, tasks: list(pool(delayed(function)(*task) for task in tasks))
