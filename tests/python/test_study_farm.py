"""Studies on several workers: children that crash, executors, a Dask cluster, shards, two phases."""

from __future__ import annotations

import concurrent.futures
import contextlib
import importlib.util
import logging
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import ulna
from ulna import study as st
from ulna._study_indices import STATUSES

UNIT = ulna.Uniform(0, 1)
CRASHED, TIMEOUT = STATUSES.index("crashed"), STATUSES.index("timeout")


def plain(a, b):
    return a * a + 0.1 * b


def crashes(a, b):
    """10 % of the runs end their process as a wild pointer would."""
    if 0.45 < a < 0.55:
        os.kill(os.getpid(), signal.SIGSEGV)
    return plain(a, b)


def exits(a, b):
    os._exit(7)


def crashed_rows(design):
    a = design.values()[:, 0]
    return (a > 0.45) & (a < 0.55)


@pytest.fixture(scope="module")
def study():
    return ulna.Study({"a": UNIT, "b": UNIT}, plain)


@pytest.fixture(scope="module")
def fragile():
    return ulna.Study({"a": UNIT, "b": UNIT}, crashes)


# Children ------------------------------------------------------------------------------------------


def test_the_result_does_not_depend_on_where_it_is_run(study):
    design = study.design(n=64, seed=1)
    here = study.run(design)
    for options in (
        {"workers": 2, "task_s": 0.001},
        {"isolate": True},
        {"workers": 2, "isolate": False},
    ):
        there = study.run(design, **options)
        assert np.array_equal(there.y, here.y) and not there.status.any()
        assert np.isfinite(there.wall_s).all()


def test_exactly_the_rows_that_crash_are_marked(fragile):
    design = fragile.design(n=8, seed=2)
    rows = crashed_rows(design)
    assert 2 <= rows.sum() <= 6
    runs = fragile.run(design, workers=2, retries=0, on_failure="drop_block")
    assert np.array_equal(runs.status == CRASHED, rows)
    assert np.array_equal(runs.y[~rows, 0], [plain(*x) for x in design.values()[~rows]])
    assert all("died of SIGSEGV" in runs.messages[row] for row in np.flatnonzero(rows))
    report = runs.sobol(on_failure="drop_block", resamples=50).failures
    assert report.by_status == {"crashed": rows.sum()}
    with pytest.raises(ulna.DataError, match="crashed: the process of the run died of SIGSEGV"):
        fragile.run(design, isolate=True, retries=0)


def test_a_slow_run_is_ended(study):
    def slow(a, b):
        if a > 0.9:
            time.sleep(60)
        return a + b

    waits = ulna.Study(study.factors, slow)
    design = waits.design(n=8, seed=1)
    late = design.values()[:, 0] > 0.9
    assert 1 <= late.sum() <= 6
    runs = waits.run(design, timeout_s=0.3, retries=0, on_failure="nearest")
    assert np.array_equal(runs.status == TIMEOUT, late)
    assert runs.messages[int(np.flatnonzero(late)[0])] == "took longer than 0.3 s"


def test_only_what_may_pass_is_tried_again(study, tmp_path):
    """A crash may be the machine's; an error or a failure of the model is final."""
    marks = str(tmp_path)

    def once(a, b):
        with open(f"{marks}/{a!r} {b!r}", "a+") as calls:
            calls.write("x")
        first = os.path.getsize(f"{marks}/{a!r} {b!r}") == 1
        if a > 0.8:
            raise st.RunFailed("diverged") if b > 0.5 else ValueError("odd")
        if a < 0.3 and first:
            os._exit(7)
        return a + b

    twice = ulna.Study(study.factors, once)
    design = twice.design(n=4, seed=3)
    runs = twice.run(design, isolate=True, on_failure="nearest")
    a, b = design.values().T
    # Rows of one point (A's and AB's of the other factor) are told apart by their own coordinates.
    assert not (runs.status[a <= 0.8]).any()
    assert (runs.status[(a > 0.8) & (b > 0.5)] == STATUSES.index("diverged")).all()
    assert (runs.status[(a > 0.8) & (b <= 0.5)] == STATUSES.index("raised")).all()
    calls = {p.name: p.stat().st_size for p in tmp_path.iterdir()}
    assert {calls[f"{x!r} {y!r}"] for x, y in design.values().tolist() if x < 0.3} == {2}
    assert {calls[f"{x!r} {y!r}"] for x, y in design.values().tolist() if x >= 0.3} == {1}


