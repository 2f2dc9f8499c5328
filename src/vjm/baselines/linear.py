"""The linear stiffness model (5): the unloaded stiffness matrix times the displacement."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vjm.chain import Chain
from vjm.lumped import LumpedModel
from vjm.paths import Equilibrium, Path
from vjm.programme import Programme, refuse_unless_pose_only
from vjm.rotations import Array
from vjm.stiffness import unloaded_stiffness


def straight_path(label: str, chain: Chain, programme: Programme, stiffness: Array, seconds: float) -> Path:
    """Path of a linear model: a straight line, with no stability to speak of.

    Args:
        label: of the engine.
        chain: the machine.
        programme: the ramp.
        stiffness: unloaded ``(6, 6)``, N, mm, rad.
        seconds: that the stiffness took.
    """
    points = []
    for s in np.linspace(0.0, programme.length, (programme.steps or 1) + 1):
        displacement = programme.displacement(s)
        points.append(
            Equilibrium(
                s=float(s),
                displacement=displacement,
                wrench=stiffness @ displacement,
                tangent=float(programme.direction @ stiffness @ programme.direction),
                eigenvalue=float("nan"),
                unstable=-1,
                iterations=0,
                residual=0.0,
                shape=np.empty((0, 3)),
                state=np.empty(0),
                stiffness=stiffness,
            )
        )
    return Path(label, chain.name, programme, tuple(points), seconds=seconds, model_sha256=chain.sha256)


@dataclass(frozen=True)
class LinearEngine:
    """``F = K Δt`` (5), with the chain's printed compliance matrices."""

    label: str = "vjm-linear"

    def walk(self, chain: Chain, programme: Programme, progress: Callable[[float], None] | None = None) -> Path:
        """Straight line through the unloaded state; it knows no critical points."""
        refuse_unless_pose_only(self.label, programme)
        started = time.perf_counter()
        K = unloaded_stiffness(LumpedModel(chain), chain.posture(programme.posture))
        return straight_path(self.label, chain, programme, K, time.perf_counter() - started)
