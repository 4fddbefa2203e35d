"""Work on one process, several or a cluster: the same results, whoever dies; clear words where nobody answers."""

from __future__ import annotations

import importlib
import importlib.metadata
import os
import re
import signal
import socket
import subprocess
import sys
import time
import types
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import Thread, Timer

import dask
import distributed
import numpy as np
import psutil
import pytest
import threadpoolctl
from interactions import dataset, shapes_unchecked

import inphase
from inphase.errors import OptionError, WorkerError
from inphase.evaluation import Evaluation, evaluate
from inphase.training import calibrate, reflex, rehearsal
from inphase.workers import cluster as clusters
from inphase.workers import local_cluster, workers


@pytest.fixture(autouse=True)
def unchecked() -> Iterator[None]:
    """As users run it."""
    with shapes_unchecked():
        yield


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """A real one, with two workers."""
    with local_cluster(2) as address:
        yield address


@pytest.fixture(scope="module")
def demos() -> inphase.Dataset:
    return dataset(np.random.default_rng(3), count=4, rate=10.0)


quickly = partial(inphase.fit, calibrate=False)


def evaluated(demos: inphase.Dataset, **options: object) -> Evaluation:
    options = {"folds": 2, "conditions": ["as recorded", "pause 2 s"], "seed": 1, "fit": quickly} | options
    return evaluate(demos, ["bip", "rbpf"], **options)


@pytest.fixture(scope="module")
def alone(demos: inphase.Dataset) -> Evaluation:
    with shapes_unchecked():
        return evaluated(demos)


# ------------------------------------------------------------------------------------------------------- same results


def places(cluster: str) -> list[dict[str, object]]:
    return [{"jobs": 1}, {"jobs": np.int64(2)}, {"cluster": cluster}]


def test_results_stand_in_the_order_of_their_tasks(cluster):
    def late(i: int) -> tuple[int, int]:
        time.sleep(0.1 * (i == 0))
        return i, os.getpid()

    for place, processes in zip(places(cluster), (1, 2, 2), strict=True):
        with workers(**place) as team:
            found = team.run(late, [(i,) for i in range(8)])
        assert [i for i, _ in found] == list(range(8))
        pids = {pid for _, pid in found}
        assert len(pids) == processes
        assert (os.getpid() in pids) == (processes == 1)
    with workers() as team:
        assert team.run(late, []) == []


def test_what_is_put_in_front_meanwhile_is_done_before_the_rest(cluster):
    for place in places(cluster):
        waiting = deque((i, partial(pow, i, 2)) for i in range(20))
        order = []
        with workers(**place) as team:
            for label, result in team.as_done(waiting):
                order.append(label)
                assert result == label**2
                if label == 0:
                    waiting.appendleft((100, partial(pow, 100, 2)))
        assert sorted(order) == [*range(20), 100]
        assert order.index(100) < 12  # after the few that had begun


def test_an_evaluation_on_a_cluster_is_that_of_one_process(demos, alone, cluster):
    told: list[float] = []
    found = evaluated(demos, cluster=cluster, progress=told.append)
    assert found.rows == alone.rows
    assert told == [i / 18 for i in range(1, 19)]


def test_closures_go_to_the_workers(demos, cluster):
    """Without the baselines: cloudpickle takes their methods apart, and what checks shapes in tests with them."""
    quick = True
    rows = [
        evaluate(
            demos, ["bip"], folds=2, fit=lambda part: inphase.fit(part, calibrate=not quick), others={}, **place
        ).rows
        for place in places(cluster)
    ]
    assert rows == [rows[0]] * 3


