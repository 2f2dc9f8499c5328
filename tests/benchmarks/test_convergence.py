"""How cost grows and error falls with the number of springs."""

import statistics
import time

import numpy as np
import pytest

from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm.statics import TOLERANCE

RUNS = 11
GRID = np.linspace(0.0, 2.0, 101)
"""Of the march whose cost is compared, mm in compression: up to 6.5 kN of 8.8."""


def critical_force(chain, load_case, n):
    """The bifurcation's force with n springs in every beam, the foot too if there is one."""
    foot = n if len(chain.beams) > 1 else None
    event = VjmEngine(n, foot).trace(chain, load_case).critical
    assert event.kind is EventKind.BIFURCATION
    return event.force


class March:
    """Equilibrium, factorisation with its inertia, and K^F at every point of the grid, n springs in the bar."""

    def __init__(self, chain, n):
        self.problem = LumpedProblem(VjmEngine(n).model(chain), LoadCase("A", to=-GRID[-1]), f"vjm-{n}")
        self.start = self.problem.unloaded().state
        self.seconds = []
        self.run()  # compiles

    def run(self):
        """March once; keeps the seconds per factorisation: one an iteration and one at the solution."""
        model, size = self.problem.model, self.problem.model.size
        started = time.perf_counter()
        good, why, _, force, stiffness, residual, iterations = model.compiled.march(
            self.problem.target(0.0), self.problem.load_case.direction, GRID,
            self.start[:size], self.start[size : size + 6], TOLERANCE, 30,
        )  # fmt: skip
        seconds = time.perf_counter() - started
        assert (good, why) == (len(GRID), "")
        assert residual.max() <= 1e-10
        self.end_force, self.end_stiffness = force[-1, 0], stiffness[-1]
        self.seconds.append(seconds / (np.sum(iterations[1:] + 1)))


def test_cost_grows_with_the_number_of_springs(chain, record):
    marches = {n: March(chain, n) for n in (32, 256)}
    for march in marches.values():
        march.seconds.clear()
    for _ in range(RUNS):
        for march in marches.values():
            march.run()
    # the two are converged answers to one question
    assert marches[32].end_force == pytest.approx(marches[256].end_force, rel=1e-6)
    assert marches[32].end_stiffness[0, 0] == pytest.approx(marches[256].end_stiffness[0, 0], rel=1e-5)
    value = statistics.median(marches[256].seconds) / statistics.median(marches[32].seconds)
    record("cost_ratio_n256_n32", value, "", "<= 10", value <= 10.0)


def test_error_of_few_springs(chain, record):
    load_case = LoadCase("A", to=-4.0)
    reference = critical_force(chain, load_case, 64)
    assert reference == pytest.approx(8849.117, rel=1e-6)
    for n, limit in ((4, 1e-3), (8, 1e-4)):
        error = abs(critical_force(chain, load_case, n) / reference - 1.0)
        record(f"critical_load_error_n{n}", error, "", f"<= {limit:.0e}".replace("e-0", "e-"), error <= limit)


def test_order_of_convergence(record):
    """The least of the doublings from n = 2 to 8, a straight pinned column against P (1 − P/EA) = π² EI/L²."""
    chain = load_chain("pinned-column")
    (beam,) = chain.beams
    section = beam.effective_section()
    assert np.isinf(section.GAy)
    euler = np.pi**2 * section.EIz / beam.length**2
    load = 0.5 * section.EA * (1.0 - np.sqrt(1.0 - 4.0 * euler / section.EA))
    load_case = LoadCase("straight", to=-1.5 * load * beam.length / section.EA)
    n = np.array([2, 4, 8, 16, 32, 64])
    error = np.abs([critical_force(chain, load_case, int(k)) / load - 1.0 for k in n])
    assert error[-1] < 1e-9
    order = np.log2(error[:-1] / error[1:])
    # from 16 springs on the error is rounding
    value = order[:2].min()
    record("critical_load_order", value, "", ">= 3.8", value >= 3.8)
