"""The readings of a test as calibration and diagnosis take them: arrays in the order of time, rays, noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment import Measurement, Readings
from vjm_updating.experiment.channels import POSE, TEMPERATURE, TIME, WRENCH
from vjm_updating.experiment.rays import Ray, rays
from vjm_updating.experiment.thermometer import smoothed
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.series_elements import History
from vjm_updating.observation.noise import Memory, Noise, memory_of, noise_of
from vjm_updating.observation.ramp_regression import Steady, steady


@dataclass(frozen=True)
class Observed:
    """n readings.

    Attributes:
        measurement: sheet, readings and machine.
        readings: those that are used.
        pose: displacements as steered, or as read where they were not steered steadily ``(n, 6)``.
        wrench: as read ``(n, 6)``; nan where there is no reading, or a wild one.
        noise: of one reading.
        rays: of the readings, by posture and run.
        memory: who precedes whom.
        history: clock, postures, lines of the link, levers of the base.
        clock: s since the first reading ``(n,)``, or None.
        warmth: K above the first reading ``(n,)``, or None.
        slots: index of the displacement that each of its channels is.
        wild: number of samples left out as wild.
        steady: how the displacement was steered; None where it is what was read.
        zeros: bounds of a channel's zero, in its own unit, where readings without load show it.
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
    slots: Mapping[str, int]
    wild: int = 0
    steady: Steady | None = None
    zeros: Mapping[str, tuple[float, float]] = field(default_factory=dict)

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
        return list(self.slots)

    @property
    def pose_noise(self) -> Array:
        """Standard deviation ``(6,)`` of a displacement, what is not known of straight lines aside."""
        moved = 1.0 if self.steady is None else self.steady.moved
        return self.noise.pose * moved**0.5

    def slot(self, channel: str) -> int:
        """Index of a displacement's channel."""
        return self.slots[channel]

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
    if not measurement.chain.beams:
        raise ValueError(
            f"{sheet.file}: [test] model: no link of {measurement.chain.name} bends, and causes in forces are "
            'sought along one: validate calibrate fits its joints, and a sheet of kind = "poses" diagnoses it'
        )
    held = next((n for n in readings.channels if n in sheet.instrument and sheet.instrument[n].held), None)
    if held is not None:
        readings = readings.settled(held)
    usable = np.flatnonzero(~np.isnan(readings.pose).any(axis=1) & ~np.isnan(readings.wrench).all(axis=1))
    readings = readings.only(usable)
    pose, wrench = readings.pose, readings.wrench
    noise = noise_of(measurement)
    time = readings.values.get(TIME)
    clock = None if time is None or np.isnan(time).any() or np.ptp(time) == 0.0 else time - time[0]
    path: Steady | None = None
    driven = [k for k, name in enumerate(POSE) if name in readings.values]
    if sheet.test.control == "displacement" and len(driven) == 1:
        k = driven[0]
        order = readings.row.astype(float) if clock is None else clock
        path = steady(readings.sequence, order, pose[:, k], float(noise.pose[k]), wrench, noise.wrench)
        if path is not None:
            pose = pose.copy()
            pose[:, k] = path.steered(pose[:, k])
    zero = np.array([sheet.instrument[n].zero if n in sheet.instrument else 0.0 for n in POSE])
    groups = np.array([f"{p} {r}" for p, r in zip(readings.posture, readings.run, strict=True)])
    chain = measurement.chain
    sorted_ = rays(groups, pose, np.hypot(noise.pose, zero), chain.characteristic_length)
    own = tuple(Ray(r.posture.rpartition(" ")[0], r.direction, r.measure, r.index) for r in sorted_)
    machine = ModifiedChain(chain, measurement.engine)
    lines = {label: machine.line(label) for label in dict.fromkeys(readings.posture.tolist())}
    levers = {label: machine.lever(label) for label in lines}
    begins = np.ones(len(readings), dtype=bool)
    begins[1:] = readings.posture[1:] != readings.posture[:-1]
    heat = readings.values.get(TEMPERATURE)
    if heat is not None and TEMPERATURE in sheet.instrument:
        heat = smoothed(heat, sheet.instrument[TEMPERATURE].noise)
    warmth = None if heat is None or np.isnan(heat).any() or np.ptp(heat) == 0.0 else heat - heat[0]
    history = History(
        np.zeros(len(readings)) if clock is None else clock,
        begins,
        np.array([lines[label] for label in readings.posture.tolist()]),
        np.array([levers[label] for label in readings.posture.tolist()]) + pose[:, :3],
    )
    return Observed(
        measurement, readings, pose, wrench, noise, own,
        memory_of(readings.sequence, ~np.isnan(wrench)), history, clock, warmth,
        {name: k for k, name in enumerate(POSE) if name in readings.values}, steady=path,
    )  # fmt: skip
