"""Causes whose force depends on the history of the displacement: dry friction, creep, a permanent set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.model.machine import FOOT
from vjm.rotations import Array
from vjm_updating.constants import numerical, prior_scale
from vjm_updating.mechanisms.drives import BEFORE_JOINTS, DriveSite, InDrive, drives
from vjm_updating.mechanisms.effect import Effect, ExperimentContext, Quantity, along_link, foot, has_joint
from vjm_updating.mechanisms.history_kernels import friction_along
from vjm_updating.mechanisms.modified_chain import LINK, ModifiedMachine, foot_of, link_of, links_of, place_of
from vjm_updating.mechanisms.relaxation import Relaxation
from vjm_updating.mechanisms.series_elements import ElementSite, SeriesElement, retarded, together, yielding

SWEEPS = numerical(60)
"""Of the projected Gauss-Seidel iteration."""
ENOUGH = numerical(1e-9)
"""Change of a torque over the largest at which it ends."""


def friction_torques(
    free: Array, give: Array, limit: Array | float, begins: np.ndarray, rest: Array, presliding: float = 0.0
) -> Array:
    """Torques ``(n, n_q)`` of the joints' friction on the chain along a history.

    Joint coordinates are ``free`` (n, n_q) without friction, and ``rest`` (n, n_q) in the unloaded posture, where
    no joint bears a torque. ``give`` is A (n, n_q, n_q), ``limit`` is μ (n_q,) or one for all, N mm, ``presliding``
    is δ, a joint's elastic turn when it begins to slip, rad. A posture ``begins`` (n,), and with it the history.
    """
    limits = np.maximum(np.broadcast_to(np.asarray(limit, dtype=float), free.shape[1:]), 0.0)
    if not limits.any():
        return np.zeros_like(free)
    # a joint without friction never sticks
    elastic = np.divide(presliding, limits, out=np.zeros_like(limits), where=limits > 0.0)
    softer = np.ascontiguousarray(give + np.diag(elastic))
    return friction_along(
        np.ascontiguousarray(free), softer, np.ascontiguousarray(limits), begins, np.ascontiguousarray(rest),
        SWEEPS, ENOUGH,
    )  # fmt: skip


@dataclass(frozen=True)
class JointFriction(Effect):
    """Coulomb's law with a torque for every joint, behind a spring; see `vjm_updating.mechanisms.hysteresis`."""

    joints: int = 1
    cause = "joint_friction"
    title = "dry friction in the passive joints"

    def quantities(self) -> tuple[Quantity, ...]:
        """Mean torque at which a joint slips, each joint's over it, and the elastic turn before it slips.

        Like joints are alike, not equal. Contacts of metal part by some 2 to 5 micrometres before they slip
        (Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30 (1994) 1083). At the 10 to 20 mm of a
        bearing's radius that is 0.1 to 0.5 mrad. The spread has room for softer ones, and for rolling bearings.
        """
        shares = (
            Quantity(f"share_of_joint_{k}", 0.05, 20.0, 1.0, usual=1.0, spread=0.3, log=True)
            for k in range(1, self.joints + 1)
        )
        elastic = Quantity("presliding_rad", 1e-6, 1e-2, 2e-4, usual=2e-4, spread=1.0, log=True)
        return (Quantity("torque_Nmm", 0.0, 1e6, 200.0, neutral=0.0), *shares, elastic)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """So small that all joints turn, and larger."""
        return [(torque, *(1.0,) * self.joints, 2e-4) for torque in (100.0, 800.0, 5000.0)]

    def friction(self, values: Sequence[float]) -> Array:
        """The torques."""
        return values[0] * np.array(values[1:-1])

    def presliding(self, values: Sequence[float]) -> float:
        """One elastic turn for all joints."""
        return values[-1]

    def reported(self, values: Sequence[float]) -> dict[str, float]:
        """The mean torque of the joints, each joint's over it, and the elastic turn."""
        torque, *shares, elastic = values
        mean = float(np.mean(shares))
        own = {f"{self.cause}.share_of_joint_{k}": s / mean for k, s in enumerate(shares, start=1)}
        return {f"{self.cause}.torque_Nmm": torque * mean} | own | {f"{self.cause}.presliding_rad": elastic}


def joint_friction_effects(scene: ExperimentContext) -> list[Effect]:
    """Where there are joints."""
    return [JointFriction(joints=len(scene.chain.joints))] if scene.chain.joints else []


LATER, DECADE = prior_scale(10.0), prior_scale(2.3)
"""Time of the slow term over that of the fast one, and the spread of its logarithm: materials relax over decades of
time, of which one lies between the terms, give or take another."""