def test_crashed_rows_are_run_again_with_the_journal(study, tmp_path):
    broken = tmp_path / "broken"
    broken.touch()
    flag = str(broken)

    def model(a, b):
        if a > 0.8 and os.path.exists(flag):
            os.kill(os.getpid(), signal.SIGKILL)
        return a + b

    whole = ulna.Study(study.factors, model)
    design = whole.design(n=8, seed=1)
    options = {"isolate": True, "retries": 0, "on_failure": "nearest", "journal": tmp_path / "s"}
    first = whole.run(design, **options)
    assert "SIGKILL" in first.messages[int(first.failed[0])]
    # What is known without running says so; a shard of the other rows leaves them as they are.
    known = whole.collect(design, journal=tmp_path / "s")
    assert np.array_equal(known.status, first.status) and known.messages == first.messages
    broken.unlink()
    half = whole.run(design, shard=(1, 2), writer="half", **options)
    rows = np.arange(design.rows) // design.block_rows % 2 == 1
    assert np.array_equal(half.status[rows], first.status[rows]) and half.status[rows].any()
    assert not half.status[~rows].any() and first.status[~rows].any()
    again = whole.run(design, **options)
    assert not again.failed.size
    assert np.array_equal(again.wall_s[first.status == 0], first.wall_s[first.status == 0])


def test_an_array_function_that_crashes_is_narrowed_down(study):
    def arrays(a, b):
        if (a > 0.9).any():
            os.kill(os.getpid(), signal.SIGSEGV)
        return a + b

    vector = ulna.Study(study.factors, arrays, vectorized=True)
    design = vector.design(n=8, seed=1)
    runs = vector.run(design, isolate=True, retries=0, task_s=100, on_failure="nearest")
    assert np.array_equal(runs.status == CRASHED, design.values()[:, 0] > 0.9)
    assert 0 < runs.failed.size < 6


WHERE = ({}, {"isolate": True}, {"workers": 2, "isolate": False}, {"workers": 2})


@pytest.mark.parametrize("where", WHERE, ids=str)
@pytest.mark.parametrize("vectorized", [False, True])
def test_a_run_that_says_it_crashed_is_tried_again_anywhere(study, tmp_path, where, vectorized):
    """As often as `retries` says, whether a process is lost or the model tells."""
    calls = tmp_path / "calls"

    def model(a, b):
        many = len(a) if vectorized else 1
        with calls.open("a") as log:
            log.write("x" * many)
        if many == 1:
            raise st.RunFailed("crashed", "no licence")
        return st.RunTable(np.zeros(many), ["timeout"] * many)

    said = ulna.Study(study.factors, model, vectorized=vectorized)
    design = said.design(n=4)
    runs = said.run(design, retries=2, on_failure="nearest", **where)
    assert set(runs.status) <= {CRASHED, TIMEOUT}
    assert calls.stat().st_size == 3 * design.rows


@pytest.mark.parametrize("where", WHERE, ids=str)
def test_an_array_function_that_raises_is_narrowed_down(study, where):
    """A row fails for what the function says of it alone; the others have their results."""
    def arrays(a, b):
        if (b > 0.9).any():
            raise st.RunFailed("diverged", "too far")
        if (a > 0.9).any():
            raise ValueError("odd") if (a < 0.95).all() else SystemExit(3)
        return a + b

    vector = ulna.Study(study.factors, arrays, vectorized=True)
    design = vector.design(n=64, seed=1)
    runs = vector.run(design, on_failure="drop_block", **where)
    a, b = design.values().T
    expected = np.where(b > 0.9, "diverged", np.where(a > 0.9, "raised", "ok"))
    assert [STATUSES[code] for code in runs.status] == expected.tolist()
    assert np.array_equal(runs.y[expected == "ok", 0], (a + b)[expected == "ok"])
    said = {runs.messages[row] for row in runs.failed}
    assert said == {"too far", "ValueError: odd", "called sys.exit(3)"}


