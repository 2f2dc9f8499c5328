"""Equilibria of a machine along half a ramp of loads: what gauges on it read, and how that changes with every load.

The end-effector is free in some components of its pose and held in the others, as a `vjm.model.load_case.LoadCase`
has it. Equilibria are found at equal steps; between them readings follow the cubic with their values and slopes,
and all else the cubic spline through its values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from vjm.continuation.lumped_problem import LumpedProblem
from vjm.continuation.path import Equilibrium
from vjm.errors import NoConvergenceError
from vjm.model.kinematics import Kinematics
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.mechanism import Mechanism
from vjm.model.springs import Spring
from vjm.rotations import Array, displacement_between, skew, translation
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.modified_chain import AxialSigns, ModifiedChain, bowed, springs_of
from vjm_updating.mechanisms.path_table import HalfRay

NODES = numerical(8)
"""Steps along half a ramp at most, half where it is smooth. Both cubics err by a step's fourth power."""
ALIKE, TINY = numerical(1e-3), numerical(1e-9)
"""Of the largest value, by which one may be off that is found from every second equilibrium: all of them make a
sixteenth of it. And what is nothing beside the largest value of all."""
CORRECTIONS = numerical(4)
"""Steps of Newton's method to a spring's reaction."""
HALVINGS = numerical(6)
"""Of a step at which Newton's method fails."""


@dataclass(frozen=True)
class Gauge:
    """What one channel reads.

    Attributes:
        channel: its column.
        component: of the displacement, 0 to 5.
        body: part that carries the point; empty for the end-effector.
        at: fraction of the part's elastic length.
    """

    channel: str
    component: int
    body: str = ""
    at: float = 1.0


@dataclass(frozen=True)
class LoadedEquilibria:
    """Equilibria at k loads, ``s`` times a direction.

    Attributes:
        s: ``(k,)``, from zero.
        reading: of the gauges ``(k, m)``, mm, rad.
        compliance: its derivative by the load on the end-effector ``(k, m, 6)``.
        carried: derivative of the readings by what the held components are moved ``(k, m, 6)``; zero for free ones.
        wrench: load and support's reaction on the end-effector ``(k, 6)``, N, N mm.
        stiffness: its derivative by what the held components are moved ``(k, 6, 6)``.
        by_beam: of the readings ``(k, m, b)``, by the logarithm of each beam's compliance.
        direction: ``(6,)`` load per unit of s.
    """

    s: Array
    reading: Array
    compliance: Array
    carried: Array
    wrench: Array
    stiffness: Array
    by_beam: Array
    direction: Array

    def at(self, s: Array) -> tuple[Array, ...]:
        """All of them at places ``(n,)``, in the order of the attributes; straight on beyond the end."""
        inside = np.clip(s, 0.0, self.s[-1])
        m = self.reading.shape[1]
        reading = self._reading(inside)
        edges = np.cumsum([m * 6, m * 6, 6, 36])
        parts = np.split(self._others(inside), edges, axis=1)
        n = len(s)
        compliance = parts[0].reshape(n, m, 6)
        reading = reading + (compliance @ self.direction) * (s - inside)[:, None]
        wrench = parts[2] + (s - inside)[:, None] * self.direction
        carried, stiffness = parts[1].reshape(n, m, 6), parts[3].reshape(n, 6, 6)
        return reading, compliance, carried, wrench, stiffness, parts[4].reshape(n, m, -1)

    @property
    def smooth(self) -> bool:
        """Whether every second equilibrium is found from the others, readings and compliance."""
        columns = "s", "reading", "compliance", "carried", "wrench", "stiffness", "by_beam"
        half = replace(self, **{name: getattr(self, name)[::2] for name in columns})
        reading, compliance, *_ = half.at(self.s[1::2])
        return all(
            bool((np.abs(a - b[1::2]) <= ALIKE * np.maximum(np.abs(b).max(axis=0), TINY * np.abs(b).max())).all())
            for a, b in ((reading, self.reading), (compliance, self.compliance))
        )

    @cached_property
    def _reading(self) -> CubicHermiteSpline:
        return CubicHermiteSpline(self.s, self.reading, self.compliance @ self.direction)

    @cached_property
    def _others(self) -> CubicSpline:
        k = len(self.s)
        stacked = (self.compliance, self.carried, self.wrench, self.stiffness, self.by_beam)
        return CubicSpline(self.s, np.hstack([values.reshape(k, -1) for values in stacked]))


