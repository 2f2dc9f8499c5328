"""Limits of a machine's joints, coupled ones among them, and by how much coordinates go beyond them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vjm.model.machine import Machine
from vjm.model.parts import SHORTEST_FREE, Beam, Joint
from vjm.rotations import Array

ROUNDING = 1e-9
"""rad, or of the largest limit in mm: what is beyond by less is at the limit, as solvers stop at 1e-10 of it."""


def said_beyond(name: str, value: float, limits: tuple[float, float], unit: str) -> str:
    """What is wrong with a joint's coordinate; empty where it is within the limits.

    Example:
        >>> said_beyond("elbow", 2.75, (-2.5, 2.5), "rad")
        'elbow = 2.75 exceeds its limit 2.5 by 0.25 rad'
    """
    low, high = limits
    if value < low:
        return f"{name} = {value:.6g} is below its limit {low:.6g} by {low - value:.4g} {unit}"
    if value > high:
        return f"{name} = {value:.6g} exceeds its limit {high:.6g} by {value - high:.4g} {unit}"
    return ""


def beyond_measured(machine: Machine, coordinates: Mapping[str, Array]) -> list[str]:
    """What is said of joints that stand where a calibrated machine was not measured; of each the farthest.

    A turn of a joint that turns brings it to the same posture.

    Args:
        machine: with the ranges in which it is valid.
        coordinates: ``(g,)`` of joints by name, rad or mm; nan where there is none.
    """
    doubts, sliding = [], {joint.name for joint in machine.moving if joint.slides}
    for name, (low, high) in machine.valid_within.items():
        q = np.asarray(coordinates.get(name, ()), dtype=float)
        q = q[np.isfinite(q)]
        if not len(q):
            continue
        middle = 0.5 * (low + high)
        off = q - middle
        if name not in sliding:
            off -= LARGEST_TURN * np.round(off / LARGEST_TURN)
        beyond = np.abs(off) - 0.5 * (high - low)
        k, unit = int(np.argmax(beyond)), "mm" if name in sliding else "rad"
        if beyond[k] > ROUNDING * max(abs(low), abs(high), 1.0):
            doubts.append(
                f"{name} = {q[k]:.4g} {unit} lies {beyond[k]:.3g} {unit} beyond {low:.4g} to {high:.4g}, within "
                "which it was calibrated: nothing tells how good the numbers are there"
            )
    return doubts


NO_BEAMS: Mapping[str, Beam] = {}
LARGEST_TURN = 2.0 * np.pi
"""rad; a coordinate beyond it is taken for degrees. Passive joints turn half as far."""


def said_turned(name: str, value: float, *, passive: bool) -> str:
    """What is said of a turning joint's coordinate that is likely in degrees; empty where it is not."""
    bound, words = (np.pi, "±π") if passive else (LARGEST_TURN, "±2π")
    return f"{name} = {value:.6g} rad is beyond {words}: is it in degrees?" if abs(value) > bound else ""


