"""``validate stiffness``: one loaded equilibrium with its stiffness matrices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm import __version__
from vjm.continuation.load_stepping import follow
from vjm.continuation.lumped_problem import LumpedProblem
from vjm.model.chain import Chain
from vjm.model.load_case import LoadCase
from vjm.model.lumped import LumpedModel
from vjm.rotations import Array, displacement_between
from vjm.statics.equilibrium import Configuration, NoConvergenceError, solve_under_wrench
from vjm.statics.stability import Stability, free_stability, stability
from vjm.statics.stiffness import loaded_stiffness, unloaded_stiffness
from vjm.vjm_engine import VjmEngine
from vjm_validation.documents import StiffnessDocument


def under_displacement(
    chain: Chain, engine: VjmEngine, posture: str, displacement: Sequence[float]
) -> StiffnessDocument:
    """The stable equilibrium at an imposed displacement ``(6,)`` mm, rad, reached on a straight path.

    Raises:
        NoConvergenceError: the path ends before; the message says where and why.
    """
    model = engine.model(chain)
    if not any(displacement):
        at = Configuration(model, model.configuration(chain.posture(posture)), np.zeros(6), 0.0, 0)
        return _document(engine, posture, "displacement", np.zeros(6), at, stability(at), [])
    load_case = LoadCase(posture, 1.0, axis=tuple(displacement))
    problem = LumpedProblem(model, load_case, engine.label)
    path = follow(problem, load_case)
    if not path.complete:
        raise NoConvergenceError(f"the displacement is reached only to {path.points[-1].s:.1%}: {path.stopped}")
    at = problem.configuration(path.points[-1])
    events = [f"{e.kind} at {e.s:.4%} of the displacement, driven force times displacement {e.force:.6g} N mm"
              for e in path.events]  # fmt: skip
    return _document(engine, posture, "displacement", np.array(displacement), at, stability(at), events)


def under_wrench(chain: Chain, engine: VjmEngine, posture: str, wrench: Sequence[float]) -> StiffnessDocument:
    """The stable equilibrium of the free end-effector under a dead wrench ``(6,)`` N, N mm.

    Raises:
        NoConvergenceError: there is none near, or it is unstable.
    """
    model = engine.model(chain)
    x = model.configuration(chain.posture(posture))
    at = solve_under_wrench(model, np.array(wrench, dtype=float), x)
    moved = displacement_between(model.kinematics(x).end, at.kinematics.end)
    verdict = free_stability(at)
    if verdict.unstable:
        raise NoConvergenceError(
            f"under this wrench the free end-effector has an equilibrium, but it is unstable in "
            f"{verdict.unstable} motions; hold the pose with --displacement instead"
        )
    return _document(engine, posture, "wrench", moved, at, verdict, [])


def _document(
    engine: VjmEngine,
    posture: str,
    control: str,
    displacement: Array,
    at: Configuration,
    verdict: Stability,
    events: list[str],
) -> StiffnessDocument:
    model: LumpedModel = at.model
    chain = model.chain
    return StiffnessDocument(
        model=chain.name,
        model_sha256=chain.sha256,
        version=__version__,
        engine=engine.label,
        posture=posture,
        control=control,
        displacement=displacement.tolist(),
        wrench=at.wrench.tolist(),
        stiffness_loaded=loaded_stiffness(at).tolist(),
        stiffness_unloaded=unloaded_stiffness(model, chain.posture(posture)).tolist(),
        stable=verdict.unstable == 0,
        eigenvalue=verdict.eigenvalue,
        iterations=at.iterations,
        residual=at.residual,
        events=events,
    )