@pytest.mark.parametrize("where", WHERE, ids=str)
def test_an_array_function_that_raises_stops_the_study_with_its_rows(study, where):
    def run(error):
        def arrays(a, b):
            raise error

        vector = ulna.Study(study.factors, arrays, vectorized=True)
        vector.run(vector.design(n=4), **where)

    rows = r"runs? \d( to \d+)?"
    with pytest.raises(KeyError) as caught:
        run(KeyError("torque"))
    assert any(re.fullmatch(f"in {rows} of the study", note) for note in caught.value.__notes__)
    with pytest.raises(ulna.DataError, match=rows + r" failed \(limit: knee\); choose on_failure"):
        run(st.RunFailed("limit", "knee"))
    with pytest.raises(ulna.DataError, match=r"the function called sys.exit\(2\)"):
        run(SystemExit(2))


@pytest.mark.parametrize("where", WHERE, ids=str)
def test_a_function_that_exits_has_raised(study, where):
    def leaves(a, b):
        if a > 0.5:
            sys.exit(0)
        return a

    quits = ulna.Study(study.factors, leaves)
    design = quits.design(n=8, seed=1)
    runs = quits.run(design, on_failure="nearest", **where)
    assert np.array_equal(runs.status == STATUSES.index("raised"), design.values()[:, 0] > 0.5)
    assert {runs.messages[row] for row in runs.failed} == {"called sys.exit(0)"}
    with pytest.raises(ulna.DataError, match=r"the function called sys.exit\(0\)"):
        quits.run(design, **where)


def test_the_functions_error_comes_back_with_its_traceback(study):
    def bug(a, b):
        raise KeyError("torque")

    with pytest.raises(KeyError) as caught:
        ulna.Study(study.factors, bug).sobol(n=4, workers=2)
    notes = "\n".join(caught.value.__notes__)
    assert "in bug" in notes and "in run " in notes

    class Odd(Exception):
        def __init__(self, a, b):
            super().__init__("odd")

    def odd(a, b):
        raise Odd(a, b)

    with pytest.raises(ulna.DataError, match="the function raised Odd: odd"):
        ulna.Study(study.factors, odd).sobol(n=4, isolate=True)

    def wrong_shape(a, b):
        return a[:2]

    with pytest.raises(ulna.DataError, match="shape"):
        ulna.Study(study.factors, wrong_shape, vectorized=True).sobol(n=4, isolate=True)


def test_the_package_travels_with_a_function_that_names_it(study):
    assert pickle.loads(pickle.dumps(ulna)) is ulna
    cloudpickle = pytest.importorskip("cloudpickle")
    names = {}
    exec("import ulna\ndef f(a, b): return ulna.Uniform(0, 2).quantile(a) + b", names)
    assert pickle.loads(cloudpickle.dumps(names["f"]))(0.5, 1.0) == 2.0
    there = ulna.Study(study.factors, names["f"])
    assert not there.run(there.design(n=2, seed=1), isolate=True).failed.size


def test_what_cannot_be_sent_is_refused(study):
    lock = threading.Lock()
    with pytest.raises(ulna.ArgumentError, match="cannot be sent"):
        ulna.Study(study.factors, lambda a, b: lock and a).sobol(n=4, workers=2)


def test_bad_options_are_refused(study, tmp_path):
    design = study.design(n=4)
    for options, words in [
        ({"workers": 0}, "workers is 0"),
        ({"retries": -1}, "retries is -1"),
        ({"timeout_s": 0}, "timeout_s"),
        ({"task_s": float("nan")}, "task_s"),
        ({"budget_s": -1}, "budget_s"),
        ({"timeout_s": 1, "isolate": False}, "needs isolate"),
        ({"executor": 3}, "executor must be"),
        ({"shard": (1, 2)}, "needs a journal"),
        ({"shard": (3, 2), "journal": tmp_path}, "shard is"),
        ({"shard": "1/2", "journal": tmp_path}, "shard is"),
    ]:
        with pytest.raises(ulna.ArgumentError, match=words):
            study.run(design, **options)


