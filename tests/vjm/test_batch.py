"""Batches: whoever computes them, and however they end."""

import math
import multiprocessing
import os
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from vjm.baselines.linear import LinearEngine
from vjm.batch import Failure, Task, beside, map_all, trace_all
from vjm.continuation.path import Path
from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase
from vjm.model.parts import Beam
from vjm.threads import single_threaded


@pytest.fixture(scope="module")
def tasks(chain) -> list[Task]:
    """Postures, directions, engines, chains and load cases; two that cannot be done, and many that are short."""
    soft = chain.with_actuator_compliance(2e-6)
    bare = replace(chain, parts=tuple(replace(p, section=None) if isinstance(p, Beam) else p for p in chain.parts))
    wide = [
        Task(engine, machine, LoadCase(posture, to, steps=5))
        for engine in (VjmEngine(), VjmEngine(4), LinearEngine())
        for machine in (chain, soft)
        for posture in "AB"
        for to in (-4.0, 4.0)
    ]
    wide.insert(3, Task(VjmEngine(4), bare, LoadCase("A", -4.0)))
    wide.insert(9, Task(VjmEngine(4), chain, LoadCase("Z", -4.0)))
    return wide + [Task(VjmEngine(), chain, LoadCase("C", 1e-3 * (i + 1), steps=1)) for i in range(60)]


@pytest.fixture(scope="module")
def alone(tasks) -> list[Path | Failure]:
    """What one process makes of them."""
    return trace_all(tasks)


class Log:
    """What a batch told its caller."""

    def __init__(self) -> None:
        self.progress: list[tuple[int, int]] = []
        self.results: dict[int, object] = {}

    def on_progress(self, done: int, total: int) -> None:
        self.progress.append((done, total))

    def on_done(self, index: int, result: object) -> None:
        assert index not in self.results
        self.results[index] = result


def bits(result: Path | Failure) -> object:
    """All of a result but for the time that it took."""
    if isinstance(result, Failure):
        return result
    points = [*result.points, *(event.point for event in result.events)]
    numbers = np.concatenate([
        np.concatenate([p.state, p.wrench, p.stiffness.ravel(), [p.s, p.tangent, p.eigenvalue, p.residual]])
        for p in points
    ])  # fmt: skip
    events = [(event.kind, event.s, event.force, event.stiffness_after) for event in result.events]
    return result.engine, result.load_case, result.stopped, events, numbers.tobytes()


def test_results_come_in_the_order_of_the_tasks(tasks, alone):
    assert len(alone) == len(tasks)
    for task, result in zip(tasks, alone, strict=True):
        if isinstance(result, Path):
            assert (result.engine, result.load_case) == (task.engine.label, task.load_case)
    own = tasks[0].engine.trace(tasks[0].chain, tasks[0].load_case)
    assert bits(alone[0]) == bits(own)


def test_a_failure_stands_in_its_place(alone):
    failures = {i: result for i, result in enumerate(alone) if isinstance(result, Failure)}
    assert sorted(failures) == [3, 9]
    assert failures[3].kind == "ValueError"
    assert "has no section" in failures[3].message
    assert failures[9].kind == "KeyError"
    assert "no posture 'Z'" in failures[9].message


def test_two_processes_make_the_same_to_the_last_bit(tasks, alone):
    log = Log()
    together = trace_all(tasks, 2, log.on_progress, log.on_done)
    assert [bits(result) for result in together] == [bits(result) for result in alone]
    assert log.progress == [(i + 1, len(tasks)) for i in range(len(tasks))]
    assert [log.results[i] for i in range(len(tasks))] == together
    assert multiprocessing.active_children() == []


def test_an_interrupted_batch_goes_on_with_what_is_left(tasks, alone):
    kept: dict[int, Path | Failure] = {}

    def keep(index, result):
        kept[index] = result
        if len(kept) == 12:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trace_all(tasks, done=keep)
    left = [i for i in range(len(tasks)) if i not in kept]
    assert len(left) == len(tasks) - 12
    for i, result in zip(left, trace_all([tasks[i] for i in left]), strict=True):
        kept[i] = result
    assert [bits(kept[i]) for i in range(len(tasks))] == [bits(result) for result in alone]


def test_an_interrupt_ends_the_processes():
    def interrupt(index, result):
        raise KeyboardInterrupt

    started = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        map_all(time.sleep, [0.0, 60.0, 60.0, 60.0], 2, done=interrupt)
    assert multiprocessing.active_children() == []
    assert time.monotonic() - started < 30.0


