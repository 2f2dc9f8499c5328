"""Random machines of all kinds: the package against an independent solver by virtual work."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from helpers.random_machines import KINDS, Case, random_case
from helpers.virtual_work import TINY, Statics, vector_of

from vjm.engines import VjmEngine
from vjm.machine.equilibria import equilibria
from vjm.model.end_condition import held
from vjm.model.load_case import Load, LoadCase
from vjm.model.mechanism import Mechanism, loading_of
from vjm.rotations import displaced
from vjm.statics import loaded_stiffness, solve_newton, stability

CLOSE = 1e-7
"""Of the package's answer: its residual of 1e-11, times a condition of up to 1e4."""


@dataclass(frozen=True)
class Answer:
    """What the package says of a machine."""

    x: np.ndarray
    frames: dict[str, np.ndarray]
    wrench: np.ndarray | None
    stiffness: dict[str, np.ndarray]
    stable: bool


def product_solution(case: Case) -> Answer:
    """The package's equilibrium."""
    if case.imposed is None:
        return _free(case)
    loads = tuple(replace(load, ramped=False) for load in case.loads)
    load_case = LoadCase("drawn", 1.0, axis=case.imposed, free=case.free, loads=loads, gravity=case.gravity)
    end = held(VjmEngine().model(case.chain.at("drawn")), load_case)
    x = end.model.configuration(end.model.chain.posture("drawn"))
    applied, _, _ = loading_of(end.model, x, load_case)
    model = end.model.under(applied)
    start = model.kinematics(x).end
    at = solve_newton(model, displaced(start, case.imposed), x, np.zeros(6))
    frames = {"": model.kinematics(at.x).end}
    return Answer(
        at.x[: model.coordinates], frames, at.wrench, {"": loaded_stiffness(at)}, not stability(at).unstable
    )


def _free(case: Case) -> Answer:
    model = Mechanism(case.chain)
    loads = [*case.loads, *(Load(wrench) for end, wrench in case.wrenches.items() if end not in model.ends)]
    wrench = np.array([case.wrenches[end] for end in model.ends])
    found = equilibria(model, case.values, gravity=case.gravity, wrench=wrench, loads=loads)
    assert found.converged[0]
    frames = {}
    for k, end in enumerate(model.ends):
        frames[end] = np.eye(4)
        frames[end][:3, :3], frames[end][:3, 3] = found.rotation[0, k], found.position[0, k]
    # the package counts what passive joints turn by, the independent solver where they stand
    x = found.x[0].copy()
    for joint in case.chain.joints:
        x[model.span(joint.name).start] += case.values[joint.name]
    stiffness = {end: found.stiffness[0, k] for k, end in enumerate(model.ends)}
    return Answer(x, frames, None, stiffness, bool(found.stable[0]))


def compared(case: Case) -> None:
    """All answers of the package; to `CLOSE` of their size."""
    statics = case.statics()
    own, answer = statics.solve(), product_solution(case)
    assert (answer.x - own.x) / statics.unit[: statics.n] == pytest.approx(0.0, abs=CLOSE)
    length = np.array([[1.0, 1.0, 1.0, statics.length]] * 3 + [[1.0] * 4])
    for end, T in answer.frames.items():
        assert (T - own.ends[end]) / length == pytest.approx(0.0, abs=CLOSE)
    if answer.wrench is not None:
        size = np.repeat([1.0, statics.length], 3)
        largest = np.abs(own.wrench / size).max()
        assert answer.wrench / size == pytest.approx(own.wrench / size, abs=CLOSE * largest)
    for end, K in answer.stiffness.items():
        expected = own.stiffness[end]
        if not np.all(np.isfinite(expected)):
            assert not np.all(np.isfinite(K))
            continue
        unit = np.repeat([1.0, statics.length], 3)
        stiff = np.abs(np.diag(expected)) / unit**2
        # along what is free it is none: there by the stiffest direction, to what rounding leaves of that
        size = unit * np.sqrt(np.maximum(stiff, 1e-6 * stiff.max()))
        size = np.outer(size, size)
        assert K / size == pytest.approx(expected / size, abs=CLOSE * np.abs(expected / size).max())
    if statics.conservative:
        assert answer.stable == (own.negative == 0)


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize("seed", range(24))
def test_the_package_is_the_independent_solver(seed: int):
    compared(random_case(seed))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 500, 50))
