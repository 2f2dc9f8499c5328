"""The readings of a test as a diagnosis takes them: arrays in the order of time, rays, noise, wild samples."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.effects.machine import Machine
from vjm.effects.series import History
from vjm.rotations import Array
from vjm_validation.calibration.noise import Memory, Noise, memory_of, noise_of
from vjm_validation.calibration.rays import Ray, rays
from vjm_validation.measurement import Measurement, Readings
from vjm_validation.measurement.channels import POSE, TEMPERATURE, TIME, WRENCH

SPIKE = 6.0
"""Standard deviations by which a sample must stand out of its neighbours on both sides to count as wild."""


@dataclass(frozen=True)
class Observed:
    """n readings.

    Attributes:
        measurement: sheet, readings and machine.
        readings: those that are used.
        pose: displacements as read ``(n, 6)``.
        wrench: as read ``(n, 6)``; nan where there is no reading, or a wild one.
        noise: of one reading.
        rays: of the readings, by posture and run.
        memory: who precedes whom.
        history: clock, postures, lines of the link.
        clock: s since the first reading ``(n,)``, or None.
        warmth: K above the first reading ``(n,)``, or None.
        wild: number of samples left out as wild.
        steered: column that takes the place of the first displacement, where a point steered the test.
    """

    measurement: Measurement
    readings: Readings
    pose: Array
    wrench: Array
    noise: Noise
    rays: tuple[Ray, ...]
    memory: Memory
    history: History
    clock: Array | None
    warmth: Array | None
    wild: int = 0
    steered: str = ""

    @property
    def present(self) -> np.ndarray:
        """Which samples count ``(n, 6)``."""
        result: np.ndarray = ~np.isnan(self.wrench)
        return result

    @property
    def wrench_channels(self) -> list[str]:
        """Columns of the wrench that were read."""
        return [name for i, name in enumerate(WRENCH) if self.present[:, i].any()]

    @property
    def pose_channels(self) -> list[str]:
        """Columns of the displacement that were read."""
        return [self.steered] if self.steered else [name for name in POSE if name in self.readings.values]

    def slot(self, channel: str) -> int:
        """Index of a displacement's channel."""
        return 0 if channel == self.steered else POSE.index(channel)

    def without(self, wild: np.ndarray) -> Observed:
        """The same with samples ``(n, 6)`` left out."""
        wrench = np.where(wild, np.nan, self.wrench)
        memory = memory_of(self.readings.sequence, ~np.isnan(wrench))
        return replace(self, wrench=wrench, memory=memory, wild=int(wild.sum()))


def observe(measurement: Measurement) -> Observed:
    """What there is to be explained.

    Raises:
        ValueError: no displacement of the end-effector was read.
    """
    readings, sheet = measurement.readings, measurement.sheet
    if not measurement.imposed:
        raise ValueError(
            f"{readings.file}: no displacement of the end-effector was read: add a column such as {POSE[0]}"
        )
    held = next((n for n in readings.channels if n in sheet.instrument and sheet.instrument[n].held), None)
    if held is not None:
        readings = readings.settled(held)
    usable = np.flatnonzero(~np.isnan(readings.pose).any(axis=1) & ~np.isnan(readings.wrench).all(axis=1))
    readings = readings.only(usable)
    pose, wrench = readings.pose, readings.wrench
    noise = noise_of(measurement)
    zero = np.array([sheet.instrument[n].zero if n in sheet.instrument else 0.0 for n in POSE])
    groups = np.array([f"{p} {r}" for p, r in zip(readings.posture, readings.run, strict=True)])
    chain = measurement.chain
    sorted_ = rays(groups, pose, np.hypot(noise.pose, zero), chain.characteristic_length)
    own = tuple(Ray(r.posture.rpartition(" ")[0], r.direction, r.measure, r.index) for r in sorted_)
    machine = Machine(chain, measurement.engine)
    lines = {label: machine.line(label) for label in dict.fromkeys(readings.posture.tolist())}
    begins = np.ones(len(readings), dtype=bool)
    begins[1:] = readings.posture[1:] != readings.posture[:-1]
    time = readings.values.get(TIME)
    clock = None if time is None or np.isnan(time).any() or np.ptp(time) == 0.0 else time - time[0]
    heat = readings.values.get(TEMPERATURE)
    warmth = None if heat is None or np.isnan(heat).any() or np.ptp(heat) == 0.0 else heat - heat[0]
    history = History(
        np.zeros(len(readings)) if clock is None else clock,
        begins,
        np.array([lines[label] for label in readings.posture.tolist()]),
    )
    return Observed(
        measurement, readings, pose, wrench, noise, own,
        memory_of(readings.sequence, ~np.isnan(wrench)), history, clock, warmth,
    )  # fmt: skip


def wild_samples(observed: Observed, residual: Array, factors: Array) -> np.ndarray:
    """Single samples ``(n, 6)`` that stand out of their neighbours, whatever the model gets wrong.

    Each channel is judged by what it is given the others of its reading: an error of the displacement shows in all.

    Args:
        observed: the readings.
        residual: reading minus model ``(n, 6)``.
        factors: inverse Cholesky factors ``(n, 6, 6)`` of the readings' covariances.
    """
    inverse = np.einsum("nki,nkj->nij", factors, factors)
    given = np.einsum("nij,nj->ni", inverse, residual) / np.sqrt(np.einsum("nii->ni", inverse))
    found = np.zeros_like(residual)
    sequence = observed.readings.sequence
    for c in range(6):
        at = np.flatnonzero(observed.present[:, c])
        for number in np.unique(sequence[at]):
            own = at[sequence[at] == number]
            if len(own) < 7:
                continue
            r = given[own, c]
            padded = np.pad(r, 3, mode="reflect")
            n = len(r)
            near = np.stack([padded[k : k + n] for k in (0, 1, 2, 4, 5, 6)])
            off = r - np.median(near, axis=0)
            usual = 1.4826 * float(np.median(np.abs(off)))
            level = SPIKE * max(usual, 1.0)
            # one or two wild ones have better neighbours on both sides, a step has not
            way = np.sign(off)
            left, right = (way * (r - near[k : k + 2]) for k in (1, 3))
            alone = (left.max(axis=0) > 0.7 * level) & (right.max(axis=0) > 0.7 * level)
            found[own, c] = np.where((np.abs(off) > level) & alone, np.abs(off), 0.0)
    # one wild channel spoils what the others are expected to be: of several the worst
    result: np.ndarray = (found > 0.0) & (found == found.max(axis=1, keepdims=True))
    return result
