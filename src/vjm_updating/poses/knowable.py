"""Which members a test can know at all, before anything is fitted.

Functions of a joint's angle: sine and cosine over a part of a turn are polynomials, such as frames, weights and
springs make too, and what they were fitted to says nothing of the rest of the turn. So they are asked where the
postures cover the turn. Compliances are seen by *changes* of the torque: a constant one turns the joint by a
constant angle, which is an offset. Whether one whose torque changes little is needed, what is held out says (see
`vjm_updating.poses.selection.unneeded`). Backlash is asked where the way of approach is no function of the angle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import physical_bound, stated_level
from vjm_updating.poses.document import NotKnownRow
from vjm_updating.poses.families import COMPLIANCE, STRETCH, Member
from vjm_updating.poses.machine import PoseMachine
from vjm_updating.poses.readings import PoseData

WORST_OVER_MEAN = stated_level(9.0)
"""Variance of a once-a-turn error at the worst angle of the turn over its mean at the angles measured: three
standard deviations there for one here. An even half turn has 9.7, six tenths of a turn 4.7, a whole one 1."""
NO_TORQUE = physical_bound(1e-3, "N mm")
"""N mm: change of a torque below which it is none. The most compliant that is built turns by 1e-8 rad under it."""
EXPANDS = physical_bound(2.4e-5, "1/K")
"""1/K, of aluminium: the largest of what links are made of."""
MOST_IMITATED = stated_level(0.75)
"""Share of the way of approach that a cubic of the joint's angle makes: beyond it a standard error doubles."""
TURNED = ("gear_error", "encoder_scale")
"""Families of functions of a joint's angle."""


def knowable(
    members: Sequence[Member], machine: PoseMachine, data: PoseData, torque: Array
) -> tuple[list[Member], tuple[NotKnownRow, ...]]:
    """The members that the data can know, and the others with the reason.

    Args:
        members: all.
        machine: the robot.
        data: its postures.
        torque: ``(n_tree,)`` standard deviation over the postures of what each coordinate bears, N mm or N.
    """
    reasons = [_reason(member, machine, data, torque) for member in members]
    asked = [member for member, reason in zip(members, reasons, strict=True) if not reason]
    of_part = {(member.family, member.subject) for member in asked}
    others: dict[str, NotKnownRow] = {}
    for member, reason in zip(members, reasons, strict=True):
        if reason:
            whole = (member.family, member.subject) not in of_part and bool(member.subject)
            name = f"{member.family}.{member.subject}" if whole else member.name
            others.setdefault(name, NotKnownRow(name=name, reason=reason))
    return asked, tuple(others.values())


def _reason(member: Member, machine: PoseMachine, data: PoseData, torque: Array) -> str:
    """Why a member cannot be known; empty where it can."""
    if member.kind == COMPLIANCE and _moment(member, torque, machine.tree.reach) < NO_TORQUE:
        return "its torque does not change over the postures"
    if member.family in TURNED:
        q = data.q[:, machine.joints.index(member.subject)]
        worst = worst_over_mean(q)
        if worst > WORST_OVER_MEAN:
            far = f"{worst:.0f}" if worst < 1e3 else "a thousand or more"
            return (
                f"its angles, {np.ptp(q):.3g} rad, cover too little of a turn. The variance at the worst angle of "
                f"the turn is {far} times the mean, at most {WORST_OVER_MEAN:.0f}"
            )
    if member.family == "approach" and member.basis is not None:
        q = data.q[:, machine.joints.index(member.subject)]
        if _imitated(q, member.basis) > MOST_IMITATED:
            return "it came to most angles from one side only"
    if member.kind == STRETCH and member.basis is not None:
        noise = float(np.median(data.sigma[np.isfinite(data.position)]))
        if EXPANDS * float(np.ptp(member.basis)) * machine.tree.reach < noise:
            by = np.ptp(member.basis)
            return f"the temperature changes by {by:.2g} K, by which aluminium stretches less than the noise"
    return ""


def _moment(member: Member, torque: Array, reach: float) -> float:
    """Change of the torque that a spring bears, N mm; a sliding one's force at the machine's reach."""
    return float(torque[member.index]) * (reach if member.unit == "mm/N" else 1.0)


def worst_over_mean(q: Array) -> float:
    """Variance of a constant with a sine and a cosine at the worst angle of the turn over its mean at angles q.

    Args:
        q: ``(g,)`` rad.
    """
    A, turn = (_wave(x) for x in (q, np.linspace(-np.pi, np.pi, 361)))
    M = A.T @ A / len(q)
    if np.linalg.cond(M) > 1e12:
        return np.inf
    return float(np.einsum("ij,jk,ik->i", turn, np.linalg.inv(M), turn).max()) / 3.0


def _wave(q: Array) -> Array:
    return np.column_stack([np.ones_like(q), np.sin(q), np.cos(q)])


def _imitated(q: Array, way: Array) -> float:
    """Share of the way of approach ``(g,)`` that a cubic of the angle makes."""
    if not np.ptp(q) > 0.0:
        return 1.0
    A = np.polynomial.legendre.legvander(2.0 * (q - q.min()) / np.ptp(q) - 1.0, 3)
    left = way - A @ np.linalg.lstsq(A, way, rcond=None)[0]
    total = way - way.mean()
    return 1.0 - float(left @ left) / max(float(total @ total), 1e-12)
