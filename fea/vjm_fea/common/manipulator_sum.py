"""Whole manipulators from any finite element engine of single chains, by the paper's own sum over the chains.

Each leg is meshed on its own; the platform's equilibrium is found by Newton's method with the sum of the legs'
loaded stiffnesses. So a program that knows chains only answers for a robot, and the sum is tried on finite
elements.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from vjm.continuation.path import Equilibrium
from vjm.errors import NoConvergenceError
from vjm.model.chain import Chain
from vjm.model.load_case import LoadCase
from vjm.platform.closure import RigidPose
from vjm.platform.leg_topology import carried
from vjm.platform.manipulator import BASE, PLATFORM
from vjm.rotations import Array, displaced, displacement_between, skew
from vjm_fea.common.beam_problem import BeamProblem

TOLERANCE = 1e-9
"""What the platform's balance may lack, over the wrench."""
ITERATIONS = 15
JUMPED = 2.0
"""Of the displacement that the tangent foresees: one that goes further has left its branch at a critical point."""
GROWTH = 1.3
"""Of the step from one force to the next."""


@dataclass(frozen=True)
class PlatformState:
    """A free platform in equilibrium.

    Attributes:
        displacement: ``(6,)`` from the rigid pose, mm, rad.
        stiffness: ``(6, 6)`` the sum over the legs, N/mm, N, N mm.
        stable: whether all legs are, their ends held, and the sum is positive definite.
        legs: the legs' own states.
    """

    displacement: Array
    stiffness: Array
    stable: bool
    legs: tuple[Equilibrium, ...]


class SummedPlatform:
    """A manipulator in a pose, each leg a chain of its own."""

    def __init__(self, pose: RigidPose, problem: Callable[[Chain, LoadCase], BeamProblem]) -> None:
        """Mesh the legs.

        Args:
            pose: rigid and closed.
            problem: a chain under a load case in the engine that is to be used.

        Raises:
            ValueError: a leg does not run from the base to the platform.
        """
        robot = pose.manipulator
        if any((leg.start, leg.end) != (BASE, PLATFORM) for leg in robot.legs) or robot.couplings:
            raise ValueError(f"{robot.name}: the sum is over chains that all run from base to platform")
        self._home = pose.frames[0]
        self._length = robot.characteristic_length
        self._problems, self._attachments, self._ends = [], [leg.attachment for leg in robot.legs], []
        for i, leg in enumerate(robot.legs):
            coordinate = float(pose.drives[i]) + robot.offsets.get(leg.name, 0.0)
            chain = robot.built(leg)
            chain = replace(
                chain,
                name=f"{robot.name}-{leg.name}",
                base=leg.driven_root(coordinate) @ chain.base,
                postures={"pose": pose.q[i]},
            )
            self._problems.append(problem(chain, LoadCase("pose", 1.0)))
            self._ends.append(self._home @ leg.attachment)
        rest = tuple(p.unloaded() for p in self._problems)
        self.rest = self._state(np.zeros(6), rest)

    def _state(self, displacement: Array, legs: tuple[Equilibrium, ...]) -> PlatformState:
        T = displaced(self._home, displacement)
        K = np.zeros((6, 6))
        for leg, attachment in zip(legs, self._attachments, strict=True):
            assert leg.stiffness is not None
            E = carried((T @ attachment)[:3, 3] - T[:3, 3])
            K += E.T @ leg.stiffness @ E
            K[3:, 3:] += skew(leg.wrench[:3]) @ -E[:3, 3:]
        unit = np.repeat([1.0, self._length], 3)
        values = np.linalg.eigvalsh(0.5 * (K + K.T) / unit[:, None] / unit)
        stable = all(leg.unstable <= 0 for leg in legs) and bool(values[0] > 0.0)
        return PlatformState(displacement, K, stable, legs)

    def under(self, wrench: Array, start: PlatformState | None = None) -> PlatformState:
        """The free platform under a dead wrench ``(6,)``, N, N mm.

        Raises:
            NoConvergenceError: no equilibrium was found near the start.
        """
        state = start or self.rest
        unit = np.repeat([1.0, self._length], 3)
        size = max(float(np.max(np.abs(wrench / unit))), 1e-6)
        for _ in range(ITERATIONS):
            T = displaced(self._home, state.displacement)
            lacking = wrench.astype(float)
            for leg, attachment in zip(state.legs, self._attachments, strict=True):
                lacking = lacking - carried((T @ attachment)[:3, 3] - T[:3, 3]).T @ leg.wrench
            if np.max(np.abs(lacking / unit)) < TOLERANCE * size:
                return state
            step = np.linalg.solve(state.stiffness, lacking)
            if not np.max(np.abs(step[3:])) < 1.0:
                break
            there = displacement_between(self._home, displaced(T, step))
            state = self._at(there, state)
        raise NoConvergenceError(f"the platform found no balance within {ITERATIONS} steps")

    def _at(self, displacement: Array, near: PlatformState) -> PlatformState:
        T = displaced(self._home, displacement)
        legs = tuple(
            problem.solve_pose(displacement_between(end, T @ attachment), leg)
            for problem, end, attachment, leg in zip(
                self._problems, self._ends, self._attachments, near.legs, strict=True
            )
        )
        return self._state(displacement, legs)

    def critical_force(self, direction: Array, first: float, most: float, tolerance: float = 1e-4) -> float | None:
        """The force along ``direction`` (3,) at which the free platform loses its stability, by bisection.

        Args:
            direction: unit vector, world axes.
            first: smallest force tried, N.
            most: largest.
            tolerance: relative.

        Returns:
            None where it is stable up to the largest force.

        Raises:
            NoConvergenceError: the equilibria are lost before.
        """
        wrench = np.concatenate([np.asarray(direction, dtype=float), np.zeros(3)])
        good, bad, state, step = 0.0, np.inf, self.rest, first
        while good < most and bad - good > tolerance * max(good, first):
            force = min(good + step, most, 0.5 * (good + bad) if np.isfinite(bad) else np.inf)
            try:
                there = self.under(force * wrench, state)
            except (NoConvergenceError, np.linalg.LinAlgError):
                # no sign of instability: try a nearer one
                step = 0.5 * (force - good)
                if step < 0.1 * tolerance * max(good, first):
                    raise NoConvergenceError(f"no equilibrium found beyond {good:.6g} N") from None
                continue
            if there.stable and not self._jumped(state, there, (force - good) * wrench):
                good, state, step = force, there, GROWTH * step
            else:
                bad = force
        return good if np.isfinite(bad) else None

    def _jumped(self, a: PlatformState, b: PlatformState, load: Array) -> bool:
        """Whether a load more took the platform further than its stiffness says: to another branch."""
        unit = np.repeat([1.0, self._length], 3)
        foreseen = np.linalg.norm(unit * np.linalg.solve(a.stiffness, load))
        return bool(np.linalg.norm(unit * (b.displacement - a.displacement)) > JUMPED * foreseen)
