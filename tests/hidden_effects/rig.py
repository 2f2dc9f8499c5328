"""A machine on its test rig: what its instruments would read of a design if they had no noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from hidden_effects.machine import TrueMachine
from hidden_effects.virtual_rig import Design, RigResponse, Sequence
from vjm.rotations import Array

Fault = Callable[["Seen"], "Seen"]
"""What an instrument does to what it sees of one sequence."""


@dataclass(frozen=True)
class Seen:
    """One sequence as it happens, and then as it is read.

    Attributes:
        sequence: of the design.
        channels: names of the wrench's columns.
        ux: displacement ``(n,)`` mm.
        forces: ``(n, c)``.
        number: of the sequence in the design.
    """

    sequence: Sequence
    channels: tuple[str, ...]
    ux: Array
    forces: Array
    number: int = 0

    def at(self, channel: str) -> int:
        """Column of a wrench channel."""
        return self.channels.index(channel)


@dataclass(frozen=True)
class Rig:
    """The machine and what reads it.

    Attributes:
        machine: what it does.
        tilt: turn in rad of the imposed displacement towards y and z.
        screw: what the true displacement ``(n,)`` adds to the imposed one.
        faults: of the instruments, in turn.
        softer_per_kelvin: growth of all compliances with the temperature.
    """

    machine: TrueMachine
    tilt: tuple[float, float] = (0.0, 0.0)
    screw: Callable[[Array], Array] | None = None
    faults: tuple[Fault, ...] = field(default=())
    softer_per_kelvin: float = 0.0

    def with_fault(self, fault: Fault) -> Rig:
        """One more fault of an instrument, the last in line."""
        return replace(self, faults=(*self.faults, fault))

    def response(self, design: Design) -> RigResponse:
        """Readings of a design."""
        ux, forces = [], []
        for number, sequence in enumerate(design.sequences):
            seen = Seen(sequence, design.channels, sequence.ux, self._forces(design, sequence), number)
            for fault in self.faults:
                seen = fault(seen)
            ux.append(seen.ux)
            forces.append(seen.forces)
        return RigResponse(np.concatenate(ux), np.concatenate(forces))

    def _wrench(self, sequence: Sequence, poses: Array) -> Array:
        """Wrench ``(n, 6)`` that the machine needs at true displacements ``(n, 6)``."""
        return self.machine.readings(sequence.posture, poses, sequence.time - sequence.time[0] + 1.0)

    def _forces(self, design: Design, sequence: Sequence) -> Array:
        poses = np.zeros((len(sequence), 6))
        travel = sequence.ux if self.screw is None else sequence.ux + self.screw(sequence.ux)
        y, z = self.tilt
        size = float(np.hypot(y, z))
        across = np.sinc(size / np.pi)
        poses[:, 0], poses[:, 1], poses[:, 2] = travel * np.cos(size), travel * y * across, travel * z * across
        wrench = self._wrench(sequence, poses)
        if self.softer_per_kelvin:
            # stiffness falls in proportion at every reading: all parts together, so that only the scale changes
            wrench = wrench / (1.0 + self.softer_per_kelvin * (sequence.temperature - 21.0))[:, None]
        forces: Array = wrench[:, design.columns]
        return forces


def drawn(design: Design) -> Rig:
    """The machine as the sheet draws it, as the sheet's instruments would read it."""
    return Rig(TrueMachine(design.chain(), lumped_foot=design.foot_segments == 1, side=design.side))
