"""The compiled kernels against dense numpy, on random chains and on the paper's, loaded and unloaded."""

import os
import subprocess
import sys

import numpy as np
import pytest
from helpers import oracle
from hypothesis import given
from hypothesis import strategies as st

from vjm.continuation.load_grid import trace_grid
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.engines import VjmEngine
from vjm.kernels.border import symmetric_factor, symmetric_solve
from vjm.kernels.compilation import njit
from vjm.model.load_case import LoadCase
from vjm.model.mechanism import Mechanism
from vjm.model.packing import order_of
from vjm.model.parameters import beam_length
from vjm.model.parts import Placement
from vjm.statics import TOLERANCE, Configuration

ENGINES = [
    VjmEngine(),
    VjmEngine(3, placement=Placement.END),
    VjmEngine(4, placement=Placement.TWO_THIRDS),
    VjmEngine(5),
    VjmEngine(4, 3),
]


def random_state(model: Mechanism, posture, seed: int, load: float) -> Configuration:
    """A state of the model, not in equilibrium, with turns of some hundredths and a wrench of any kind."""
    rng = np.random.default_rng(seed)
    x = model.configuration(posture) + 0.03 * model.coordinate_scale * rng.standard_normal(model.size)
    return Configuration(model, x, load * model.wrench_scale * rng.standard_normal(6), 0.0, 0)


def scaled_stiffness(model, K):
    return K / model.wrench_scale[:, None] / model.wrench_scale * model.wrench_scale[3]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES, ids=lambda e: e.label)
@given(seed=st.integers(0, 10_000), posture=st.sampled_from("ABCD"), load=st.sampled_from([0.0, 1e-3, 0.03]))
def test_everything_about_a_state_agrees_with_the_dense_equations(chain, engine, seed, posture, load):
    model = engine.model(chain)
    at = random_state(model, chain.posture(posture), seed, load)
    compiled = model.compiled
    reduced, _ = oracle.second_variation(at)
    values = np.linalg.eigvalsh(reduced)
    # rounding against the stiffest spring, amplified where the tangent is nearly singular
    slack = 1e-13 * values[-1] / np.abs(values).min()
    assert compiled.factorise(at.x, at.wrench) == np.count_nonzero(values < 0.0)
    K = oracle.loaded_stiffness(at)
    scale = np.abs(scaled_stiffness(model, K)).max()
    difference = scaled_stiffness(model, compiled.end_stiffness(at.x, at.wrench) - K)
    assert np.abs(difference).max() < 100 * slack * max(scale, 1.0)
    rng = np.random.default_rng(seed + 1)
    statics = rng.standard_normal(model.size) / model.coordinate_scale * model.wrench_scale[3]
    gap = 1e-3 * rng.standard_normal(6)
    dx, dF = compiled.response(at.x, at.wrench, statics, gap)
    dx_dense, dF_dense = oracle.newton_step(at, statics, gap)
    size = np.abs(dx_dense / model.coordinate_scale).max()
    assert np.abs((dx - dx_dense) / model.coordinate_scale).max() < 100 * slack * size
    size = np.abs(dF_dense / model.wrench_scale).max()
    assert np.abs((dF - dF_dense) / model.wrench_scale).max() < 100 * slack * size
    nearest = values[np.argsort(np.abs(values))]
    found, modes = compiled.modes(at.x, at.wrench, 2)
    # equal segments without load have one eigenvalue many times, which a random state splits by per milles: the
    # iteration ends among them. Where one is alone, beside critical points, `test_statics` asks for all digits.
    assert np.abs(found) == pytest.approx(np.abs(nearest[:2]), rel=6e-5)
    assert np.abs(at.kinematics.jacobian @ modes / np.repeat([310.0, 1.0], 3)[:, None]).max() < 1e-7
    assert np.abs(compiled.shape(at.x) - model.shape(at.kinematics)).max() < 1e-9


def test_several_right_sides_give_what_each_gives(chain):
    model = VjmEngine(4).model(chain)
    at = random_state(model, chain.posture("A"), 1, 1e-3)
    rng = np.random.default_rng(2)
    statics = rng.standard_normal((3, model.size)) / model.coordinate_scale * model.wrench_scale[3]
    gaps = 1e-3 * rng.standard_normal((3, 6))
    dx, dF = model.compiled.responses(at.x, at.wrench, statics, gaps)
    for k in range(3):
        each = model.compiled.response(at.x, at.wrench, statics[k], gaps[k])
        np.testing.assert_array_equal(np.concatenate([dx[k], dF[k]]), np.concatenate(each))


def test_machines_of_one_structure_share_the_order_of_elimination_and_nothing_else(chain):
    length = beam_length(chain, "link")
    longer = length.apply(chain, length.value + 1.0)
    kept = [VjmEngine(3).model(machine).compiled.arrays for machine in (chain, longer)]
    assert kept[0].source is kept[1].source
    assert not np.array_equal(kept[0].beam, kept[1].beam)
    order_of.cache_clear()
    for arrays, machine in zip(kept, (chain, longer), strict=True):
        anew = VjmEngine(3).model(machine).compiled.arrays
        for name, one, other in zip(arrays._fields, arrays, anew, strict=True):
            np.testing.assert_array_equal(one, other, err_msg=name)
        order_of.cache_clear()


