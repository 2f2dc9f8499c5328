"""How many iterations the paper's (13) and Newton-Raphson take along the paper's own paths in tension.

The solvers of `vjm.statics.equilibrium` return only where they end. Here the same steps are taken one by one and
every residual is kept, so that one history gives the count for each tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vjm.continuation.direction import Direction, ramp_end
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium, EventKind, Path
from vjm.model.kinematics import Kinematics
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.rotations import Array
from vjm.statics.equilibrium import TOLERANCE, newton_matrix, newton_scale, residual, scaled_norm
from vjm.vjm_engine import VjmEngine
from vjm_validation.studies.study_results import IterationPoint, IterationStudy

LOOSE = 1e-6
"""A scaled residual that does for a plot of forces: what an author who does not say may have used."""
LIMIT = 200
"""Iterations after which one has failed."""
LOST = 1e6
"""Scaled residual from which no iteration comes back."""
STEP_MM = 0.02
"""Distance of a start from the point that is sought, but just behind a bifurcation, where it is less."""
THINNING = 1.06
"""Ratio of displacement between studied points, where it is more than a step."""
NOISE = 1e-3
"""Standard deviation of the disturbed start, in units of `Mechanism.coordinate_scale`."""
SEED = 13
SAME = 1e-4
"""Up to this scaled distance two states are the same equilibrium."""
DIFFERENCE = 1e-6
"""Scaled step of the differences that give the contraction."""

State = tuple[Array, Array]
"""Joint coordinates ``(m,)`` and wrench ``(6,)``."""
Missing = tuple[Kinematics, Array, Array]
"""Of `vjm.statics.equilibrium.residual`: kinematics, statics ``(m,)``, gap to the target ``(6,)``."""
Step = Callable[[Mechanism, State, Missing], State]
"""One iteration from a state."""


def paper_step(model: Mechanism, state: State, missing: Missing) -> State:
    """One iteration of (13), as `vjm.statics.equilibrium.solve_paper` takes it."""
    (x, _), (k, _, gap) = state, missing
    elastic, passive, unit = model.elastic, model.passive, model.wrench_scale
    J_theta, J_q = k.jacobian[:, elastic], k.jacobian[:, passive]
    A = np.block([[J_theta @ model.compliance @ J_theta.T, J_q], [J_q.T, np.zeros((len(passive), len(passive)))]])
    b = np.concatenate([gap + k.jacobian @ x, np.zeros(len(passive))])
    scale = np.concatenate([unit, model.coordinate_scale[passive]]) / np.sqrt(unit[3])
    solution = scale * np.linalg.solve(A * scale[:, None] * scale, b * scale)
    wrench = solution[:6]
    return model.configuration(solution[6:], model.compliance @ (J_theta.T @ wrench)), wrench


def newton_step(model: Mechanism, state: State, missing: Missing) -> State:
    """One iteration of Newton-Raphson, as `vjm.statics.equilibrium.solve_newton` takes it."""
    (x, wrench), (k, statics, gap) = state, missing
    scale, m = newton_scale(model), model.size
    step = np.linalg.solve(newton_matrix(model, k, wrench), np.concatenate([-statics, gap]) * scale)
    return x + scale[:m] * step[:m], wrench + scale[m:] * step[m:]


def residual_history(
    step: Step, model: Mechanism, target: Array, state: State, *, to: float = TOLERANCE, limit: int = LIMIT
) -> tuple[list[float], State]:
    """Scaled residual after every iteration until it is below ``to``, and where it ended.

    Args:
        step: the iteration.
        model: the lumped model.
        target: end-effector frame ``(4, 4)`` that is imposed, mm.
        state: to start from.
        to: scaled residual that is wanted.
        limit: largest number of iterations.
    """
    history: list[float] = []
    missing = residual(model, *state, target)
    while len(history) < limit:
        try:
            state = step(model, state, missing)
            missing = residual(model, *state, target)
        except (np.linalg.LinAlgError, ValueError):  # the system is singular, or the pose half a turn away
            break
        history.append(scaled_norm(model, *missing[1:], state[1]))
        if history[-1] < to or not history[-1] < LOST:
            break
    return history, state


def count(history: Sequence[float], tolerance: float) -> int | None:
    """Iterations until the residual is below a tolerance; None where it never is."""
    return next((i for i, error in enumerate(history, 1) if error < tolerance), None)


def contraction(model: Mechanism, target: Array, state: State) -> float:
    """By what (13) multiplies a small error at an equilibrium: the spectral radius of its derivative.

    By central differences of `paper_step` over all coordinates.
    """
    x, wrench = state
    unit = model.coordinate_scale
    columns = []
    for i in range(model.size):
        h = DIFFERENCE * unit[i] * np.eye(model.size)[i]
        ahead, behind = (
            paper_step(model, (moved, wrench), residual(model, moved, wrench, target))[0]
            for moved in (x + h, x - h)
        )
        columns.append((ahead - behind) / unit / (2.0 * DIFFERENCE))
    return float(np.max(np.abs(np.linalg.eigvals(np.array(columns).T))))


def iteration_study(chain: Machine, posture: str) -> IterationStudy:
    """Both iterations along the tension path of the paper's model in one posture.

    Every point is sought from its neighbour on the stable path, `STEP_MM` before it, and by (13) once more
    from there with a disturbance of all coordinates, the same at every point. On a path that keeps a symmetry
    the undisturbed start has no part of the critical mode, and (13) does not feel it.

    Args:
        chain: the machine.
        posture: label.
    """
    end = ramp_end(chain, posture, Direction.TENSION)
    load_case = LoadCase(posture, end, steps=round(abs(end) / STEP_MM))
    model = VjmEngine().model(chain)
    problem = LumpedProblem(model, load_case, VjmEngine().label)
    path = VjmEngine().trace(chain, load_case)
    bifurcation = next((event for event in path.events if event.kind is EventKind.BIFURCATION), None)
    noise = NOISE * model.coordinate_scale * np.random.default_rng(SEED).standard_normal(model.size)
    points = []
    for start, wanted in _pairs(path):
        force = float(load_case.direction @ wanted.wrench)
        before = bifurcation is not None and wanted.s < bifurcation.s
        predicted = force / bifurcation.force if before and bifurcation is not None else None
        points.append(_point(model, problem.target(wanted.s), start, wanted, force, predicted, noise))
    event = path.critical
    return IterationStudy(
        posture, Direction.TENSION, tuple(points),
        str(event.kind) if event else None, event.s if event else None, path.stopped,
    )  # fmt: skip


def _pairs(path: Path) -> list[tuple[Equilibrium, Equilibrium]]:
    """Neighbours on one branch of a path, thinned; none reaches across a bifurcation."""
    cuts = [event.s for event in path.events if event.kind is EventKind.BIFURCATION]
    pairs: list[tuple[Equilibrium, Equilibrium]] = []
    last = 0.0
    for start, wanted in zip(path.points, path.points[1:], strict=False):
        if any(start.s < cut < wanted.s for cut in cuts):
            last = 0.0  # the first step on the new branch is studied in any case
        elif wanted.s >= THINNING * last:
            pairs.append((start, wanted))
            last = wanted.s
    return pairs


def _point(
    model: Mechanism,
    target: Array,
    start: Equilibrium,
    wanted: Equilibrium,
    force: float,
    predicted: float | None,
    noise: Array,
) -> IterationPoint:
    m, unit = model.size, model.coordinate_scale
    near, found = ((p.state[:m], p.state[m : m + 6]) for p in (start, wanted))
    disturbed = (near[0] + noise, near[1])
    counts: list[int | None] = []
    for step, state in ((paper_step, near), (paper_step, disturbed), (newton_step, near)):
        history, (x, _) = residual_history(step, model, target, state)
        # another equilibrium of the same pose is no answer
        elsewhere = bool(history) and history[-1] < TOLERANCE and np.abs((x - found[0]) / unit).max() > SAME
        counts += [None, None] if elsewhere else [count(history, TOLERANCE), count(history, LOOSE)]
    return IterationPoint(wanted.s, force, contraction(model, target, found), predicted, *counts)
