"""``validate stiffness``: one loaded equilibrium with its stiffness matrices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm import __version__
from vjm.engine import Engine
from vjm.errors import NoConvergenceError
from vjm.model.chain import Chain
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.rotations import Array, displacement_between
from vjm.statics.equilibrium import solve_under_wrench
from vjm.statics.stability import free_stability
from vjm.statics.stiffness import loaded_stiffness, unloaded_stiffness
from vjm.tree.equilibria import Equilibria, equilibria, largest_residual
from vjm.tree.model import Gravity, TreeModel
from vjm.vjm_engine import VjmEngine
from vjm_validation.documents import StiffnessDocument

NEARLY_NOTHING = 1e-6
"""mm: end of a path of which only the unloaded beginning is wanted."""
NO_COMPLIANCE = 1e-12
"""Over the largest: eigenvalue of a compliance that is none."""


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


def held_by_itself(chain: Chain) -> bool:
    """Whether a machine carries a wrench on its free end: no passive joint, or branches that close none."""
    return not chain.joints or bool(chain.after or chain.point_springs)


def of_free_end(
    chain: Chain,
    engine: VjmEngine,
    posture: str,
    wrench: Sequence[float],
    *,
    gravity: Gravity | None = None,
    loads: Sequence[Load] = (),
    end: str = "",
) -> StiffnessDocument:
    """The equilibrium of a machine whose end frame is free, under a dead wrench, weight and loads on its parts.

    Args:
        chain: arm or tree; springs between points and couplings as bent are welcome.
        engine: that splits its beams.
        posture: label.
        wrench: ``(6,)`` N, N mm on the end frame.
        gravity: m/s².
        loads: on parts, in full.
        end: name of the end frame; the first where it is empty.

    Raises:
        NoConvergenceError: there is no equilibrium near, or it is unstable.
        ValueError: no such end frame, posture or part.
    """
    model = TreeModel(engine.split(chain))
    if end and end not in model.ends:
        raise ValueError(f"--end: {chain.name} has no end frame '{end}' (it has {', '.join(model.ends)})")
    index = model.ends.index(end) if end else 0
    on_ends = np.zeros((len(model.ends), 6))
    on_ends[index] = wrench
    q = model.posture(posture)
    at = equilibria(model, q, gravity=gravity, wrench=on_ends, loads=loads)
    if not at.found[0]:
        raise NoConvergenceError(f"{chain.name}, posture {posture}: no equilibrium was found under these loads")
    if not at.stable[0]:
        raise NoConvergenceError(f"{chain.name}, posture {posture}: the equilibrium under these loads is unstable")
    unloaded = equilibria(model, q)
    (K, C), (K0, C0) = (_inverse_pair(each, index) for each in (at, unloaded))
    return StiffnessDocument(
        model=chain.name,
        model_sha256=chain.sha256,
        version=__version__,
        engine=engine.label,
        posture=posture,
        control="wrench",
        end=model.ends[index],
        gravity=list(gravity) if gravity is not None else None,
        displacement=at.deflection[0, index].tolist(),
        wrench=list(map(float, wrench)),
        stiffness_loaded=K,
        stiffness_unloaded=K0,
        compliance_loaded=C,
        compliance_unloaded=C0,
        rigid=rigid_wrenches(np.array(C), model.reach).tolist() if K is None else [],
        torques=dict(zip(model.joints, at.torques[0].tolist(), strict=True)),
        stable=True,
        eigenvalue=None,
        iterations=None,
        residual=largest_residual(at, gravity=gravity, wrench=on_ends, loads=loads),
        events=[],
    )


def _inverse_pair(at: Equilibria, end: int) -> tuple[list[list[float]] | None, list[list[float]] | None]:
    assert at.stiffness is not None
    assert at.compliance is not None
    K, C = at.stiffness[0, end], at.compliance[0, end]
    return K.tolist() if np.all(np.isfinite(K)) else None, C.tolist() if np.all(np.isfinite(C)) else None


def rigid_wrenches(compliance: Array, length: float) -> Array:
    """Unit wrenches ``(k, 6)`` that move nothing: the null space of a compliance ``(6, 6)``.

    Args:
        compliance: mm/N, 1/N, rad/(N mm).
        length: mm, by which moments become forces.
    """
    unit = np.repeat([1.0, length], 3)
    values, vectors = np.linalg.eigh(0.5 * (compliance + compliance.T) * unit[:, None] * unit)
    # beside rounding of 1e-16 there are compliances down to those of stiff bearings, 1e-7 of the largest
    found: Array = (vectors[:, np.abs(values) < NO_COMPLIANCE * values[-1]] * unit[:, None]).T
    found[np.abs(found) < 1e-9 * np.abs(found).max(axis=1, keepdims=True)] = 0.0
    return found / np.abs(found).max(axis=1, keepdims=True)
