"""The load that a joint takes at its motions: springs and backlash in series, friction beside them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment.joint_levers import levers_of, stiffness_of
from vjm_updating.inference.forward import own_effects, values_of
from vjm_updating.inference.instrument import ThermalDrift
from vjm_updating.inference.parameters import Hypothesis
from vjm_updating.inference.plain_forward import PlainForward
from vjm_updating.mechanisms.friction_loop import friction_torques
from vjm_updating.mechanisms.series_elements import History, balance
from vjm_updating.observation.coordinate import Coordinate, instrument_errors
from vjm_updating.observation.evaluation import Evaluation


class JointForward(PlainForward):
    """Predicts loads of one joint; it has no bifurcation."""

    def evaluate(
        self, found: Sequence[Coordinate], z: Array, hypothesis: Hypothesis, beside: Array | None = None
    ) -> Evaluation:
        """Readings against a hypothesis.

        Raises:
            vjm.errors.NoConvergenceError: the laws of its elements have no balance.
        """
        observed = self.observed
        lever, of_motion, of_load = levers_of(observed.measurement)
        errors = instrument_errors(found, z, observed.slots, observed.columns)
        of_pose, of_read = self._drift(hypothesis, values_of(found, z, hypothesis))
        place = errors.true_displacement(observed.pose - of_pose)
        own = own_effects(found, z, hypothesis)
        machine = self.machine(found, z, hypothesis)
        moved = of_motion * place
        K = np.zeros((6, 6))
        K[0, 0] = stiffness_of(observed.measurement)
        elements = [element for effect, v in own for element in effect.elements(machine, v)]
        tangent = np.broadcast_to(K, (len(moved), 6, 6))
        balanced = balance(lambda u: (u @ K, tangent), moved, elements, self._history(lever))
        load, slope = balanced.wrench[:, 0].copy(), balanced.stiffness[:, 0, 0]
        for effect, v in own:
            load += (
                self._friction(moved[:, 0] / lever, np.asarray(effect.friction(v)), effect.presliding(v)) / lever
            )
        stiffness = np.zeros((len(moved), 1, 6))
        stiffness[:, 0, 0] = of_load * slope * of_motion
        read = of_load * load[:, None]
        return Evaluation(z, errors.residual(observed.wrench - of_read, read), read, stiffness, place, errors)

    def _drift(self, hypothesis: Hypothesis, values: Sequence[Sequence[float]]) -> tuple[Array, Array]:
        """What drift adds to the readings of motions ``(n, 6)`` and of loads ``(n, 1)``."""
        observed = self.observed
        of_pose, of_read = np.zeros_like(observed.pose), np.zeros_like(observed.wrench)
        for effect, v in zip(hypothesis, values, strict=True):
            if isinstance(effect, ThermalDrift):
                target = of_read if effect.part in observed.columns else of_pose
                target[:, 0] += effect.course(observed.warmth, observed.clock, v)
        return of_pose, of_read

    def _history(self, lever: float) -> History:
        """Readings in one sequence; a unit of the joint's own motion moves a point at the lever."""
        observed = self.observed
        n = len(observed.pose)
        begins = np.zeros(n, dtype=bool)
        begins[:1] = True
        still = np.zeros((n, 3))
        motion = np.zeros((n, 6))
        motion[:, 0] = lever
        time = np.zeros(n) if observed.clock is None else observed.clock
        return History(time, begins, still, still, {}, {observed.measurement.drive.name: motion})

    def _friction(self, motion: Array, limit: Array, presliding: float) -> Array:
        """Load ``(n,)`` that friction takes along motions ``(n,)`` of the joint, in its own units."""
        n = len(motion)
        if not limit.any():
            return np.zeros(n)
        begins = np.zeros(n, dtype=bool)
        begins[:1] = True
        give, rest = np.zeros((n, 1, 1)), np.zeros((n, 1))
        result: Array = -friction_torques(motion[:, None], give, limit, begins, rest, presliding)[:, 0]
        return result
