"""Small solves run in one thread of linear algebra; whoever calls keeps the threads that they had."""

import os
import subprocess
import sys

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from vjm.threads import single_threaded

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
