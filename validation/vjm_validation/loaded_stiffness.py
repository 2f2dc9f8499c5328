"""``validate stiffness``: one loaded equilibrium with its stiffness matrices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm import __version__
from vjm.engine import Engine
from vjm.errors import NoConvergenceError
from vjm.model.chain import Chain
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.rotations import displacement_between
from vjm.statics.equilibrium import solve_under_wrench
from vjm.statics.stability import free_stability
from vjm.statics.stiffness import loaded_stiffness, unloaded_stiffness
from vjm.vjm_engine import VjmEngine
from vjm_validation.documents import StiffnessDocument

NEARLY_NOTHING = 1e-6
"""mm: end of a path of which only the unloaded beginning is wanted."""


def traced(model: Chain, engine: Engine, posture: str, control: str, values: Sequence[float]) -> StiffnessDocument:
    """The stable equilibrium at the end of a straight path, by any engine that computes K^F.

    Args:
        model: a chain, or a manipulator under its protocol.
        engine: that traces its paths.
        posture: label.
        control: ``displacement``: the pose is imposed; ``wrench``: the end-effector is free under a dead wrench.
        values: ``(6,)`` mm, rad or N, N mm, at the path's end.

    Raises:
        NoConvergenceError: the path ends before; the message says where and why.
        ValueError: the engine computes no 6×6 stiffness.
    """
    path = engine.trace(model, _straight(posture, control, values))
    if any(values) and not path.complete:
        raise NoConvergenceError(f"the {control} is reached only to {path.points[-1].s:.1%}: {path.stopped}")
    first, last = path.points[0], path.points[-1 if any(values) else 0]
    if first.stiffness is None or last.stiffness is None:
        raise ValueError(f"--engine {engine.label}: computes forces along a path, but no 6×6 stiffness")
    events = [f"{e.kind} at {e.s:.4%} of the {control}" for e in path.events] if any(values) else []
    return StiffnessDocument(
        model=model.name,
        model_sha256=model.sha256,
        version=__version__,
        engine=engine.label,
        posture=posture,
        control=control,
        displacement=last.displacement.tolist(),
        wrench=last.wrench.tolist(),
        stiffness_loaded=last.stiffness.tolist(),
        stiffness_unloaded=first.stiffness.tolist(),
        stable=last.unstable <= 0,
        eigenvalue=None if np.isnan(last.eigenvalue) else last.eigenvalue,
        iterations=last.iterations,
        residual=last.residual,
        events=events,
    )


def _straight(posture: str, control: str, values: Sequence[float]) -> LoadCase:
    """The load case that ends at the values; without any, one that begins at the unloaded posture."""
    if not any(values):
        return LoadCase(posture, NEARLY_NOTHING, steps=1)
    if control == "displacement":
        return LoadCase(posture, 1.0, axis=tuple(values))
    return LoadCase(posture, 1.0, "load", loads=(Load(tuple(values)),), free=COMPONENTS)


def under_wrench(chain: Chain, engine: VjmEngine, posture: str, wrench: Sequence[float]) -> StiffnessDocument:
    """The stable equilibrium of the free end-effector under a dead wrench ``(6,)`` N, N mm.

    Raises:
        NoConvergenceError: there is none near, or it is unstable.
    """
    chain = chain.at(posture)
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
    return StiffnessDocument(
        model=chain.name,
        model_sha256=chain.sha256,
        version=__version__,
        engine=engine.label,
        posture=posture,
        control="wrench",
        displacement=moved.tolist(),
        wrench=at.wrench.tolist(),
        stiffness_loaded=loaded_stiffness(at).tolist(),
        stiffness_unloaded=unloaded_stiffness(model, chain.posture(posture)).tolist(),
        stable=verdict.unstable == 0,
        eigenvalue=verdict.eigenvalue,
        iterations=at.iterations,
        residual=at.residual,
        events=[],
    )