def load_table(
    machine: ModifiedChain, half: HalfRay, pulls: bool | AxialSigns, free: Sequence[str], gauges: Sequence[Gauge]
) -> LoadedEquilibria:
    """The stable equilibria of a machine along half a ramp of loads.

    Args:
        machine: under load.
        half: posture, direction of the load and how far it goes, N or N mm.
        pulls: what the load does to each part that differs between pull and push.
        free: components of the end-effector's pose that are free; the others are held.
        gauges: on the machine.

    Raises:
        NoConvergenceError: it does not bear the loads.
        ValueError: what is free makes it a mechanism, or what is held cannot move.
    """
    load = Load(half.direction)
    load_case = LoadCase(
        half.posture, half.reach, "load", free=tuple(free), loads=(load,), gravity=machine.weighing
    )
    model = machine.model(half.posture, pulls)
    bow = bowed(model, half.posture, machine.bow) if machine.bow else None
    if bow is not None:
        # the support's joints come behind the machine's own coordinates, before what closures bear
        bow = np.insert(bow, model.coordinates, np.zeros(_support(model, load_case)))
    problem = LumpedProblem(model, load_case, machine.engine.label, bow)
    held = [k for k, name in enumerate(COMPONENTS) if name not in free]
    # displacements count from the pose without any load, that of its own weight included
    weightless = LumpedProblem(model, replace(load_case, gravity=None), "", bow) if machine.weighing else problem
    start = weightless.unloaded().state
    k = problem.model.kinematics(start[: problem.model.size])
    # gauges of one point share its motion
    places = dict.fromkeys([("", 1.0), *((gauge.body, gauge.at) for gauge in gauges)])
    probes = {place: _Probe(problem.model, k, *model.find(*place)) for place in places}
    own = {where.start: spring for spring, where in problem.model.blocks}
    springs = {
        beam.name: [(own[where.start], where) for where in springs_of(model, beam.name)]
        for beam in model.chain.beams
    }
    rest = problem.unloaded()
    for steps in (NODES // 2, NODES):
        s = np.linspace(0.0, half.reach, steps + 1)
        found, point = [_node(problem, rest, probes, gauges, held, springs)], rest
        for place in s[1:]:
            point = _reached(problem, point, float(place))
            found.append(_node(problem, point, probes, gauges, held, springs))
        reading, by_load, by_pose, wrench, K, by_beam = (np.array(column) for column in zip(*found, strict=True))
        table = LoadedEquilibria(s, reading, by_load, by_pose, wrench, K, by_beam, np.array(half.direction))
        if table.smooth:
            break
    return table


def _support(model: Mechanism, load_case: LoadCase) -> int:
    return LumpedProblem(model, load_case, "").model.size - model.size


class _Probe:
    """A point of the machine: its displacement, and what coordinates do to it."""

    def __init__(self, model: Mechanism, start: Kinematics, joint: int, offset: Array) -> None:
        self.joint, self.offset = joint, translation(offset)
        self.model = model
        self.start = self.frame(start)

    def frame(self, k: Kinematics) -> Array:
        """Where it is ``(4, 4)``."""
        result: Array = k.behind[self.joint + 1] @ self.offset
        return result

    def displacement(self, k: Kinematics) -> Array:
        """From its unloaded place ``(6,)``, mm, rad."""
        return displacement_between(self.start, self.frame(k))

    def jacobian(self, k: Kinematics) -> Array:
        """Velocity and angular velocity ``(6, n)`` by the coordinates' velocities."""
        return self.model.motion(k, self.joint, self.frame(k)[:3, 3])


def _reached(problem: LumpedProblem, point: Equilibrium, to: float) -> Equilibrium:
    """The equilibrium at a load, gone to from one before it by steps that become shorter where they fail."""
    step = to - point.s
    for _ in range(2**HALVINGS):
        try:
            there = problem.solve(min(point.s + step, to), point)
        except NoConvergenceError:
            there = None
        if there is None or there.unstable:
            step *= 0.5
            if step < (to - point.s) / 2**HALVINGS:
                break
            continue
        point = there
        if point.s >= to * (1.0 - 1e-12):
            return point
    raise NoConvergenceError(
        f"posture {problem.load_case.posture}: no stable equilibrium beyond {point.s:.4g} of a load of {to:.4g}"
    )


def _node(
    problem: LumpedProblem,
    point: Equilibrium,
    probes: Mapping[tuple[str, float], _Probe],
    gauges: Sequence[Gauge],
    held: Sequence[int],
    springs: Mapping[str, Sequence[tuple[Spring, slice]]],
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Readings, and what loads, the held components and the beams' compliances do to them, at one equilibrium."""
    at = problem.configuration(point)
    k, compiled = problem.model.kinematics(at.x), problem.model.compiled
    m = len(gauges)
    moved, carried, stiffness = (
        np.zeros((problem.model.size, 6)),
        np.zeros((problem.model.size, 6)),
        np.zeros((6, 6)),
    )
    seen = {place: (probe.displacement(k), probe.jacobian(k)) for place, probe in probes.items()}
    J = seen["", 1.0][1].copy()
    for u, own in seen.values():
        # the rotation vector's rate is the angular velocity but for half their product, and the square of the turn
        own[3:] -= 0.5 * skew(u[3:]) @ own[3:]
    none = np.zeros(problem.model.size)
    for c in range(6):
        moved[:, c] = compiled.response(at.x, at.wrench, J[c], np.zeros(6), at.load)[0]
    for c in held:
        carried[:, c], stiffness[:, c] = compiled.response(at.x, at.wrench, none, np.eye(6)[c], at.load)
    applied = compiled.load_forces(at.x, at.wrench, at.load, compiled.acting(at.x, at.wrench, at.load))
    stress = problem.model.reactions(k, at.wrench) + applied[: problem.model.size]
    softer = np.zeros((problem.model.size, len(springs)))
    for i, own_springs in enumerate(springs.values()):
        # under a larger compliance it deflects as under a larger force
        force = np.zeros(problem.model.size)
        for spring, where in own_springs:
            force[where] = stress[where]
            if problem.model.chain.closes:
                # what loops bear acts on springs, too
                force[where] = _reaction(spring, (at.x - problem.model.natural)[where], force[where])
        softer[:, i] = compiled.response(at.x, at.wrench, force, np.zeros(6), at.load)[0]
    reading, by_load, by_pose, by_beam = (
        np.zeros(m),
        np.zeros((m, 6)),
        np.zeros((m, 6)),
        np.zeros((m, len(springs))),
    )
    for i, gauge in enumerate(gauges):
        u, own = seen[gauge.body, gauge.at]
        reading[i] = u[gauge.component]
        by_load[i], by_pose[i], by_beam[i] = (own[gauge.component] @ by for by in (moved, carried, softer))
    return reading, by_load, by_pose, point.wrench, stiffness, by_beam


def _reaction(spring: Spring, strain: Array, force: Array) -> Array:
    """Of a spring with a strain ``(n,)``, whose law is known the other way round, from a ``force`` near it."""
    for _ in range(CORRECTIONS):
        force = force + np.linalg.solve(spring.compliance(force), strain - spring.strain(force))
    return force
