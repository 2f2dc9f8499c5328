"""A virtual test rig: designs of a test, readings with noise, and the two files that a real rig would write.

The truth comes from elsewhere, such as finite elements. What is here knows instruments, not mechanics.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from vjm.io.model_file import load_chain
from vjm.model.machine import Machine
from vjm.rotations import Array

MODEL = "orthoglide-chain"
WRENCH = ("fx_N", "fy_N", "fz_N", "mx_Nmm", "my_Nmm", "mz_Nmm")
POSTURES = {
    "A": (0.0, 0.0, 0.0, 0.0),
    "B": (0.0, np.pi / 6.0, -np.pi / 6.0, 0.0),
    "C": (np.pi / 6.0, 0.0, 0.0, -np.pi / 6.0),
    "D": (np.pi / 6.0, np.pi / 6.0, -np.pi / 6.0, -np.pi / 6.0),
}
"""Passive joint angles in rad."""


@dataclass(frozen=True)
class Known:
    """1-sigma of a channel's reading, constant zero error and scale factor."""

    noise: float
    zero: float
    scale: float


@dataclass(frozen=True)
class Sequence:
    """One unbroken sequence in one posture.

    Attributes:
        posture: label.
        ux: imposed displacements ``(n,)`` mm.
        time: of the readings ``(n,)`` s, increasing; the machine was mounted `REMOUNTING` before the first.
        temperature: ``(n,)`` °C.
    """

    posture: str
    ux: Array
    time: Array
    temperature: Array

    def __len__(self) -> int:
        return len(self.ux)


@dataclass(frozen=True)
class Design:
    """A test before anything is read.

    Attributes:
        seed: it was drawn from.
        kind: in words.
        sequences: in order.
        instruments: by channel, ``ux_mm`` among them.
        link_segments: of the sheet's model.
        foot_segments: likewise; 1 is the lumped foot.
        drive: compliance of the drive that the sheet states, mm/N.
        length: tolerance of the link, mm.
        modulus: of foot and bar, relative.
        autocorrelation: autocorrelation of neighbouring readings.
        quantum: step of the force readings over their noise.
        outliers: share of readings that are outliers.
        missing: share of missed ones.
        thermometer: whether the temperature is read.
        down: direction of the weight that the sheet states.
        side: to which side the column buckles, where it does.
    """

    seed: int
    kind: str
    sequences: tuple[Sequence, ...]
    instruments: dict[str, Known]
    link_segments: int = 12
    foot_segments: int = 8
    drive: float = 0.0
    length: float = 0.2
    modulus: float = 0.02
    autocorrelation: float = 0.5
    quantum: float = 0.0
    outliers: float = 0.0
    missing: float = 0.0
    thermometer: bool = True
    down: tuple[float, float, float] = (0.0, 0.0, -1.0)
    side: float = 1.0
    notes: dict[str, str] = field(default_factory=dict)

    @property
    def channels(self) -> tuple[str, ...]:
        """Wrench channels that are read, in the order of the file."""
        return tuple(name for name in WRENCH if name in self.instruments)

    @cached_property
    def columns(self) -> list[int]:
        """Of the wrench that are read."""
        return [WRENCH.index(name) for name in self.channels]

    def __len__(self) -> int:
        return sum(len(s) for s in self.sequences)

    def chain(self) -> Machine:
        """The machine as the sheet draws it."""
        return load_chain(MODEL).with_actuator_compliance(self.drive)


@dataclass(frozen=True)
class RigResponse:
    """Readings without noise.

    Attributes:
        ux: ``(n,)`` mm.
        forces: ``(n, c)`` N, N mm.
    """

    ux: Array
    forces: Array

    def less(self, other: RigResponse) -> RigResponse:
        """The difference of two."""
        return RigResponse(self.ux - other.ux, self.forces - other.forces)


def read(design: Design, still: RigResponse, rng: np.random.Generator) -> tuple[RigResponse, RigResponse]:
    """Readings as a file has them, NaN where missed; and the same without outliers and missed samples."""
    n, c = still.forces.shape
    sigma = np.array([design.instruments[name].noise for name in design.channels])
    ux = still.ux + design.instruments["ux_mm"].noise * autoregressive_noise(design, 1, rng)[:, 0]
    regular = still.forces + sigma * autoregressive_noise(design, c, rng)
    outlying = rng.random((n, c)) < design.outliers
    forces = regular + outlying * rng.choice([-1.0, 1.0], (n, c)) * rng.uniform(12.0, 60.0, (n, c)) * sigma
    if design.quantum > 0.0:
        step = design.quantum * sigma
        forces, regular = step * np.round(forces / step), step * np.round(regular / step)
    missing = rng.random((n, c)) < design.missing
    return RigResponse(ux, np.where(missing, np.nan, forces)), RigResponse(ux, regular)


def autoregressive_noise(design: Design, channels: int, rng: np.random.Generator) -> Array:
    """Noise ``(n, channels)`` of unit variance, autocorrelated within a sequence, independent between them."""
    rho, blocks = design.autocorrelation, []
    for sequence in design.sequences:
        fresh = rng.standard_normal((len(sequence), channels))
        for k in range(1, len(sequence)):
            fresh[k] = rho * fresh[k - 1] + np.sqrt(1.0 - rho**2) * fresh[k]
        blocks.append(fresh)
    return np.concatenate(blocks)


def sheet_text(design: Design, title: str) -> str:
    """The test sheet."""
    labels = dict.fromkeys(s.posture for s in design.sequences)
    lines = [
        "[test]",
        f'title = "{title}"',
        f'model = "{MODEL}"',
        'control = "displacement"',
        f"gravity = {_list(design.down)}",
        "",
        "[model]",
        f"link_segments = {design.link_segments}",
        f"foot_segments = {design.foot_segments}",
        f"actuator_compliance_mm_per_N = {design.drive!r}",
        "",
        "[postures]",
        *(f"{label} = {_list(POSTURES[label])}" for label in labels),
    ]
    for name, known in design.instruments.items():
        lines += ["", f"[instrument.{name}]", f"noise = {known.noise!r}", f"zero = {known.zero!r}"]
        lines += [f"scale = {known.scale!r}"]
    lines += ["", "[tolerance]", f"link_length_mm = {design.length!r}", f"modulus_rel = {design.modulus!r}"]
    return "\n".join(lines) + "\n"


def data_text(design: Design, ux: Array, forces: Array) -> str:
    """The data file.

    Args:
        design: of the test.
        ux: displacements as read ``(n,)``, nan where missed.
        forces: wrench channels as read ``(n, c)``, nan where missed.
    """
    header = ["time_s", "posture", "ux_mm", *design.channels]
    header += ["temperature_C"] if design.thermometer else []
    lines, row = [",".join(header)], 0
    for sequence in design.sequences:
        for k in range(len(sequence)):
            cells = [f"{sequence.time[k]:.2f}", sequence.posture, _cell(ux[row]), *map(_cell, forces[row])]
            cells += [f"{sequence.temperature[k]:.3f}"] if design.thermometer else []
            lines.append(",".join(cells))
            row += 1
    return "\n".join(lines) + "\n"


def _cell(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.6f}"


def _list(values: tuple[float, ...]) -> str:
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"
