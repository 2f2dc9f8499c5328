"""The load that a joint takes at its motions: springs and backlash in series, friction beside them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.experiment.joint_levers import levers_of, stiffness_of
from vjm_updating.inference.forward import PlainForward, own_effects, values_of
from vjm_updating.inference.instrument import ThermalDrift
from vjm_updating.inference.parameters import Hypothesis, deflects
from vjm_updating.mechanisms.friction_loop import friction_torques
from vjm_updating.mechanisms.series_elements import History, SeriesElement
from vjm_updating.mechanisms.single_joint import JointHardening, JointThreeSlopes, beyond_straight
from vjm_updating.observation.coordinate import Coordinate, Evaluation, instrument_errors

TURNS = numerical(200)
"""Steps at most that find a load: within brackets that are halved, a number of 64 bits takes fewer."""
EXACT = numerical(1e-13)
LAST_DIGIT, SLIPS = numerical(1e-15), numerical(1e-9)
"""Motion, over the largest of a test, by which a load may miss it."""
STIFFEST = numerical(1e9)
"""Times the model's stiffness within which loads are sought at most."""


class JointForward(PlainForward):
    """Predicts loads of one joint; it has no bifurcation."""

    def evaluate(
        self, found: Sequence[Coordinate], z: Array, hypothesis: Hypothesis, beside: Array | None = None
    ) -> Evaluation:
        """Readings against a hypothesis.

        Raises:
            vjm.errors.NoConvergenceError: the laws of its elements bear no load at one of the motions.
        """
        observed = self.observed
        lever, of_motion, of_load = levers_of(observed.measurement)
        errors = instrument_errors(found, z, observed.slots, observed.columns)
        values = values_of(found, z, hypothesis)
        of_pose, of_read = self._drift(hypothesis, values)
        place = errors.true_displacement(observed.pose - of_pose)
        machine = self.machine(found, z, hypothesis)
        moved = of_motion * place[:, 0]
        own = own_effects(found, z, hypothesis)
        history = self._history(lever)
        elements = [element for effect, v in own for element in effect.elements(machine, v)]
        spring, joint = stiffness_of(observed.measurement), observed.measurement.drive
        if joint.law is not None and not any(isinstance(e, JointHardening | JointThreeSlopes) for e in hypothesis):
            # else another law is in its place
            elements.append(beyond_straight(joint.law, joint.name, 1.0 / spring, lever))
        force, slope = _borne(moved, spring, elements, history)
        load, tangent = force.copy(), slope.copy()
        for effect, v in own:
            torque, stuck = self._friction(moved / lever, np.asarray(effect.friction(v)), effect.presliding(v))
            load += torque / lever
            tangent += stuck / lever**2
        stiffness = np.zeros((len(moved), 1, 6))
        stiffness[:, 0, 0] = of_load * tangent * of_motion
        read = of_load * load[:, None]

        def exact(i: int) -> Array | None:
            c = found[i]
            number = int(c.subject) if c.kind == "effect" else -1
            if number < 0 or not deflects(hypothesis[number]):
                return None
            # the force held, a law extends otherwise by its numbers: dN = −K dx
            step = c.difference * max(1.0, abs(z[i]))
            ends, x = (max(z[i] - step, c.low), min(z[i] + step, c.high)), []
            for end in ends:
                there = values_of(found, np.where(np.arange(len(z)) == i, end, z), hypothesis)[number]
                laws = hypothesis[number].elements(machine, there)
                x.append(np.sum([element.law(force, history)[0] for element in laws], axis=0))
            change = (of_load * slope * (x[1] - x[0]) / (ends[1] - ends[0]))[:, None]
            return np.where(observed.present, errors.gain * change, 0.0)

        residual = errors.residual(observed.wrench - of_read, read)
        return Evaluation(z, residual, read, stiffness, place, errors, exact)

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

    def _friction(self, motion: Array, limit: Array, presliding: float) -> tuple[Array, Array]:
        """Load ``(n,)`` that friction takes along a joint's motions ``(n,)``, in its own units, and its slope."""
        n = len(motion)
        if not limit.any():
            return np.zeros(n), np.zeros(n)
        begins = np.zeros(n, dtype=bool)
        begins[:1] = True
        give, rest = np.zeros((n, 1, 1)), np.zeros((n, 1))
        load = -friction_torques(motion[:, None], give, limit, begins, rest, presliding)[:, 0]
        most = float(limit.max())
        stuck = np.abs(load) < most * (1.0 - SLIPS)
        return load, np.where(stuck, most / max(presliding, 1e-300), 0.0)


def _borne(
    moved: Array, stiffness: float, elements: Sequence[SeriesElement], history: History
) -> tuple[Array, Array]:
    """Forces ``(n,)`` at motions ``(n,)`` of a spring with elements in series, and their slopes ``(n,)``.

    The motion grows with the force, so each force has one motion, and Newton's method within brackets finds it.

    Raises:
        NoConvergenceError: the motion does not grow with the force, or no force has it.
    """
    laws = [element.law for element in elements]
    if not laws:
        return stiffness * moved, np.full(len(moved), stiffness)

    def motion(force: Array) -> tuple[Array, Array]:
        x, give = force / stiffness, np.full(len(force), 1.0 / stiffness)
        for law in laws:
            own, slope = law(force, history)
            x, give = x + own, give + slope
        return x, give

    force = stiffness * moved
    low, high = np.full(len(moved), -np.inf), np.full(len(moved), np.inf)
    enough = EXACT * max(float(np.abs(moved).max(initial=0.0)), 1e-300)
    most = STIFFEST * stiffness * max(float(np.abs(moved).max(initial=0.0)), 1e-300)
    for _ in range(TURNS):
        x, give = motion(force)
        if not (np.isfinite(x).all() and (give > 0.0).all()):
            raise NoConvergenceError("a joint's laws deflect against their load")
        gap = moved - x
        low, high = np.where(gap > 0.0, force, low), np.where(gap < 0.0, force, high)
        new = force + gap / give
        inside = (new > low) & (new < high)
        bounded = np.isfinite(low) & np.isfinite(high)
        middle = 0.5 * (np.where(bounded, low, 0.0) + np.where(bounded, high, 0.0))
        new = np.where(gap == 0.0, force, np.where(inside | ~bounded, new, middle))
        if np.abs(new).max(initial=0.0) > most:
            break
        if (np.abs(gap) <= enough).all() or (np.abs(new - force) <= LAST_DIGIT * np.abs(force)).all():
            return force, 1.0 / give
        force = new
    raise NoConvergenceError("a joint's laws bear no load at one of its motions")
