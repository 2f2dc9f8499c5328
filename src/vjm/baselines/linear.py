"""The linear stiffness model (5): the unloaded stiffness matrix times the displacement."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vjm.baselines.frozen_geometry import FrozenGeometry
from vjm.baselines.linear_machine import LinearMachine
from vjm.continuation.path import Equilibrium, Path
from vjm.limits import refuse
from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.model.machine import Machine
from vjm.rotations import Array
from vjm.threads import single_threaded


def straight_path(label: str, chain: Machine, load_case: LoadCase, machine: LinearMachine, started: float) -> Path:
    """Path of a linear model: a straight line, with no stability to speak of.

    Args:
        label: of the engine.
        chain: the machine.
        load_case: the ramp.
        machine: the machine in the load case's posture.
        started: when, by `time.perf_counter`.

    Raises:
        ValueError: the machine is rigid in a direction in which it is held, or it moves without straining a spring.
    """
    held = np.array([name not in load_case.free for name in COMPONENTS])
    constant, ramped = machine.forces(load_case)
    forces = np.column_stack([constant, ramped])
    imposed = np.column_stack([np.zeros(6), load_case.direction])[held]
    response = machine.held(machine.end[held], forces, imposed)
    ends, wrenches = machine.end @ response.x, np.zeros((6, 2))
    wrenches[held] = response.reactions
    for load in load_case.loads:
        if not load.part:
            wrenches[:, int(load.ramped)] += (load_case.sign if load.ramped else 1.0) * np.array(load.wrench)
    K = _support_stiffness(machine, held)
    if load_case.load_driven:
        work = float(ramped @ response.x[:, 1])
        tangent = 1.0 / work if work else float("inf")
    else:
        tangent = float(load_case.direction @ K @ load_case.direction)
    points = []
    for s in np.linspace(0.0, load_case.length, (load_case.steps or 1) + 1):
        along = np.array([1.0, s])
        points.append(
            Equilibrium(
                s=float(s),
                displacement=np.where(held, load_case.displacement(s), ends @ along),
                wrench=wrenches @ along,
                tangent=tangent,
                eigenvalue=float("nan"),
                unstable=-1,
                iterations=0,
                residual=0.0,
                shape=np.empty((0, 3)),
                state=np.empty(0),
                stiffness=K,
            )
        )
    seconds = time.perf_counter() - started
    return Path(label, chain.name, load_case, tuple(points), seconds=seconds, model_sha256=chain.sha256)


def _support_stiffness(machine: LinearMachine, held: np.ndarray) -> Array:
    """Stiffness ``(6, 6)`` of the support, zero where it holds nothing; of a free end-effector that of its own.

    The latter is infinite where the machine is rigid in some direction.
    """
    n = len(machine.unit)
    if held.any():
        K, count = np.zeros((6, 6)), int(np.count_nonzero(held))
        K[np.ix_(held, held)] = machine.held(machine.end[held], np.zeros((n, count)), np.eye(count)).reactions
        return K
    if machine.rigid(machine.end):
        return np.full((6, 6), np.inf)
    return machine.end_stiffness()


@dataclass(frozen=True)
class LinearEngine:
    """``F = K Δt`` (5), with the chain's printed compliance matrices, and its loads on the same stiffness."""

    label: str = "vjm-linear"

    @single_threaded
    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Straight line through the unloaded state; it knows no critical points."""
        refuse(self.label, chain, load_case)
        started = time.perf_counter()
        geometry = FrozenGeometry(self.label, chain.at(load_case.posture), chain.posture(load_case.posture))
        return straight_path(self.label, chain, load_case, geometry.machine(), started)