@dataclass(frozen=True)
class Creep(Effect):
    """A share φ of the part's stiffness relaxes; at first it is nominal, in the end ``(1 − φ)`` of that.

    Its compliance then gains ``φ/(1 − φ)``, delayed by ``τ/(1 − φ)`` for a relaxation time τ; a
    part of it comes later (a Prony series of two terms, Findley, Lai and Onaran 1976, chapter 5).

    Attributes:
        part: ``actuator``, ``foot`` or ``link``; the link's name where there are several, or a joint's.
        compliance: of the drive's spring in the model, mm/N.
        duration: of the test, s.
        interval: between readings, s.
        beam: the part's name in the chain; empty: that of the foot, or of the last link.
        drive: which, where the part is the drive before all passive joints or one in a joint.
    """

    part: str = "foot"
    compliance: float = 0.0
    duration: float = 100.0
    interval: float = 1.0
    beam: str = ""
    drive: DriveSite = BEFORE_JOINTS
    cause = "creep"
    title = "the force relaxes while the displacement is held"

    @property
    def _is_drive(self) -> bool:
        return self.part == "actuator" or bool(self.drive.joint)

    def quantities(self) -> tuple[Quantity, ...]:
        """φ, τ, how much of φ is late, and how many times as late."""
        shortest, longest = 0.1 * self.interval, 10.0 * self.duration
        # materials relax in all decades of time; a test shows those between a reading's and its own
        middle = (self.duration * self.interval) ** 0.5
        spread = np.log(max(self.duration / self.interval, 10.0)) / 12.0**0.5
        return (
            Quantity("fraction", 0.0, 0.9, 0.01, neutral=0.0),
            Quantity("time_s", shortest, longest, middle, usual=middle, spread=float(spread), log=True),
            Quantity("slow_share", 0.0, 0.95, 0.1, usual=0.25, spread=0.25),
            Quantity("slow_over_fast", 2.0, 1000.0, LATER, usual=LATER, spread=DECADE, log=True),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Fast to slow."""
        times = (3.0 * self.interval, (self.duration * self.interval) ** 0.5, self.duration / 8.0, self.duration)
        return [(0.03, time, 0.25, LATER) for time in times]

    def elements(self, machine: ModifiedMachine, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """The drive's, of two terms behind its own spring: a spring on an axis, so that this is exact."""
        if not self._is_drive:
            return ()
        fraction, time, slow, later = values
        gain = self.compliance * fraction / (1.0 - fraction)
        delay = time / (1.0 - fraction)
        terms = together(retarded((1.0 - slow) * gain, delay), retarded(slow * gain, later * delay))
        return (SeriesElement(self.drive.place(machine), terms, smooth=True),)

    def relaxation(self, machine: ModifiedMachine, values: Sequence[float]) -> Relaxation | None:
        """A beam's, which bends as well."""
        if self._is_drive:
            return None
        fraction, time, slow, later = values
        part = self.beam or (FOOT if self.part == "foot" else link_of(machine.nominal))
        return Relaxation(part, ((1.0 - slow) * fraction, slow * fraction), (time, later * time))


def creep_effects(scene: ExperimentContext) -> list[Effect]:
    """In each drive that is elastic, and in each beam, where there is a clock."""
    if scene.duration <= 0.0 or scene.interval <= 0.0:
        return []
    clock = scene.duration, scene.interval
    elastic = [own for own in drives(scene) if own.compliance > 0.0]
    effects: list[Effect] = [Creep(own.part or "actuator", own.compliance, *clock, drive=own) for own in elastic]
    effects += [Creep("foot", 0.0, *clock)] if foot_of(scene.chain) else []
    links = links_of(scene.chain)
    return [*effects, *(Creep(place_of(scene.chain, name) or LINK, 0.0, *clock, name) for name in links)]


@dataclass(frozen=True)
class Plasticity(InDrive):
    """Slip with linear hardening once the force is beyond the yield force, and more of it later on.

    Two slip elements (Iwan 1967) make the yield gradual; hardening is partly isotropic, partly kinematic.

    Attributes:
        part: ``actuator``, ``foot``, or ``joints`` along the only link, ``link`` where it has none; the link's name
            where there are several, or a joint's.
        force: largest of the test, N.
        link: name of the link along which it slips; empty: the only one.
        drive: which, where the part is the drive before all passive joints or one in a joint.
    """

    part: str = "foot"
    force: float = 1000.0
    link: str = ""
    drive: DriveSite = BEFORE_JOINTS
    cause = "plasticity"
    title = "a permanent set after a yield load"

    def sliding(self) -> tuple[Quantity, ...]:
        """Axial force at first yield, the plastic compliance in the end, and shapes.

        The compliance of the foot is over its elastic one. Shapes: how much of it comes half-way from first yield
        to the largest force, and how much of the hardening is isotropic.
        """
        name, most, size = ("softness", 20.0, 0.05) if self.part == "foot" else ("softness_mm_per_N", 1e-1, 1e-5)
        return (
            Quantity("yield_N", 0.01 * self.force, 1.2 * self.force, 0.1 * self.force),
            Quantity(name, 0.0, most, size, neutral=0.0),
            Quantity("late_share", 0.0, 0.95, 0.1, usual=0.3, spread=0.25),
            Quantity("isotropic_share", 0.0, 1.0, 0.1, usual=0.5, spread=0.4),
        )

    def sliding_trials(self) -> Sequence[tuple[float, ...]]:
        """Early and late yield."""
        soft = 0.1 if self.part == "foot" else 2e-5
        return [(share * self.force, soft, 0.3, 0.5) for share in (0.3, 0.5, 0.7, 0.85)]

    def sliding_elements(self, place: ElementSite, values: Sequence[float]) -> tuple[SeriesElement, ...]:
        """One element with that law."""
        limit, soft, late, grows = values
        soft = max(soft, 1e-12)
        slips = together(
            yielding(limit, (1.0 - late) * soft, grows),
            yielding(0.5 * (limit + max(self.force, limit)), max(late, 1e-6) * soft, grows),
        )
        return (SeriesElement(place, slips),)

    def site(self, machine: ModifiedMachine) -> ElementSite:
        """Where it slips."""
        if self.part == "actuator" or self.drive.joint:
            return self.drive.place(machine)
        return foot(machine) if self.part == "foot" else along_link(machine, self.link)


def plasticity_effects(scene: ExperimentContext) -> list[Effect]:
    """In drives and foot, and along each link or in its joints."""
    effects: list[Effect] = [Plasticity(own.part or "actuator", own.force, drive=own) for own in drives(scene)]
    effects += [Plasticity("foot", scene.force)] if foot_of(scene.chain) else []
    places = scene.places(jointed=False)
    only = "joints" if places and has_joint(scene.chain, link_of(scene.chain)) else LINK
    return [*effects, *(Plasticity(part or only, scene.force, link) for part, link in places)]