INTERRUPTED = """
import os, signal, sys, threading, time
import ulna

def slow(a, b):
    open(os.environ["FOLDER"] + "/started", "w").close()
    time.sleep(100)

def interrupt():
    while not os.path.exists(os.environ["FOLDER"] + "/started"):
        time.sleep(0.02)
    os.kill(os.getpid(), getattr(signal, sys.argv[1]))

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    threading.Thread(target=interrupt).start()
    unit = ulna.Uniform(0, 1)
    try:
        ulna.Study({"a": unit, "b": unit}, slow).sobol(n=4, workers=2)
    except KeyboardInterrupt:
        print("interrupted")
"""


@pytest.mark.parametrize("how", ["SIGINT", "SIGKILL"])
def test_no_child_outlives_its_study(tmp_path, how):
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED)
    start = time.monotonic()
    # The children hold the pipe, too: that it is closed says that they are gone.
    done = subprocess.run(
        [sys.executable, str(script), how],
        env={**os.environ, "FOLDER": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert time.monotonic() - start < 30
    assert done.stdout == ("interrupted\n" if how == "SIGINT" else "")


# Executors -----------------------------------------------------------------------------------------


def test_a_process_pool(fragile):
    design = fragile.design(n=8, seed=2)
    with concurrent.futures.ProcessPoolExecutor(2) as pool:
        runs = fragile.run(design, executor=pool, retries=0, on_failure="nearest")
        assert np.array_equal(runs.status == CRASHED, crashed_rows(design))
        ends = ulna.Study(fragile.factors, exits)
        with pytest.raises(ulna.DataError, match="leave isolate on"):
            ends.run(design, executor=pool, isolate=False, on_failure="nearest")


class LosesWorkers(concurrent.futures.ThreadPoolExecutor):
    """Tasks with row 3 are always lost, every third other row's once, as when a worker dies."""

    class KilledWorker(Exception):  # the name that Dask gives it
        pass

    def submit(self, function, job, rows, points):
        seen = self.__dict__.setdefault("seen", set())
        fresh = {row for row in rows if row % 3 == 1} - seen
        seen |= fresh
        if 3 in rows or fresh:
            future = concurrent.futures.Future()
            future.set_exception(self.KilledWorker("gone"))
            return future
        return super().submit(function, job, rows, points)


def test_lost_workers_cost_no_row_but_the_one_to_blame(study):
    design = study.design(n=16, seed=1)
    with LosesWorkers(2) as pool:
        runs = study.run(design, executor=pool, isolate=False, on_failure="nearest", task_s=0.002)
    assert runs.failed.tolist() == [3]
    assert "workers died 6 times" in runs.messages[3]


@contextlib.contextmanager
def local_cluster(workers):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def kill_workers(client, kills, pause_s, stop):
    """SIGKILL to one worker after another."""
    for k in range(kills):
        if stop.wait(pause_s):
            return
        with contextlib.suppress(Exception):  # one may be gone already
            pids = list(client.run(os.getpid).values())
            os.kill(pids[k % len(pids)], signal.SIGKILL)
            stop.done += 1


def under_fire(study, design, client, kills, pause_s, **options):
    stop = threading.Event()
    stop.done = 0
    thread = threading.Thread(target=kill_workers, args=(client, kills, pause_s, stop))
    thread.start()
    try:
        return study.run(design, executor=client, on_failure="nearest", **options), stop
    finally:
        stop.set()
        thread.join()


def test_a_dask_cluster_whose_workers_are_killed(tmp_path):
    def model(a, b):
        time.sleep(0.02)
        return crashes(a, b)

    study = ulna.Study({"a": UNIT, "b": UNIT}, model)
    design = study.design(n=16, seed=2)
    with local_cluster(2) as client:
        runs, fire = under_fire(
            study, design, client, 1, 0.5, retries=0, task_s=0.3, journal=tmp_path / "s"
        )
    assert fire.done == 1
    rows = crashed_rows(design)
    assert np.array_equal(runs.status == CRASHED, rows)
    assert np.array_equal(runs.y[~rows, 0], [plain(*x) for x in design.values()[~rows]])
    known = study.collect(design, journal=tmp_path / "s")
    assert not known.missing.size and np.array_equal(known.status, runs.status)
    assert known.messages == runs.messages


@pytest.mark.slow
def test_a_dask_cluster_under_fire_and_its_throughput():
    """10 % of rows crash: exactly those are marked; two workers do at least 1.7 times one's work."""

    def model(a, b):
        time.sleep(0.1)
        return crashes(a, b)

    study = ulna.Study({"a": UNIT, "b": UNIT}, model)
    design = study.design(n=128, seed=2)
    rows = crashed_rows(design)
    assert 0.08 < rows.mean() < 0.12
    took = {}
    for workers in (1, 2):
        with local_cluster(workers) as client:
            study.run(study.design(n=2), executor=client, on_failure="nearest")  # warm
            start = time.monotonic()
            runs = study.run(design, executor=client, retries=0, task_s=2, on_failure="nearest")
            took[workers] = time.monotonic() - start
            assert np.array_equal(runs.status == CRASHED, rows)
            if workers == 2:
                again, fire = under_fire(study, design, client, 6, 4.0, retries=0, task_s=1)
                assert fire.done >= 4
                assert np.array_equal(again.y, runs.y, equal_nan=True)
                assert np.array_equal(again.status, runs.status)
    print(f"one worker {took[1]:.1f} s, two {took[2]:.1f} s")
    assert took[1] > 1.7 * took[2]


ON_MPI = """
import ulna
from mpi4py.futures import MPIPoolExecutor

def model(a, b):
    if a > 0.9:
        raise ulna.study.RunFailed("limit", "far")
    return a * a + 0.1 * b

if __name__ == "__main__":
    unit = ulna.Uniform(0, 1)
    study = ulna.Study({"a": unit, "b": unit}, model)
    design = study.design(n=16, seed=1)
    here = study.run(design, on_failure="nearest")
    with MPIPoolExecutor() as pool:
        there = study.run(design, on_failure="nearest", executor=pool)
    assert here.y.tobytes() == there.y.tobytes() and here.failed.size
    assert here.status.tolist() == there.status.tolist() and here.messages == there.messages
    print("the same")
"""


def test_an_mpi_pool(tmp_path):
    if importlib.util.find_spec("mpi4py") is None or shutil.which("mpiexec") is None:
        pytest.skip("needs mpi4py, and mpiexec of an MPI library")
    script = tmp_path / "on_mpi.py"
    script.write_text(ON_MPI)
    # Open MPI starts nothing for root, and no more ranks than cores, unless it is told to.
    env = {
        **os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    }  # fmt: skip

    def ranks(*words):
        start = ["mpiexec", "-n", "3", sys.executable, *words]
        return subprocess.run(start, capture_output=True, text=True, timeout=120, env=env)

    first = ranks("-c", "from mpi4py import MPI; assert MPI.COMM_WORLD.size == 3")
    if first.returncode:
        pytest.skip(f"mpi4py and mpiexec do not work together: {first.stderr[-300:]}")
    done = ranks("-m", "mpi4py.futures", str(script))
    assert done.stdout == "the same\n", done.stderr


# Shards and budgets --------------------------------------------------------------------------------


def test_two_shards_make_the_whole(study, tmp_path):
    design = study.design(n=32, seed=3)
    whole = study.run(design)
    parts = []
    for i in (1, 2):
        runs = study.run(design, shard=(i, 2), journal=tmp_path / f"part{i}")
        parts.append(runs.status == 0)
        assert runs.missing.size == design.rows // 2 and not runs.failed.size
        with pytest.raises(ulna.DataError, match="64 of 128 runs are missing"):
            runs.sobol()
    assert (parts[0] ^ parts[1]).all()
    told = st.merge([tmp_path / "part1", tmp_path / "part2"], tmp_path / "whole")
    assert told == {"rows": 128, "done": 128, "failed": 0}
    merged = study.collect(design, journal=tmp_path / "whole")
    assert np.array_equal(merged.y, whole.y) and not merged.missing.size
    assert np.array_equal(merged.sobol().total, whole.sobol().total)
    # Once more changes nothing.
    assert st.merge([tmp_path / "part1"], tmp_path / "whole")["done"] == 128


def test_shards_may_share_a_folder(study, tmp_path):
    design = study.design(n=16, seed=3)
    for i in (1, 2, 3):
        study.run(design, shard=(i, 3), journal=tmp_path / "s")
    assert len(list((tmp_path / "s").glob("*.journal"))) == 3
    assert not study.collect(design, journal=tmp_path / "s").missing.size


def test_what_does_not_belong_together_is_not_merged(study, tmp_path):
    one, two = study.design(n=4, seed=1), study.design(n=4, seed=2)
    study.run(one, journal=tmp_path / "one")
    study.run(two, journal=tmp_path / "two")
    with pytest.raises(ulna.DataError, match="another plan.*seed differ"):
        st.merge([tmp_path / "one", tmp_path / "two"], tmp_path / "both")
    assert not (tmp_path / "both").exists()
    with pytest.raises(ulna.FileError, match="holds no study"):
        st.merge([tmp_path / "none"], tmp_path / "both")
    with pytest.raises(ulna.ArgumentError, match="nothing to merge"):
        st.merge([], tmp_path / "both")
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "plan.json").write_text("[]")
    with pytest.raises(ulna.FormatError, match="no plan"):
        st.merge([tmp_path / "bad"], tmp_path / "both")
    (tmp_path / "bad" / "plan.json").write_bytes((tmp_path / "one" / "plan.json").read_bytes())
    with pytest.raises(ulna.DataError, match="hold no journal"):
        st.merge([tmp_path / "bad"], tmp_path / "both")
    (tmp_path / "bad" / "x.journal").write_bytes(b"short")
    with pytest.raises(ulna.FormatError, match="no journal"):
        st.merge([tmp_path / "bad"], tmp_path / "both")


def test_two_results_of_one_row_stop_a_merge(study, tmp_path):
    rng = np.random.default_rng(1)
    noisy = ulna.Study(study.factors, lambda a, b: a + rng.normal())
    design = noisy.design(n=4)
    for i in (1, 2):
        noisy.run(design, journal=tmp_path / str(i))
    with pytest.raises(ulna.DataError, match="two different results"):
        st.merge([tmp_path / "1", tmp_path / "2"], tmp_path / "both")
    assert not list((tmp_path / "both").glob("*.partial"))
    # What was there is still good.
    assert st.merge([tmp_path / "1"], tmp_path / "both")["done"] == design.rows


def test_a_budget_ends_a_study_that_goes_on_later(study, tmp_path):
    def model(a, b):
        time.sleep(0.01)
        return a + b

    slow = ulna.Study(study.factors, model)
    design = slow.design(n=16)
    first = slow.run(design, budget_s=0.1, journal=tmp_path / "s")
    assert 0 < first.missing.size < design.rows
    second = slow.run(design, budget_s=0.1, workers=2, isolate=False, journal=tmp_path / "s")
    assert second.missing.size < first.missing.size
    assert not slow.run(design, journal=tmp_path / "s").missing.size


# Progress ------------------------------------------------------------------------------------------


def test_progress_tells_time_and_indices(study, tmp_path):
    def model(a, b):
        time.sleep(0.005)
        return plain(a, b)

    seen = []
    slow = ulna.Study(study.factors, model)
    design = slow.design(n=128, seed=1)
    runs = slow.run(design, progress=seen.append, journal=tmp_path / "s")
    assert len(seen) >= 3 and seen[-1].done == seen[-1].rows == design.rows
    middle = seen[len(seen) // 2 - 1]
    whole_s = seen[-1].elapsed_s
    # The pace is even, so the estimate is good; the machine may be busy.
    assert middle.elapsed_s + middle.left_s == pytest.approx(whole_s, rel=0.5)
    final = runs.sobol(interval="none")
    np.testing.assert_allclose(list(seen[-1].indices.values()), final.total, rtol=1e-12)
    assert middle.indices["a"] > middle.indices["b"]
    assert "512 of 512 runs" in seen[-1].line() and "so far a 0." in seen[-1].line()
    again = []
    slow.run(design, progress=again.append, journal=tmp_path / "s")
    assert again[-1].done == 512 and again[-1].left_s == 0
    with contextlib.suppress(ImportError):
        slow.run(design, progress=True, journal=tmp_path / "s")


# Two phases ----------------------------------------------------------------------------------------


def three(a, b, c):
    return {"y": a + 2 * a * b + 0.001 * c, "z": b + 0.001 * c}


def test_two_phases(tmp_path):
    study = ulna.Study({"a": UNIT, "b": UNIT, "c": ulna.Normal(3, 1)}, three, outputs=("y", "z"))
    found = study.two_phase(r=16, n=64, seed=1, journal=tmp_path / "s")
    assert found.fixed == {"c": 3.0} and found.kept == ("a", "b")
    assert set(found.ranking) == {"y", "z"}
    direct = study.fix(c=3.0).sobol(n=64, seed=1)
    assert np.array_equal(found.ranking["y"].total, direct.total)
    text = found.summary()
    assert "fixed at c = 3" in text and max(map(len, text.splitlines())) <= 80
    assert "fixed c" in repr(found)
    # a does nothing to z, but it does to y: it is kept.
    assert found.screening["z"].negligible() == ("a", "c")
    kept = study.two_phase(r=16, n=16, keep=["c"], values={"a": 0.1})
    assert kept.fixed == {} and kept.kept == ("a", "b", "c")
    moved = study.two_phase(r=16, n=16, values={"c": 2.0})
    assert moved.fixed == {"c": 2.0}
    by = study.two_phase(r=16, n=16, decide_by=["z"])
    assert by.decided_by == ("z",) and by.kept == ("b",) and by.ranking == {}
    assert "of the largest mu* of z" in by.summary()
    assert {name for name, *_, word in by.decisions() if word == "fixed"} == {"a", "c"}
    alone = ulna.Study({"a": UNIT, "b": UNIT}, lambda a, b: a + 1e-6 * b).two_phase(r=8, n=8)
    assert alone.ranking == {} and "one factor is left" in alone.summary()
    for wrong, words in [
        ({"share": 0}, "share"),
        ({"keep": ["d"]}, "keep must be names"),
        ({"decide_by": ["x"]}, "decide_by must be names of outputs"),
        ({"decide_by": "y"}, "decide_by must be names of outputs"),
        ({"values": {"d": 1}}, "no factor 'd'"),
    ]:
        with pytest.raises(ulna.ArgumentError, match=words):
            study.two_phase(r=4, n=4, **wrong)
    with pytest.raises(ulna.ArgumentError, match="no factor 'd'"):
        study.fix(d=1)
    with pytest.raises(ulna.ArgumentError, match="must remain"):
        study.fix(a=1, b=1, c=1)


def test_two_phases_of_groups_arrays_and_constants():
    groups = {"a": "g", "b": "g"}
    study = ulna.Study(
        {"a": UNIT, "b": UNIT, "c": UNIT, "d": UNIT},
        lambda a, b, c, d: 1e-4 * (a + b) + c + d,
        groups=groups,
        vectorized=True,
    )
    found = study.two_phase(r=16, n=64, workers=2, isolate=False)
    assert found.fixed == {"a": 0.5, "b": 0.5} and found.kept == ("c", "d")
    assert "a = 0.5, b = 0.5" in found.summary()
    flat = ulna.Study({"a": UNIT, "b": UNIT}, lambda a, b: 1.0)
    with (
        pytest.warns(ulna.UncertainResult),
        pytest.raises(ulna.ArgumentError, match="no output varies"),
    ):
        flat.two_phase(r=4, n=4)


def test_the_decision_is_drawn():
    pytest.importorskip("matplotlib").use("Agg")
    study = ulna.Study({"a": UNIT, "b": UNIT, "c": UNIT}, three, outputs=("y", "z"))
    found = study.two_phase(r=16, n=16, seed=1)
    ax = found.plot(output="z")
    assert [label.get_text() for label in ax.get_yticklabels()][-1] == "b"
    assert {text.get_text() for text in ax.get_legend().get_texts()} == {
        "ranked", "fixed", "5 % of the largest"
    }  # fmt: skip
    with pytest.raises(ulna.ArgumentError, match="no output"):
        found.plot(output="w")