@dataclass(frozen=True)
class JointLimits:
    """Limits of the k joints of a machine, passive and coupled too, whose coordinates follow from n that are given.

    Attributes:
        names: of the k joints.
        units: ``mm`` or ``rad`` of each.
        share: ``(k, n)`` coordinates of the joints by the given ones.
        offset: ``(k,)`` likewise, mm or rad.
        low: ``(k,)`` lower limits, -inf where there is none.
        high: ``(k,)`` upper limits.
        given: names of the n given coordinates.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    share: Array
    offset: Array
    low: Array
    high: Array
    given: tuple[str, ...]

    def joint_values(self, q: Array) -> Array:
        """Coordinates ``(g, k)`` of the joints at rows ``(g, n)`` of given ones."""
        return q @ self.share.T + self.offset

    def excess(self, q: Array) -> Array:
        """By how much rows ``(g, n)`` go beyond each limit ``(g, k)``, mm or rad; zero or less within."""
        values = self.joint_values(q)
        return np.maximum(values - self.high, self.low - values)

    def kept(self, q: Array) -> np.ndarray:
        """Whether rows ``(g, n)`` keep all limits ``(g,)``, but for rounding."""
        size = np.maximum(np.where(np.isfinite(self.low), np.abs(self.low), 0.0), 1.0)
        size = np.maximum(size, np.where(np.isfinite(self.high), np.abs(self.high), 0.0))
        return np.asarray(np.all(self.excess(q) <= ROUNDING * size, axis=1))

    def said(self, q: Array) -> str:
        """Which joints a row ``(n,)`` puts beyond their limits, and by how much; empty where none is."""
        if self.kept(q[None])[0]:
            return ""
        values = self.joint_values(q[None])[0]
        rows = zip(self.names, values, self.low, self.high, self.units, strict=True)
        return "; ".join(text for n, v, lo, hi, u in rows if (text := said_beyond(n, float(v), (lo, hi), u)))

    def refuse(self, rows: Array) -> None:
        """Refuse rows ``(g, n)`` of given coordinates.

        Raises:
            ValueError: naming the first row and the joints that it puts beyond their limits, and by how much.
        """
        beyond = np.flatnonzero(~self.kept(rows))
        if len(beyond):
            raise ValueError(f"row {beyond[0]} is out of reach: {self.said(rows[beyond[0]])}")

    def check(self, values: Mapping[str, float]) -> None:
        """Refuse coordinates by name, mm or rad.

        Raises:
            ValueError: naming the joints that are beyond their limits, and by how much.
        """
        said = self.said(np.array([values[name] for name in self.given], dtype=float))
        if said:
            raise ValueError(f"out of reach: {said}")


def own_limits(
    joint: Joint, beams: Mapping[str, Beam], pushing: Mapping[str, Beam] = NO_BEAMS
) -> tuple[float, float]:
    """A joint's own limits, and the length of the beam on which it rides, or that it pushes out of its root.

    Args:
        joint: of a machine.
        beams: of the machine by their names.
        pushing: see `Machine.pushing`.
    """
    low, high = joint.limits or (-np.inf, np.inf)
    if joint.name in pushing:
        low, high = max(low, SHORTEST_FREE), min(high, pushing[joint.name].length)
    return (max(low, 0.0), min(high, beams[joint.rides_on].length)) if joint.rides_on else (low, high)


def joint_limits(chain: Machine, given: Sequence[str] = ()) -> JointLimits:
    """The limits of a machine's joints, see `own_limits`.

    Args:
        chain: the machine.
        given: names of the coordinates that are given, in their order; those of all held and passive joints that
            are not coupled, in the order of the parts, where it is empty.

    Example:
        >>> import vjm
        >>> limits = joint_limits(vjm.load("planar-2r"))
        >>> limits.said(np.array([0.0, 2.7]))
        'elbow = 2.7 exceeds its limit 2.6 by 0.1 rad'
    """
    joints = chain.moving
    given = tuple(given) or tuple(joint.name for joint in joints if joint.coupling is None)
    share = {name: np.eye(len(given))[i] for i, name in enumerate(given)}
    offset = dict.fromkeys(given, 0.0)
    for joint in joints:
        if joint.coupling is not None:
            share[joint.name] = joint.coupling.summed(share)
            offset[joint.name] = joint.coupling.value(offset)
    pushing, beams = chain.pushing, {beam.name: beam for beam in chain.beams}
    limits = [own_limits(part, beams, pushing) for part in joints]
    return JointLimits(
        names=tuple(part.name for part in joints),
        units=tuple("mm" if part.slides else "rad" for part in joints),
        share=np.array([share[part.name] for part in joints]).reshape(len(joints), len(given)),
        offset=np.array([offset[part.name] for part in joints]),
        low=np.array([low for low, _ in limits]),
        high=np.array([high for _, high in limits]),
        given=given,
    )