@pytest.mark.parametrize(("posture", "to"), [("A", 2.0), ("B", 3.0), ("C", 0.3), ("A", -3.5)])
@pytest.mark.parametrize("engine", [VjmEngine(), VjmEngine(4)], ids=lambda e: e.label)
def test_a_grid_gives_what_one_by_one_gives(chain, engine, posture, to):
    load_case = LoadCase(posture, to, steps=400)
    problem = LumpedProblem(engine.model(chain), load_case, engine.label)
    found = trace_grid(problem, np.linspace(0.0, load_case.length, 401))
    path = engine.trace(chain, load_case)
    assert found.stopped == path.stopped == ""
    # the error measured is rounding alone
    assert [turn.s for turn in found.turns] == pytest.approx([e.s for e in path.events if e.switched], rel=1e-10)
    assert len(found.s) == 401
    at = {round(p.s, 9): p for p in path.points}
    unit = problem.model.wrench_scale
    for s, wrench, stiffness in zip(found.s, found.wrench, found.stiffness, strict=True):
        point = at[round(float(s), 9)]
        # both solved to TOLERANCE; close behind a bifurcation the state is that much softer
        assert np.abs((wrench - point.wrench) / unit).max() < 1e4 * TOLERANCE
        expected, K = (k / unit[:, None] / unit * unit[3] for k in (point.stiffness, stiffness))
        # behind a bifurcation other entries than the driven one hang on the state by up to 1e8
        rest = 1e-2 if any(turn.s < s for turn in found.turns) else 1e-6
        assert np.abs(K - expected).max() < rest * np.abs(expected).max()
        along = load_case.direction
        assert along @ stiffness @ along == pytest.approx(point.tangent, rel=1e-4)
    assert found.residual.max() < TOLERANCE


def test_a_grid_that_cannot_be_traced_keeps_what_it_has(chain):
    """Folded far beyond its buckling, on a grid too coarse for it, the chain lands on no neighbouring state."""
    engine = VjmEngine(4, placement=Placement.TWO_THIRDS)
    problem = LumpedProblem(engine.model(chain), LoadCase("A", -500.0), engine.label)
    found = trace_grid(problem, np.linspace(0.0, 500.0, 2001))
    assert "beyond" in found.stopped
    assert 3.0 < found.s[-1] < 500.0
    assert len(found.s) == len(found.wrench) == len(found.stiffness)
    assert len(found.turns) >= 1


# The factor of the border against dense eigenvalues and solutions.


@njit(error_model="numpy")
def solved(F, b):
    """Negative eigenvalues and rank; the solution in place of the right side."""
    n = len(F)
    swaps, pivots = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    negative, rank = symmetric_factor(F, swaps, pivots, 0)
    symmetric_solve(F, swaps, pivots, rank, b)
    return negative, rank


def test_a_pair_of_pivots_is_that_of_the_largest_entry_between_them():
    """The third row has 0.6 twice: with the last row, from which it is reached, and with the second, singular."""
    A = np.array([[0.0, 0.0, 0.05, 0.1], [0.0, 1.0, 0.6, 0.0], [0.05, 0.6, 0.36, 0.6], [0.1, 0.0, 0.6, 0.0]])
    b = np.array([1.0, 2.0, -1.0, 0.5])
    x = b.copy()
    assert solved(A.copy(), x) == (np.count_nonzero(np.linalg.eigvalsh(A) < 0.0), 4)
    # backward stable
    assert np.abs(A @ x - b).max() < 1e-14 * np.abs(x).max()


# A kernel that is kept on disk is compiled anew where one that it calls has changed.


CALLEE = "from vjm.kernels.compilation import kernel\n\n\n@kernel\ndef factor(x):\n    return {} * x\n"
CALLER = (
    "from callee import factor\nfrom vjm.kernels.compilation import entry\n"
    "from vjm.kernels.compiling import watchers\n\nsaid = []\nwatchers.append(said.append)\n\n\n"
    "@entry\ndef scaled(x):\n    return factor(x)\n\n\n"
    "print(scaled(3.0), sum(scaled.stats.cache_hits.values()), *said)\n"
)


def test_a_change_of_what_a_kernel_calls_is_seen(tmp_path):
    (tmp_path / "caller.py").write_text(CALLER)
    # Python's own cache looks at a file's time in whole seconds and its size, which stay here
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kept"), "PYTHONDONTWRITEBYTECODE": "1"}
    said = []
    for factor in (2.0, 2.0, 5.0):
        (tmp_path / "callee.py").write_text(CALLEE.format(factor))
        run = subprocess.run(
            [sys.executable, "caller.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        )
        said.append(run.stdout.split())
    # the second run finds what the first has kept, the third must not
    # and who watches is told of each kernel that is compiled, of none that is loaded
    assert said == [["6.0", "0", "scaled", "factor"], ["6.0", "1"], ["15.0", "0", "scaled", "factor"]]


KEPT = """
from numba.core.cpu import CPUContext
from vjm import warm_up
from vjm_updating.warm_up import histories

read, reading = [], CPUContext.load_additional_registries
CPUContext.load_additional_registries = lambda context: read.append(context) or reading(context)
for work in (warm_up.paths, warm_up.platforms, warm_up.postures, histories):
    work()
print(len(read))
"""


def test_every_kernel_that_is_kept_is_loaded_without_what_compiling_takes():
    """A kernel that needs one of Numba's translations to be loaded would end the process."""
    command = [sys.executable, "-c", KEPT]
    subprocess.run(command, check=True, capture_output=True)
    assert subprocess.run(command, check=True, capture_output=True).stdout.split() == [b"0"]
