"""A test of one joint: the causes that it may show, and the load that the joint takes at its motions.

Springs and backlash are in series, friction is beside them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.laws import StrainWave
from vjm.model.machine import Machine
from vjm.model.parts import Joint
from vjm.rotations import Array
from vjm_updating.constants import numerical, physical_bound, prior_scale
from vjm_updating.experiment.comparison import levers_of, stiffness_of
from vjm_updating.inference.forward import Predictor, deflected, drifted, own_effects, values_of
from vjm_updating.inference.parameters import Evaluation, FitParameter, Hypothesis, instrument_errors
from vjm_updating.mechanisms.drives import (
    BEFORE_JOINTS,
    RATIO,
    SOFT,
    ActuatorCompliance,
    ActuatorHardening,
    DriveSite,
    InDrive,
    law_told_by_force,
    wound_up_by_load,
)
from vjm_updating.mechanisms.effect import Effect, Quantity, part_table
from vjm_updating.mechanisms.history_kernels import hardening_deflections
from vjm_updating.mechanisms.hysteresis import friction_torques
from vjm_updating.mechanisms.series_elements import (
    AtJoint,
    ElementSite,
    History,
    SeriesElement,
    by_curve,
    memoryless,
)

SMALLEST_COMPLIANCE = physical_bound(0.05)
"""Share of the model's compliance that a joint has at least: it may be twenty times as stiff as the model says."""
LARGEST_COMPLIANCE = physical_bound(1e3)
"""Times the model's compliance that a joint has at most."""
SHARE = prior_scale(0.02)
"""Friction over the test's largest load that matters."""
WOUND = Quantity("exponent", 0.3, 8.0, 1.0, usual=2.0, spread=0.5, log=True)
"""Of the wind-up, or the load: a cubic has 2; one that stiffens early, or late, half and twice as much."""
BY_LOAD = Quantity("by_load", 0.0, 1.0, 1.0, usual=0.5, spread=0.5)
"""Share of a compliance that changes with the load beside a stiffness that changes with the wind-up."""
STEEPER = Quantity("K2_over_K1", 1.1, 10.0, 1.0, usual=1.37, spread=0.08, log=True)
"""Second slope over the first: 1.25 to 1.55 in a maker's catalogue, half of them within 8 % of 1.37. Of less than
1.1 the first kink would be none, and the second could not be told from it."""
STEEPEST = Quantity("K3_over_K2", 1.0, 10.0, 1.0, usual=1.5, spread=0.12, log=True)
"""Third slope over the second: 1.23 to 1.63 there."""
SECOND_KINK = Quantity("T2_over_T1", 1.1, 30.0, 1.0, usual=3.5, spread=0.1, log=True)
"""Torque of the second kink over that of the first: 2.5 to 3.7 there."""
FIRST_KINK = prior_scale(0.2)
"""Torque of the first kink over the largest of a test, in order of magnitude."""
EARLIEST_KINK = physical_bound(0.05)
"""The same at least: tests do not load a gear to more than twenty times the torque of its first kink."""
ELASTIC = prior_scale(0.02)
"""Presliding over the test's largest motion, in order of magnitude."""


class SpringUnderTest(InDrive):
    """A law of a joint's spring under test, in the place of the model's."""

    @property
    def contains(self) -> tuple[str, ...]:
        """A spring may as well be linear."""
        return (f"{ActuatorCompliance.cause}.{self.part}",)

    @property
    def in_place_of(self) -> str:
        """The joint's spring."""
        return self.part

    def quantities(self) -> tuple[Quantity, ...]:
        """In rad and N mm where the joint turns."""
        return tuple(_told(self.drive, q) if q.name.endswith(SOFT) else self.drive.told(q) for q in self.sliding())