def test_the_package_is_the_independent_solver_on_all_seeds(first: int):
    for seed in range(first, first + 50):
        compared(random_case(seed))


# --- the independent solver itself ------------------------------------------------------------------------


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("kind", KINDS)
def test_its_equations_are_the_gradient_of_an_energy(kind: str):
    """Kinematics alone give the energy; wrenches of loops and couplings work on the gaps."""
    rng = np.random.default_rng(1)
    tried = 0
    for seed in range(40):
        statics = random_case(seed, kind).statics()
        if tried == 2:
            break
        if not statics.conservative or statics.laws:
            continue
        tried += 1
        n = statics.n
        y = rng.normal(size=statics.size) * statics.unit * 0.1
        y[:n] += statics.start
        y[n:] = 0.0
        gradient = statics.energy(y[:n] + 1j * TINY * np.eye(n)).imag / TINY
        equations = statics._equations(y[None]).equations[0, :n]
        # sums of rounding of the largest terms
        unit = statics.unit[:n] / statics.energy_unit
        assert equations * unit == pytest.approx(gradient * unit, abs=1e-11 * np.abs(gradient * unit).max())
    assert tried == 2


@pytest.mark.parametrize("kind", KINDS)
def test_its_gaps_vanish_as_drawn_and_their_motion_is_what_their_wrenches_work_on(kind: str):
    statics = random_case(5, kind).statics()
    n, first = statics.n, statics.n + statics.n_tau
    y = np.zeros(statics.size)
    y[:n] = statics.start
    gaps = statics._equations(y[None], 0.0).equations[0, first:]
    assert gaps / statics.row[first:] == pytest.approx(0.0, abs=1e-13)
    _, M, _ = statics._linearised(y, 0.0)
    # both in units whose products are the machine's energy
    assert -M[:n, first:] == pytest.approx(M[first:, :n].T, abs=1e-12 * np.abs(M[first:, :n]).max(initial=1.0))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 8, 16, 4, 12])
def test_its_stiffness_is_the_derivative_of_the_wrench(seed: int):
    case = random_case(seed)
    if case.imposed is None:
        displacement = np.array([0.4, -0.3, 0.2, 0.002, -0.001, 0.003])
        case = replace(case, imposed=tuple(displacement), wrenches={})
    own = case.statics().solve()
    T = own.ends[""]
    for i in range(6):
        step = (1e-3, 1e-5)[i > 2]
        ways = []
        for h in (2.0, 1.0, -1.0, -2.0):
            there = displaced(T, h * step * np.eye(6)[i])
            start = case.statics()
            start.imposed = _between(start, there)
            ways.append(start.solve(own.x).wrench)
        slope = (-ways[0] + 8.0 * ways[1] - 8.0 * ways[2] + ways[3]) / (12.0 * step)
        size = np.sqrt(np.abs(np.diag(own.stiffness[""])))
        expected = own.stiffness[""][:, i] / size
        # rounding of the wrench over the step
        rounding = 1e-12 * np.abs(own.wrench / size).max() / step
        assert slope / size == pytest.approx(expected, abs=1e-7 * np.abs(expected).max() + rounding)


def _between(statics: Statics, there: np.ndarray) -> np.ndarray:
    drawn = statics.drawn[""]
    return np.concatenate([there[:3, 3] - drawn[:3, 3], vector_of(there[:3, :3] @ drawn[:3, :3].T)])


@pytest.mark.slow
def test_it_solves_five_hundred_machines():
    for seed in range(504):
        own = random_case(seed).statics().solve()
        assert np.all(np.isfinite(own.stiffness[""]))
