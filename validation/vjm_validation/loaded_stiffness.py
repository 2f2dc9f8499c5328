"""``validate stiffness``: one loaded equilibrium with its stiffness matrices."""

from __future__ import annotations

import numpy as np

from vjm import __version__
from vjm.loaded_stiffness import LoadedStiffness
from vjm.rotations import Array
from vjm_validation.documents import StiffnessDocument


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
        end=found.end,
        gravity=list(found.gravity) if found.gravity is not None else None,
        stiffness_loaded=_finite(found.loaded),
        stiffness_unloaded=_finite(found.unloaded),
        compliance_loaded=_finite(found.loaded_compliance),
        compliance_unloaded=_finite(found.unloaded_compliance),
        rigid=found.rigid.tolist() if found.rigid is not None and _finite(found.loaded) is None else [],
        torques=dict(found.torques) if found.torques is not None else None,
        pulls=dict(found.pulls),
        laws=list(found.laws),
        stable=found.stable,
        eigenvalue=None if np.isnan(found.eigenvalue) else found.eigenvalue,
        eigenvalue_relative=None if np.isnan(found.eigenvalue_relative) else found.eigenvalue_relative,
        iterations=found.iterations,
        residual=found.residual,
        events=list(found.events),
    )


def _finite(matrix: Array | None) -> list[list[float]] | None:
    return None if matrix is None or not np.all(np.isfinite(matrix)) else matrix.tolist()
