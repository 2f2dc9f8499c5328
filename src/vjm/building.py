"""Machines built in Python: axes, and whole machines of the parts of `vjm.model`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from vjm.model.joint_limits import joint_limits
from vjm.model.machine import Machine
from vjm.model.parts import Closure, Coupling, Part, PointSpring
from vjm.postures import assembled
from vjm.rotations import AXES, Array


def axis(direction: str | Sequence[float]) -> Array:
    """A unit vector ``(3,)``.

    Args:
        direction: ``x``, ``y`` or ``z``, perhaps with a minus, or three numbers of any length.

    Raises:
        ValueError: it is no direction.

    Example:
        >>> import vjm
        >>> vjm.axis("-y").tolist(), vjm.axis((0, 3, 4)).tolist()
        ([-0.0, -1.0, -0.0], [0.0, 0.6, 0.8])
    """
    if isinstance(direction, str):
        name = direction.removeprefix("-")
        if name not in AXES:
            raise ValueError(f"axis '{direction}' is none of x, y, z, -x, -y, -z: write one, or three numbers")
        return AXES[name] * (-1.0 if direction.startswith("-") else 1.0)
    given = np.array(direction, dtype=float)
    length = float(np.linalg.norm(given))
    if given.shape != (3,) or not np.isfinite(length) or not length:
        raise ValueError(f"axis {list(direction)} must be three finite numbers that are not all zero")
    return given / length


def build(
    name: str,
    parts: Sequence[Part],
    postures: Mapping[str, Mapping[str, float]] | None = None,
    *,
    base: Array | None = None,
    after: Mapping[str, str] | None = None,
    closures: Sequence[Closure] = (),
    couplings: Sequence[Coupling] = (),
    point_springs: Sequence[PointSpring] = (),
    ends: Mapping[str, str] | None = None,
    poses: Mapping[str, Sequence[float]] | None = None,
    title: str = "",
) -> Machine:
    """A machine of parts: in series, in branches by ``after``, with its loops closed by ``closures``.

    Args:
        name: of the machine.
        parts: from base to tool: `Beam`, `Joint` and `RigidOffset`. Each begins where the one before it ends.
        postures: coordinates by the joints' names, mm and rad, by the posture's label; a joint that is not named
            stands at zero. All zero, called ``home``, where none is given. Where loops are closed those of passive
            joints are a first guess.
        base: frame ``(4, 4)`` of the first part's root in the world, mm.
        after: name of the part behind which a part begins, where that is not the one before it; empty for the base.
        closures: frames that are held together.
        couplings: of passive joints.
        point_springs: springs between points of two parts.
        ends: end frames by name: the part behind which each lies.
        poses: displacements ``(6,)`` of the end from the first posture by label, of a machine with closures.
        title: one line for people.

    Raises:
        ValueError: a name that is there twice or not at all, a posture beyond a limit, or loops that do not close.

    Example:
        >>> import vjm
        >>> bar = vjm.shape("round_tube", diameter_mm=60.0, wall_mm=3.0).stiffness()
        >>> hip = vjm.Joint("hip", vjm.axis("y"), compliance=1e-7)
        >>> arm = vjm.build("arm", [hip, vjm.Beam("bar", 800.0, section=bar)])
        >>> loaded = vjm.stiffness(arm, wrench=(0, 0, -100, 0, 0, 0))
        >>> round(float(loaded.displacement[2]), 3)
        -6.771
    """
    moved = {label: np.array(pose, dtype=float) for label, pose in (poses or {}).items()}
    machine = Machine(
        name, tuple(parts), np.eye(4) if base is None else base, after=after or {}, closures=tuple(closures),
        couplings=tuple(couplings), point_springs=tuple(point_springs), ends=ends or {}, title=title or name,
        source="built in Python", poses=moved,
    )  # fmt: skip
    passive = [joint.name for joint in machine.joints]
    given = joint_limits(machine).given
    stand: dict[str, Array] = {}
    held: dict[str, dict[str, float]] = {}
    for label, values in (postures or {"home": {}}).items():
        other = next((joint for joint in values if joint not in given), None)
        if other is not None:
            raise ValueError(
                f"{name}: posture '{label}' gives joint '{other}', which has no coordinate to give; it has "
                f"{', '.join(given) or 'none'}"
            )
        q = {joint: float(values.get(joint, 0.0)) for joint in given}
        if not np.all(np.isfinite([*q.values()])):
            raise ValueError(f"{name}: posture '{label}': coordinates must be finite")
        stand[label] = np.array([q[joint] for joint in passive], dtype=float)
        held[label] = {joint: value for joint, value in q.items() if joint not in passive}
    return assembled(replace(machine, postures=stand, held=held))