@contextmanager
def cluster_elsewhere(folder: Path) -> Iterator[str]:
    """The address of a scheduler with one worker, processes that were started by hand in another folder."""
    run = partial(subprocess.Popen, cwd=folder, stderr=subprocess.PIPE, text=True)
    scheduler = run(
        [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    )
    try:
        address = next(found[0] for line in scheduler.stderr if (found := re.search(r"tcp://127\.0\.0\.1:\d+", line)))
        worker = run(
            [
                sys.executable,
                "-m",
                "distributed.cli.dask_worker",
                address,
                "--nthreads",
                "1",
                "--no-dashboard",
                "--no-nanny",
            ]
        )
        try:
            next(line for line in worker.stderr if "Registered to" in line)
            yield address
        finally:
            worker.kill()
            worker.communicate()
    finally:
        scheduler.kill()
        scheduler.communicate()


def test_a_cluster_finds_modules_where_it_is_told_to(tmp_path, monkeypatch):
    """As those of the studies, which are not installed; this process finds them by itself."""
    modules = tmp_path / "modules"
    modules.mkdir()
    (modules / "far_from_here.py").write_text("def there(x):\n    return 2 * x\n")
    monkeypatch.syspath_prepend(str(modules))
    there = importlib.import_module("far_from_here").there
    with cluster_elsewhere(tmp_path) as address, workers(cluster=address, modules=modules) as team:
        assert team.run(there, [(1,), (2,)]) == [2, 4]


def test_a_calibration_on_a_cluster_is_that_of_one_process(demos, cluster, monkeypatch):
    monkeypatch.setattr(calibrate, "CHOICES", {"trust": calibrate.CHOICES["trust"][:1]})
    monkeypatch.setattr(rehearsal, "SAMPLES", 6)
    monkeypatch.setattr(rehearsal, "PLAYED", 3)
    monkeypatch.setattr(reflex, "MOMENTS", 2)
    one, other = inphase.fit(demos), inphase.fit(demos, cluster=cluster)
    assert one.evidence is not None
    assert one.evidence == other.evidence
    assert (one.band, one.prior.trust, one.reflex.weight) == (other.band, other.prior.trust, other.reflex.weight)


def blas() -> list[int]:
    import scipy.linalg  # noqa: F401

    return [found["num_threads"] for found in threadpoolctl.threadpool_info() if found["user_api"] == "blas"]


def more_threads() -> None:
    import scipy.linalg  # noqa: F401

    threadpoolctl.threadpool_limits(limits=2, user_api="blas")


def test_every_worker_has_one_blas_thread(cluster):
    assert blas()  # what is loaded later would not be limited
    with threadpoolctl.threadpool_limits(limits=2, user_api="blas"):
        for place in places(cluster):
            with workers(**place) as team:
                if place != {"jobs": 1}:
                    team.run(more_threads, [()] * 4)  # whatever these processes were started with
                for found in team.run(blas, [()] * 4):
                    assert set(found) == {1}
        assert set(blas()) == {2}


def test_known_rows_are_not_found_again(demos, alone):
    told: list[float] = []
    some = [row for row in alone.rows if (row.fold, row.predictor) != (1, "bip")]
    kept: list[object] = []
    found = evaluated(demos, known=some, keep=kept.extend, progress=told.append)
    assert found.rows == alone.rows
    assert told == [1 / 3, 2 / 3, 1.0]  # to learn once more, and two conditions
    assert len(kept) == len(alone.rows)
    assert {id(row) for row in found.rows} >= {id(row) for row in some}
    others = {"jobs": 1, "known": alone.rows, "progress": told.append}
    assert evaluated(demos, **others).rows == alone.rows
    assert len(told) == 3


def test_a_part_that_lacks_an_episode_is_done_again(demos, alone):
    told: list[float] = []
    assert evaluated(demos, known=alone.rows[1:], progress=told.append).rows == alone.rows
    assert len(told) == 2


def test_an_error_of_the_work_is_told_as_it_was(cluster):
    def fail() -> None:
        raise inphase.DataError("expected sun, got rain")

    for place in places(cluster):
        with pytest.raises(inphase.DataError, match=r"^expected sun, got rain$"), workers(**place) as team:
            team.run(fail, [()])


# ---------------------------------------------------------------------------------------------------------- who dies


def hesitant(flags: Path, part: inphase.Dataset) -> inphase.Model:
    """Learns, but leaves a flag and waits the first time."""
    first = not any(flags.iterdir())
    (flags / str(os.getpid())).touch()
    if first:
        time.sleep(60)
    return quickly(part)


def test_a_worker_killed_in_the_middle_costs_a_retry(demos, alone, cluster, tmp_path):
    with distributed.Client(cluster, set_as_default=False) as client:
        ours = list(client.run(os.getpid).values())
    killed: list[int] = []

    def kill() -> None:
        while not killed:
            killed.extend(int(flag.name) for flag in tmp_path.iterdir() if int(flag.name) in ours)
            time.sleep(0.01)
        os.kill(killed[0], signal.SIGKILL)

    Thread(target=kill, daemon=True).start()
    found = evaluated(demos, fit=partial(hesitant, tmp_path), cluster=cluster)
    assert found.rows == alone.rows
    assert killed[0] in ours
    with distributed.Client(cluster, set_as_default=False) as client:
        assert killed[0] not in client.run(os.getpid).values()


def test_work_that_kills_whoever_does_it_is_given_up():
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}), local_cluster(1) as address:  # noqa: SIM117
        with pytest.raises(WorkerError, match="died of the same work"), workers(cluster=address) as team:
            team.run(os._exit, [(1,)])


