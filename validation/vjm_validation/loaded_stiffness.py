"""``validate stiffness``: one loaded equilibrium with its stiffness matrices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm import __version__
from vjm.analysis import LoadedStiffness
from vjm.errors import NoConvergenceError
from vjm.model.chain import Chain
from vjm.model.load_case import Load
from vjm.rotations import Array
from vjm.tree.equilibria import Equilibria, equilibria, largest_residual
from vjm.tree.model import Gravity, TreeModel
from vjm.vjm_engine import VjmEngine
from vjm_validation.documents import StiffnessDocument

NO_COMPLIANCE = 1e-12
"""Over the largest: eigenvalue of a compliance that is none."""


def stiffness_document(found: LoadedStiffness) -> StiffnessDocument:
    """What ``validate stiffness --json`` prints of a result."""
    return StiffnessDocument(
        model=found.model,
        model_sha256=found.model_sha256,
        version=__version__,
        engine=found.engine,
        posture=found.posture,
        control=found.control,
        displacement=found.displacement.tolist(),
        wrench=found.wrench.tolist(),
        stiffness_loaded=found.loaded.tolist(),
        stiffness_unloaded=found.unloaded.tolist(),
        stable=True,
        eigenvalue=None if np.isnan(found.eigenvalue) else found.eigenvalue,
        eigenvalue_relative=None if np.isnan(found.eigenvalue_relative) else found.eigenvalue_relative,
        iterations=found.iterations,
        residual=found.residual,
        events=list(found.events),
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