def test_an_error_is_passed_on_and_says_where():
    threads = os.environ.get("OMP_NUM_THREADS")
    with pytest.raises(ValueError) as refusal:
        map_all(math.sqrt, [4.0, -1.0, 9.0], 2)
    assert any("process of the batch" in note for note in refusal.value.__notes__)
    assert multiprocessing.active_children() == []
    assert os.environ.get("OMP_NUM_THREADS") == threads


def test_a_process_that_dies_is_missed():
    with pytest.raises(RuntimeError) as death:
        map_all(os._exit, [3, 3], 2)
    assert "exit code 3" in str(death.value)


def test_batches_of_none_and_one_need_no_process():
    log = Log()
    assert map_all(math.sqrt, [], 4) == []
    assert map_all(math.sqrt, [4.0], 4, log.on_progress, log.on_done) == [2.0]
    assert (log.progress, log.results) == ([(1, 1)], {0: 2.0})
    with pytest.raises(ValueError) as refusal:
        map_all(math.sqrt, [4.0], 0)
    assert "at least one job" in str(refusal.value)


def test_small_items_go_together(capsys):
    """An item of a microsecond costs a message's share; printed, for machines are shared."""
    stamps: list[float] = []
    many = 20_000
    map_all(math.sqrt, [float(i) for i in range(many)], 2, done=lambda i, r: stamps.append(time.perf_counter()))
    with capsys.disabled():
        print(f"\n{1e6 * (stamps[-1] - stamps[0]) / many:.1f} µs an item of a batch of {many}")
    assert len(stamps) == many


@pytest.mark.parametrize("jobs", [1, 2])
def test_work_beside_gives_its_result_or_its_error(jobs):
    with beside(partial(math.sqrt, 4.0), jobs) as awaited:
        assert bool(multiprocessing.active_children()) == (jobs > 1)
        assert awaited() == 2.0
    with pytest.raises(ValueError), beside(partial(math.sqrt, -1.0), jobs) as awaited:
        awaited()
    assert multiprocessing.active_children() == []


def test_work_beside_ends_with_what_it_is_beside():
    started = time.monotonic()
    with pytest.raises(KeyboardInterrupt), beside(partial(time.sleep, 60.0), 2):
        raise KeyboardInterrupt
    assert multiprocessing.active_children() == []
    assert time.monotonic() - started < 30.0


# Small solves run in one thread of linear algebra; whoever calls keeps the threads that they had.


PROGRAM = """
import numpy as np
from threadpoolctl import threadpool_info

def threads():
    return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]

import vjm
import scipy.linalg
seen, solve = [], np.linalg.solve

def watched(*args):
    seen.append(max(threads()))
    return solve(*args)

np.linalg.solve = watched
machine, before = vjm.load("pinned-column"), threads()
vjm.trace(machine, vjm.LoadCase(next(iter(machine.postures)), to=-0.1), engine="exudyn")
print(before == threads() and max(before), seen and max(seen))
"""

LATER = """
import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits
from vjm.threads import single_threaded

def threads():
    return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]

before = single_threaded(threads)()
import pypardiso
with threadpool_limits(limits=2, user_api="blas"):
    print(len(before), *single_threaded(threads)())
"""


def blas_threads():
    return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]


def test_inside_one_thread_and_outside_as_before():
    with threadpool_limits(limits=2, user_api="blas"):
        # SciPy's own library is loaded by then too
        single_threaded(blas_threads)()
        before = blas_threads()
        inside = single_threaded(blas_threads)()
        assert set(inside) == {1}
        assert blas_threads() == before


def test_also_where_the_function_fails():
    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        with pytest.raises(np.linalg.LinAlgError):
            single_threaded(np.linalg.inv)(np.zeros((2, 2)))
        assert blas_threads() == before


def test_a_library_that_is_loaded_later_is_limited_too():
    pytest.importorskip(
        "pypardiso", reason="PyPardiso, which brings MKL, is an optional extra and is not installed"
    )
    done = subprocess.run([sys.executable, "-c", LATER], capture_output=True, text=True, check=True)
    before, *inside = map(int, done.stdout.split())
    assert len(inside) == before + 1
    assert set(inside) == {1}


@pytest.mark.slow
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one processor: there is only one thread anyway")
def test_a_path_of_the_finite_elements_from_python_takes_one_thread():
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    environment = {name: value for name, value in os.environ.items() if name not in names}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
    )
    outside, inside = done.stdout.split()
    assert int(outside) > 1
    assert inside == "1"
