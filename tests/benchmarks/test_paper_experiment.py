"""The paper's experiment whole: four postures pulled by 4 mm in steps of 0.001 mm, its model, one core."""

import statistics
import subprocess
import sys
import time

import numpy as np
import pytest

from vjm.continuation.load_grid import GridPath, trace_grid
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine

RUNS = 7
GRID = np.linspace(0.0, 4.0, 4001)
END_FORCE = {"A": 2723.8, "B": 2461.5, "C": 2367.4, "D": 2158.0}
"""Driven force at 4 mm, N."""
PEAK_MEMORY = """
import runpy, sys
from pathlib import Path
from vjm.io.model_file import load_chain
runpy.run_path(sys.argv[1])["experiment"](load_chain("orthoglide-chain"))
# of this program alone: ru_maxrss of a child begins with what its parent had when it started it
status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
print(int(status["VmHWM"].split()[0]) * 1024 / 1e6)
"""


def experiment(chain: Machine) -> dict[str, GridPath]:
    """Equilibrium, K^F and stability at every displacement, model and problem made anew."""
    return {
        posture: trace_grid(
            LumpedProblem(VjmEngine().model(chain), LoadCase(posture, 4.0), "vjm-paper"), GRID
        )
        for posture in END_FORCE
    }  # fmt: skip


def test_time_of_16004_equilibria(chain, record):
    paths = experiment(chain)  # compiles
    seconds = []
    for _ in range(RUNS):
        started = time.perf_counter()
        paths = experiment(chain)
        seconds.append(time.perf_counter() - started)

    assert sum(np.isin(GRID, path.s).sum() for path in paths.values()) == 16004
    for posture, path in paths.items():
        assert not path.stopped
        assert path.residual.max() <= 1e-10
        assert np.all(np.isfinite(path.stiffness))
        assert path.wrench[-1, 0] == pytest.approx(END_FORCE[posture], rel=1e-3)
    # the model of the paper leaves the straight state in tension in A and C, and has a stiffness knee in B and D
    assert [len(paths[posture].turns) for posture in "ABCD"] == [1, 0, 1, 0]

    value = statistics.median(seconds)
    record("table2_16004_equilibria_s", value, "s", "<= 0.2", value <= 0.2)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_peak_memory(record):
    command = [sys.executable, "-c", PEAK_MEMORY, __file__]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    value = float(done.stdout)
    record("peak_memory_MB", value, "MB", "<= 1000", value <= 1000.0)