@dataclass(frozen=True)
class JointCompliance(SpringUnderTest, ActuatorCompliance):
    """Of a joint under test: softer or stiffer than the model says."""

    title = "the joint is softer or stiffer than the model says"

    def sliding(self) -> tuple[Quantity, ...]:
        """Beyond what the model has; negative where it is stiffer. A law is so many times as soft."""
        if self.drive.law is not None:
            return (Quantity("factor", SMALLEST_COMPLIANCE, 1.0 + LARGEST_COMPLIANCE, 0.1, neutral=1.0),)
        c = self.drive.compliance
        low, high = (SMALLEST_COMPLIANCE - 1.0) * c, LARGEST_COMPLIANCE * c
        return (Quantity("compliance_mm_per_N", low, high, 0.1 * c, neutral=0.0),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """A tenth softer and stiffer."""
        (own,) = self.quantities()
        return [((own.neutral or 0.0) + sign * own.scale,) for sign in (1.0, -1.0)]


@dataclass(frozen=True)
class JointHardening(SpringUnderTest, ActuatorHardening):
    """Of a joint under test: a wind-up between those of two laws, by a share of the second.

    In the first the load is ``k x (1 + (r − 1)/(m + 1) (x/X)^m)`` at the wind-up x; X is that under the largest
    load. With m = 2 it is the cubic that robots' gears are described by (Kircanski and Goldenberg, Int. J. Robotics
    Research 16 (1997) 214). In the second the tangent compliance changes with the load, as `ActuatorHardening` has
    it. In both the tangent stiffness at the largest load is r times that at none, which is k.
    """

    def sliding(self) -> tuple[Quantity, ...]:
        """The ratio, the whole compliance at no load, the exponent, and the share of the second law."""
        c = self.compliance
        return (
            RATIO,
            Quantity("compliance_mm_per_N", SMALLEST_COMPLIANCE * c, LARGEST_COMPLIANCE * c, 0.1 * c),
            WOUND,
            BY_LOAD,
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Stiffening and softening, of a stiff and of a soft joint."""
        c = self.quantities()[1].scale / 0.1
        return [(r, share * c, WOUND.usual, BY_LOAD.usual) for r in (2.0, 0.6) for share in (1.0, 0.6, 1.7)]

    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """The spring in the place of the model's."""
        r, c, m, by_load = values

        def law(N: Array) -> tuple[Array, Array]:
            share = N / self.force
            by_wind_up, other = hardening_deflections(share, r, m), wound_up_by_load(share, r, m)
            x, slope = ((1.0 - by_load) * a + by_load * b for a, b in zip(by_wind_up, other, strict=True))
            return c * self.force * x - self.compliance * N, c * slope - self.compliance

        return (SeriesElement(place, memoryless(law)),)

    def write(self, document: dict[str, Any], nominal: Machine, values: Sequence[float]) -> None:
        """The joint's compliance is that at no load."""
        own = JointCompliance(self.part, self.drive)
        per = float(self.drive.factors(self.sliding())[1])
        own.write(document, nominal, (values[1] - self.compliance * per,))


@dataclass(frozen=True)
class JointThreeSlopes(SpringUnderTest):
    """Of a joint under test: stiffness K1 up to a torque T1, K2 up to T2, K3 beyond, see `StrainWave`.

    So catalogues of strain wave gears describe them.

    Attributes:
        force: largest force of the test at the lever, N.
        compliance: of the model's spring there, mm/N.
    """

    force: float = 1.0
    compliance: float = 1.0
    part: str = ""
    drive: DriveSite = BEFORE_JOINTS
    cause = "actuator_three_slopes"
    title = "the stiffness has three slopes, as a strain wave gear's"

    def sliding(self) -> tuple[Quantity, ...]:
        """Ratio of the first slopes, whole compliance at no load, ratio of the last, first kink, second over it."""
        c, F = self.compliance, self.force
        return (
            STEEPER,
            Quantity("compliance_mm_per_N", SMALLEST_COMPLIANCE * c, LARGEST_COMPLIANCE * c, 0.1 * c),
            STEEPEST,
            Quantity("T1_N", EARLIEST_KINK * F, F, F, usual=FIRST_KINK * F, spread=1.0, log=True),
            SECOND_KINK,
        )

    def sliding_trials(self) -> Sequence[tuple[float, ...]]:
        """Kinks at small and large loads, of a stiff and of a soft joint."""
        c, F = self.compliance, self.force
        return [(1.4, share * c, 1.4, kink * F, 3.4) for kink in (0.25, 0.1, 0.6) for share in (1.0, 0.6, 1.7)]

    def trials(self) -> Sequence[tuple[float, ...]]:
        """The same in rad and N mm where the joint turns."""
        factors = self.drive.factors(self.sliding())
        return [tuple(float(v) for v in factors * trial) for trial in self.sliding_trials()]

    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """The spring in the place of the model's."""
        return (SeriesElement(place, by_curve(three_slopes(values).curve, less=self.compliance)),)

    def reported(self, values: Sequence[float]) -> dict[str, float]:
        """The numbers that a catalogue gives."""
        law = three_slopes(values)
        keys = StrainWave.keys(slides=not self.drive.turns)
        return {f"{self.cause}.{keys[name]}": value for name, value in law.numbers().items()}

    def write(self, document: dict[str, Any], nominal: Machine, values: Sequence[float]) -> None:
        """As the joint's law, in the place of its compliance; not where that is a 6×6."""
        table = part_table(document, self.part)
        if "compliance" in table:
            return
        for key in ("compliance_rad_per_Nmm", "compliance_mm_per_N", "stiffness_Nmm_per_rad", "stiffness_N_per_mm"):
            table.pop(key, None)
        table["law"] = three_slopes(values).table(slides=not self.drive.turns)


def three_slopes(values: Sequence[float]) -> StrainWave:
    """The law of the parameters of `JointThreeSlopes`."""
    first, c, last, kink, second = map(float, values)
    return StrainWave(K1=1.0 / c, K2=first / c, K3=first * last / c, T1=kink, T2=kink * second)


def _told(drive: DriveSite, own: Quantity) -> Quantity:
    """A compliance in mm/N at the lever as one in rad/(N mm) where the joint turns."""
    per = float(drive.factors((own,))[0])
    name = "compliance_rad_per_Nmm" if drive.turns else own.name
    return Quantity(name, own.low * per, own.high * per, own.scale * per, own.neutral)


@dataclass(frozen=True)
class DriveFriction(Effect):
    """Dry friction in a joint under test: a spring and a slider in series, beside the joint's own spring.

    Attributes:
        largest: load of the test on the joint, N mm, or N where it slides.
        reach: largest motion, rad or mm.
    """

    largest: float = 1.0
    reach: float = 1.0
    slides: bool = False
    part: str = ""
    cause = "joint_friction"
    title = "dry friction in the joint"

    def quantities(self) -> tuple[Quantity, ...]:
        """Torque at which it slips, half the hysteresis; and the elastic motion before."""
        torque, elastic = ("force_N", "presliding_mm") if self.slides else ("torque_Nmm", "presliding_rad")
        usual = ELASTIC * self.reach
        return (
            Quantity(torque, 0.0, 2.0 * self.largest, SHARE * self.largest, neutral=0.0),
            Quantity(elastic, 1e-3 * usual, 50.0 * usual, usual, usual=usual, spread=1.5, log=True),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Little and much, rigid and soft before it slips."""
        usual = ELASTIC * self.reach
        return [(share * self.largest, e * usual) for share in (0.02, 0.1) for e in (0.3, 1.0, 4.0)]

    def friction(self, values: Sequence[float]) -> Array:
        """The torque ``(1,)``."""
        return np.array([values[0]])

    def presliding(self, values: Sequence[float]) -> float:
        """Elastic motion before it slips."""
        return float(values[1])


def drive_of(joint: Joint, *, compliance: float, lever: float, force: float) -> DriveSite:
    """The place of a joint's effects.

    The ``compliance`` is the model's, rad/(N mm) or mm/N. Turns are counted at ``lever`` mm, 1 for what slides,
    where ``force``, N, is the largest of the test.
    """
    c = compliance * lever**2
    return DriveSite(joint.name, joint.name, not joint.slides, lever, c, c, force, law_told_by_force(joint))


TURNS = numerical(200)
"""Steps at most that find a load: within brackets that are halved, a number of 64 bits takes fewer."""
EXACT = numerical(1e-13)
LAST_DIGIT, SLIPS = numerical(1e-15), numerical(1e-9)
"""Motion, over the largest of a test, by which a load may miss it."""
STIFFEST = numerical(1e9)
"""Times the model's stiffness within which loads are sought at most."""


class JointForward(Predictor):
    """Predicts loads of one joint; it has no bifurcation."""

    def evaluate(
        self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis, beside: Array | None = None
    ) -> Evaluation:
        """Readings against a hypothesis.

        Raises:
            vjm.errors.NoConvergenceError: the laws of its elements bear no load at one of the motions.
        """
        observed = self.observed
        lever, of_motion, of_load = levers_of(observed.measurement)
        errors = instrument_errors(unknowns, z, observed.slots, observed.columns)
        values = values_of(unknowns, z, hypothesis)
        of_pose, of_read = drifted(observed, hypothesis, values)
        place = errors.true_displacement(observed.imposed - of_pose)
        machine = self.machine(unknowns, z, hypothesis)
        moved = of_motion * place[:, 0]
        own = own_effects(unknowns, z, hypothesis)
        history = self._history(lever)
        elements = [element for effect, v in own for element in effect.elements(machine, v)]
        spring, joint = stiffness_of(observed.measurement), observed.measurement.drive
        if joint.law is not None and not any(isinstance(e, JointHardening | JointThreeSlopes) for e in hypothesis):
            # else another law is in its place
            beyond = by_curve(joint.law.curve, lever=lever, less=1.0 / spring)
            elements.append(SeriesElement(AtJoint(joint.name, lever), beyond))
        force, slope = _borne(moved, spring, elements, history)
        load, tangent = force.copy(), slope.copy()
        for effect, v in own:
            torque, stuck = self._friction(moved / lever, np.asarray(effect.friction(v)), effect.presliding(v))
            load += torque / lever
            tangent += stuck / lever**2
        stiffness = np.zeros((len(moved), 1, 6))
        stiffness[:, 0, 0] = of_load * tangent * of_motion
        read = of_load * load[:, None]

        def extended(laws: Sequence[SeriesElement]) -> Array:
            return np.sum([element.law(force, history)[0] for element in laws], axis=0)

        def exact(i: int) -> Array | None:
            # the force held, a law extends otherwise by its numbers: dN = −K dx
            more = deflected(unknowns, z, hypothesis, machine, i, extended)
            if more is None:
                return None
            change = (of_load * slope * more[0] / more[1])[:, None]
            return np.where(observed.present, errors.gain * change, 0.0)

        residual = errors.residual(observed.measured - of_read, read)
        return Evaluation(z, residual, read, stiffness, place, errors, exact)

    def _history(self, lever: float) -> History:
        """Readings in one sequence; a unit of the joint's own motion moves a point at the lever."""
        observed = self.observed
        n = len(observed.imposed)
        begins = np.zeros(n, dtype=bool)
        begins[:1] = True
        still = np.zeros((n, 3))
        motion = np.zeros((n, 6))
        motion[:, 0] = lever
        time = np.zeros(n) if observed.clock is None else observed.clock
        return History(
            time, begins, still, still, {}, {observed.measurement.drive.name: motion}, warmth=observed.warmth
        )

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
