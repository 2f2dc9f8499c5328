"""The linear stiffness model (5): the unloaded stiffness matrix times the displacement."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vjm.continuation.path import Equilibrium, Path
from vjm.model.chain import Chain
from vjm.model.end_condition import refuse_rigid
from vjm.model.load_case import LoadCase, refuse_unless_pose_only
from vjm.model.lumped import LumpedModel
from vjm.rotations import Array
from vjm.statics.stiffness import unloaded_stiffness
from vjm.threads import single_threaded


def straight_path(label: str, chain: Chain, load_case: LoadCase, stiffness: Array, seconds: float) -> Path:
    """Path of a linear model: a straight line, with no stability to speak of.

    Args:
        label: of the engine.
        chain: the machine.
        load_case: the ramp.
        stiffness: unloaded ``(6, 6)``, N, mm, rad.
        seconds: that the stiffness took.
    """
    points = []
    for s in np.linspace(0.0, load_case.length, (load_case.steps or 1) + 1):
        displacement = load_case.displacement(s)
        points.append(
            Equilibrium(
                s=float(s),
                displacement=displacement,
                wrench=stiffness @ displacement,
                tangent=float(load_case.direction @ stiffness @ load_case.direction),
                eigenvalue=float("nan"),
                unstable=-1,
                iterations=0,
                residual=0.0,
                shape=np.empty((0, 3)),
                state=np.empty(0),
                stiffness=stiffness,
            )
        )
    return Path(label, chain.name, load_case, tuple(points), seconds=seconds, model_sha256=chain.sha256)


def linear_model(label: str, chain: Chain, posture: str) -> LumpedModel:
    """A chain in a posture with one spring a beam, for what is linear about a machine without forces.

    Raises:
        ValueError: branches, springs between points, a spring under stress, or a rigid direction.
    """
    there = chain.at(posture)
    there.refuse_prestress(label)
    model = LumpedModel(there)
    refuse_rigid(model, posture)
    return model


@dataclass(frozen=True)
class LinearEngine:
    """``F = K Δt`` (5), with the chain's printed compliance matrices."""

    label: str = "vjm-linear"

    @single_threaded
    def trace(self, chain: Chain, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Straight line through the unloaded state; it knows no critical points."""
        refuse_unless_pose_only(self.label, load_case)
        started = time.perf_counter()
        model = linear_model(self.label, chain, load_case.posture)
        K = unloaded_stiffness(model, chain.posture(load_case.posture))
        return straight_path(self.label, chain, load_case, K, time.perf_counter() - started)
