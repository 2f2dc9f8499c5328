"""Sliders of a machine: what is set by them, and how far they go."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vjm.io.file_parameters import unit_of_key
from vjm.machine.closing import Closing
from vjm.model.joint_limits import joint_limits
from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.rotations import displacement_between

FULL_LOAD = 1e-3
"""Shift of the end over the machine's extent under the largest force of a slider: what a stiff machine works at."""
FULL_DISPLACEMENT = 1e-2
"""Of the characteristic length, and rad: the largest displacement of a slider that holds the end."""
POSE_RANGE = 0.1
"""Of the extent, and rad: how far sliders of a pose go where the file has no workspace."""
SIZE_RANGE = 2.0
"""Factor on a number of the file, up and down, to which its slider goes."""
STEPS = 1000
"""Of a slider, at most."""
FINEST = 1e-5
"""Step of a slider as it is shown: viser's page writes seven digits behind the point."""
LENGTH, TURN = "mm", "rad"


@dataclass(frozen=True)
class Slider:
    """A number that can be set.

    Attributes:
        name: of the joint, the component or the number of the file.
        unit: of it.
        low: smallest value.
        high: largest value.
        value: to begin with.
    """

    name: str
    unit: str
    low: float
    high: float
    value: float

    @property
    def step(self) -> float:
        """A round step of which there are some hundreds; one where the number cannot be changed."""
        return round_number(self.high - self.low) / STEPS if self.high > self.low else 1.0

    @property
    def ends(self) -> tuple[float, float]:
        """The first and last multiple of the step within the limits, further out for the value to begin with."""
        if self.high <= self.low:
            return self.value, self.value
        step = self.step
        low, high = np.ceil(self.low / step - 1e-9) * step, np.floor(self.high / step + 1e-9) * step
        # without the minus of a zero
        return min(float(low) + 0.0, self.value), max(float(high) + 0.0, self.value)

    def readable(self) -> tuple[Slider, float]:
        """The slider with numbers that a page can write: small ones in a unit that has a power of ten.

        Returns:
            The slider, and its unit in that of this one.
        """
        if self.step >= FINEST:
            return self, 1.0
        scale = 10.0 ** float(np.floor(np.log10(max(abs(self.low), abs(self.high)))))
        # a double's last digits would be shown
        low, high, value = (float(f"{number / scale:.12g}") for number in (self.low, self.high, self.value))
        return Slider(self.name, f"{scale:.0e} {self.unit}".strip(), low, high, value), scale


def joint_sliders(machine: Machine, label: str) -> list[Slider]:
    """Sliders of the joints within their limits; of closed loops those of the drives, which the others follow.

    Args:
        machine: any.
        label: of the posture to begin with.
    """
    limits = joint_limits(machine)
    names = [joint.name for joint in machine.held_joints] if machine.closes else list(limits.given)
    stands = dict(machine.held.get(label, {}))
    stands |= dict(zip((joint.name for joint in machine.joints), machine.posture(label).tolist(), strict=True))
    found = []
    for name in names:
        k = limits.names.index(name)
        free = np.pi if limits.units[k] == TURN else machine.characteristic_length
        low, high = float(limits.low[k]), float(limits.high[k])
        low, high = low if np.isfinite(low) else -free, high if np.isfinite(high) else free
        value = float(stands[name])
        found.append(Slider(name, limits.units[k], min(low, value), max(high, value), value))
    return found


def pose_sliders(
    machine: Machine, label: str, closing: Closing, freedom: int, workspace: Mapping[str, Any] | None
) -> list[Slider]:
    """Sliders of the end's displacement from home: of its place, and of its turn where it has all six freedoms.

    Args:
        machine: with closed loops.
        label: of the pose to begin with.
        closing: of its loops.
        freedom: of its end.
        workspace: the file's table, where it has one.
    """
    tree, length = closing.tree, machine.characteristic_length
    there = tree.end_frames(tree.posture(label)[None])[0]
    moved = displacement_between(closing.end, there).tolist()
    found = []
    for k, name in enumerate(COMPONENTS[: 6 if freedom == 6 else 3]):
        full = POSE_RANGE * (tree.length if k < 3 else 1.0)
        low, high = -full, full
        if k < 3 and workspace is not None:
            low, high = float(workspace["min_mm"][k]), float(workspace["max_mm"][k])
        unit = length if k < 3 else 1.0
        # closed loops leave rounding in a pose
        value = round(moved[k] / unit, 9) * unit
        found.append(Slider(name, LENGTH if k < 3 else TURN, min(low, value), max(high, value), value))
    return found


def displacement_sliders(length: float) -> list[Slider]:
    """Sliders of the displacement of an end that is held.

    Args:
        length: characteristic length of the machine, mm.
    """
    size = round_number(FULL_DISPLACEMENT * length)
    return [
        Slider(f"u{name}", LENGTH, -size, size, 0.0)
        if k < 3
        else Slider(name, TURN, -FULL_DISPLACEMENT, FULL_DISPLACEMENT, 0.0)
        for k, name in enumerate(COMPONENTS)
    ]


def force_sliders(smallest_stiffness: float, extent: float, wrench: Sequence[float] | None) -> list[Slider]:
    """Sliders of the wrench on a free end.

    Args:
        smallest_stiffness: smallest stiffness against a force, N/mm.
        extent: of the machine, mm.
        wrench: ``(6,)`` to begin with, N and N mm; zeros if left out.
    """
    start = (0.0,) * 6 if wrench is None else tuple(float(value) for value in wrench)
    force = FULL_LOAD * extent * (smallest_stiffness if np.isfinite(smallest_stiffness) else 1.0)
    force = round_number(max(force, *(abs(value) for value in start[:3])))
    moment = round_number(max(force * extent, *(abs(value) for value in start[3:])))
    return [
        Slider(name, unit, -full, full, value)
        for name, unit, full, value in (
            (f"{kind}{axis}", unit, full, start[3 * turns + k])
            for turns, (kind, unit, full) in enumerate((("f", "N", force), ("m", "N mm", moment)))
            for k, axis in enumerate("xyz")
        )
    ]


def size_slider(key: str, value: float) -> Slider:
    """The slider of a number of a model file, by its key."""
    ends = value / SIZE_RANGE, value * SIZE_RANGE
    return Slider(key, unit_of_key(key), min(ends), max(ends), value)


def round_number(value: float) -> float:
    """The next of 1, 2, 5, 10 … from a positive value on.

    Example:
        >>> round_number(0.03), round_number(200.0)
        (0.05, 200.0)
    """
    decade = 10.0 ** np.floor(np.log10(value))
    return float(next(m * decade for m in (1.0, 2.0, 5.0, 10.0) if m * decade >= value * (1.0 - 1e-9)))