def test_a_process_that_is_killed_ends_the_work():
    with pytest.raises(WorkerError, match="one of 2 processes was killed"), workers(2) as team:
        team.run(os._exit, [(1,)])
    with workers(2) as team:  # and those who come next have others
        assert team.run(abs, [(-1,)]) == [1]


def test_work_that_a_process_cannot_read_is_told(monkeypatch):
    module = types.ModuleType("only_here")
    exec("def work(x):\n    return x", module.__dict__)
    monkeypatch.setitem(sys.modules, "only_here", module)
    told = pytest.raises(WorkerError, match=r"could not read its work: .*No module named 'only_here'")
    with told, workers(2) as team:
        team.run(module.work, [(1,)])
    with workers(2) as team:
        assert team.run(abs, [(-1,)]) == [1]


def test_a_cluster_that_ends_meanwhile_is_no_mystery():
    theirs = distributed.LocalCluster(n_workers=1, host="127.0.0.1", dashboard_address="127.0.0.1:0")
    lost = pytest.raises(WorkerError, match=r"cluster tcp://127\.0\.0\.1:\d+: the connection is lost")
    with lost, workers(cluster=theirs.scheduler_address) as team:
        Timer(0.5, theirs.close).start()
        team.run(time.sleep, [(0,), (2,)])


# ------------------------------------------------------------------------------------------------------ who answers


def test_a_local_cluster_is_reached_from_here_alone_and_leaves_nothing(cluster):
    with distributed.Client(cluster, set_as_default=False) as client:
        pids = [os.getpid(), *client.run(os.getpid).values()]
        assert set(client.nthreads().values()) == {1}
    heard = {c.laddr.ip for pid in pids for c in psutil.Process(pid).net_connections("inet") if c.status == "LISTEN"}
    assert heard == {"127.0.0.1"}
    before = {child.pid for child in psutil.Process().children(recursive=True)}
    with local_cluster(1) as address, workers(cluster=address) as team:
        assert team.run(abs, [(-3,)]) == [3]
    assert {child.pid for child in psutil.Process().children(recursive=True)} <= before


@pytest.mark.parametrize(
    "address",
    [
        *("", "somewhere", "127.0.0.1:8786", "tcp://127.0.0.1", "tcp://:8786", "tcp://a b:1", "http://127.0.0.1:8786"),
        *("tcp://127.0.0.1:0", "tcp://127.0.0.1:65536", "tcp://127.0.0.1:8786/", 8786),
    ],
)
def test_what_is_no_address_is_refused(address, demos):
    with pytest.raises(OptionError, match=r"^cluster: expected an address such as tcp://127\.0\.0\.1:8786, got"):
        evaluate(demos, ["bip"], folds=2, cluster=address)
    with pytest.raises(OptionError, match="expected an address"):
        inphase.fit(demos, cluster=address)


def greet(server: socket.socket, words: bytes) -> None:
    """Says these words to all who come, and hangs up if there are none."""
    held = []
    while True:
        try:
            connection, _ = server.accept()
        except OSError:
            break
        if words:
            connection.sendall(words)
            held.append(connection)
        else:
            connection.close()
    for connection in held:
        connection.close()


@pytest.mark.parametrize("who", ["nobody", "silence", "somebody who hangs up", "somebody else"])
def test_an_address_that_does_not_answer_is_named_in_time(who, monkeypatch, demos):
    monkeypatch.setattr(clusters, "ANSWER", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        if who == "nobody":
            server.close()
        elif who != "silence":
            words = {"somebody who hangs up": b"", "somebody else": b"SSH-2.0-OpenSSH_9.6\r\n" + bytes(99)}[who]
            Thread(target=greet, args=(server, words), daemon=True).start()
        begun = time.monotonic()
        with pytest.raises(OptionError, match=rf"^cluster tcp://127\.0\.0\.1:{port}: no scheduler of dask answers"):
            evaluate(demos, ["bip"], folds=2, cluster=f"tcp://127.0.0.1:{port}")
        assert time.monotonic() - begun < 10  # with the patience of ANSWER; it is 8 s at most with the usual one


def test_the_usual_patience_ends_in_ten_seconds():
    assert 2 * clusters.ANSWER < 9


def test_a_cluster_without_workers_or_with_others_is_refused(cluster, demos, monkeypatch):
    empty = distributed.LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0")
    with empty, pytest.raises(OptionError, match="expected at least one worker, got none"):
        evaluate(demos, ["bip"], folds=2, cluster=empty.scheduler_address)
    monkeypatch.setattr(importlib.metadata, "version", lambda name: "9.9")
    with pytest.raises(OptionError, match=rf"expected inphase 9\.9 on tcp://127.*, got {inphase.__version__}"):
        evaluate(demos, ["bip"], folds=2, cluster=cluster)


def test_who_asks_for_no_cluster_needs_no_dask(demos, monkeypatch):
    for name in [name for name in sys.modules if name.split(".")[0] in ("dask", "distributed")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.setitem(sys.modules, "dask", None)
    evaluate(demos, (), folds=2, conditions=["as recorded"], jobs=2)
    words = r"^a cluster needs distributed: pip install 'inphase\[cluster\]'$"
    with pytest.raises(OptionError, match=words):
        evaluate(demos, (), folds=2, cluster="tcp://127.0.0.1:8786")
    with pytest.raises(OptionError, match=words):
        inphase.fit(demos, cluster="tcp://127.0.0.1:8786")
    with pytest.raises(OptionError, match=words), local_cluster(1):
        pass


def test_no_worker_is_no_number_of_them():
    for number in (0, -1):
        with pytest.raises(OptionError, match=f"workers: expected at least 1, got {number}"), local_cluster(number):
            pass


def test_the_benchmark_of_workers_runs(shared_data):
    """Quick: no time is asserted."""
    program = Path(__file__).parents[1] / "benchmarks" / "workers.py"
    command = [sys.executable, "-W", "error", program, "--quick", "--data", shared_data]
    result = subprocess.run(command, capture_output=True, text=True)
    assert (result.returncode, result.stderr) == (0, "")
    assert len(re.findall(r"^handover +(processes|local cluster) .* s +\d+\.\d\d ×$", result.stdout, re.M)) == 2
    assert "results equal" in result.stdout
    result = subprocess.run([*command, "--data", "nowhere"], capture_output=True, text=True)
    assert result.returncode == 2
    assert "expected the recordings nowhere" in result.stderr


def test_tasks_that_are_dropped_at_an_interrupt_are_not_missed():
    """The thread that hands them out finds their numbers and no tasks: its complaint is nobody's."""

    def interrupted():
        with workers(2) as team:
            assert [team.start(partial(abs, -1)).result() for _ in range(2)] == [1, 1]
            for _ in range(40):
                team.start(partial(time.sleep, 30))
            time.sleep(0.5)  # two are begun, so that there is room for others
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
