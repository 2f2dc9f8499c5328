"""The readings of a test as calibration and diagnosis take them: arrays in the order of time, rays, noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from vjm.rotations import Array
from vjm_updating.experiment import Kind, Measurement, Readings
from vjm_updating.experiment.channels import POSE, TEMPERATURE, TIME, WRENCH, unit_of
from vjm_updating.experiment.comparison import Ray, gauges_of, imposed_loads, rays
from vjm_updating.experiment.implausible_rows import rounded
from vjm_updating.experiment.joint_levers import OfJoint, channels_of
from vjm_updating.experiment.thermometer import smoothed
from vjm_updating.mechanisms.joint_motions import motions_of_readings
from vjm_updating.mechanisms.modified_chain import ModifiedChain, links_of
from vjm_updating.mechanisms.series_elements import History
from vjm_updating.observation.noise import (
    AutoregressiveNoise,
    Noise,
    noise_of,
    rounding_step,
    uncorrelated_noise,
)
from vjm_updating.observation.ramp_regression import RampRegression, steadiest

SCORED = ("N", "mm", "Nmm", "rad")
"""Units of channels, those first whose errors say most of a machine."""


@dataclass(frozen=True)
class Observed:
    """n readings of m channels against what was imposed.

    Of a ramp displacements are imposed and the wrench is read; of a test by force it is the reverse.

    Attributes:
        measurement: sheet, readings and machine.
        readings: those that are used.
        pose: displacements ``(n, 6)``, mm, rad: as read, or where they are `straightened` as commanded; of a test
            by force the loads, N, N mm.
        wrench: as read ``(n, m)``, N, N mm; nan where there is no reading, or an outlier; of a test by force the
            displacements, mm, rad.
        noise: of one reading.
        rays: of the readings, by posture and run.
        clock: s since the first reading ``(n,)``, or None.
        warmth: K above the first reading ``(n,)``, or None.
        slots: index of the displacement that each of its channels is; of a test by force, of the load.
        columns: names of the m channels of ``wrench``.
        outliers: number of samples left out as outliers.
        steady: how displacements were commanded, by their index among the six; of others what was read.
        zeros: bounds of a channel's zero, in its own unit, where readings without load show it.
    """

    measurement: Measurement
    readings: Readings
    pose: Array
    wrench: Array
    noise: Noise
    rays: tuple[Ray, ...]
    clock: Array | None
    warmth: Array | None
    slots: Mapping[str, int]
    columns: tuple[str, ...] = WRENCH
    outliers: int = 0
    steady: Mapping[int, RampRegression] = field(default_factory=dict)
    zeros: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def present(self) -> np.ndarray:
        """Which samples count ``(n, m)``."""
        result: np.ndarray = ~np.isnan(self.wrench)
        return result

    @property
    def wrench_channels(self) -> list[str]:
        """Columns of ``wrench`` that were read."""
        return [name for i, name in enumerate(self.columns) if self.present[:, i].any()]

    @property
    def scored(self) -> tuple[list[int], str]:
        """Channels whose errors are told in one number, and their unit: those read of the first of `SCORED`."""
        read = {name: unit_of(name) for name in self.wrench_channels}
        unit = next(unit for unit in SCORED if unit in read.values())
        return [i for i, name in enumerate(self.columns) if read.get(name) == unit], unit

    @property
    def pose_channels(self) -> list[str]:
        """Columns of the displacement that were read."""
        return list(self.slots)

    @property
    def pose_noise(self) -> Array:
        """Standard deviation ``(n, 6)`` of each displacement, what is not known of straight lines aside."""
        result = np.tile(self.noise.pose, (len(self.pose), 1))
        for k, own in self.steady.items():
            result[:, k] *= np.sqrt(own.moved)
        return result

    @cached_property
    def autoregression(self) -> AutoregressiveNoise:
        """Who precedes whom; no autocorrelation yet."""
        return uncorrelated_noise(self.readings.sequence, self.present)

    @cached_property
    def history(self) -> History:
        """Clock, postures, lines of links, levers of the base, motions by joints; for chains of links that bend."""
        machine = ModifiedChain(self.measurement.chain, self.measurement.engine)
        labels = self.readings.posture.tolist()
        places = {label: (machine.line(label), machine.lever(label)) for label in dict.fromkeys(labels)}
        lines = {
            link: np.array([own[label] for label in labels])
            for link in links_of(machine.nominal)
            for own in [{label: machine.line(label, link) for label in places}]
        }
        rays = [
            (ray.posture, ray.direction, ray.measure, ray.index, self.pose[ray.index] @ ray.measure)
            for ray in self.rays
        ]
        begins = np.ones(len(labels), dtype=bool)
        begins[1:] = self.readings.posture[1:] != self.readings.posture[:-1]
        return History(
            np.zeros(len(labels)) if self.clock is None else self.clock,
            begins,
            np.array([places[label][0] for label in labels]),
            np.array([places[label][1] for label in labels]) + self.pose[:, :3],
            lines,
            *motions_of_readings(machine, labels, rays),
        )

    def without(self, outliers: np.ndarray) -> Observed:
        """The same with samples ``(n, 6)`` left out."""
        return replace(self, wrench=np.where(outliers, np.nan, self.wrench), outliers=int(outliers.sum()))


def observe(measurement: Measurement) -> Observed:
    """Readings that have a displacement and a wrench: of a channel whose rows carry a mark, what settled there.

    Raises:
        ValueError: no displacement of the end-effector was read, a channel has no noise, or the displacements lie
            on no rays.
    """
    readings, sheet = measurement.readings, measurement.sheet
    if not measurement.imposed:
        raise ValueError(
            f"{readings.file}: no displacement of the end-effector was read: add a column such as {POSE[0]} beside "
            "the forces. Without one only `validate diagnose` takes a test, of a column that its middle controls"
        )
    held = next((name for name in readings.channels if sheet.errors(name).held), None)
    if held is not None:
        readings = readings.settled(held)
    pose, wrench = readings.pose, readings.wrench
    usable = np.flatnonzero(~np.isnan(pose).any(axis=1) & ~np.isnan(wrench).all(axis=1))
    readings, pose, wrench = readings.only(usable), pose[usable], wrench[usable]
    noise = noise_of(measurement)
    heat = temperature_of(measurement, readings)
    return Observed(
        measurement, readings, pose, wrench, noise, _rays(measurement, readings, pose, noise),
        since_first(readings.values.get(TIME)), since_first(heat),
        {name: k for k, name in enumerate(POSE) if name in readings.values},
    )  # fmt: skip


def straightened(observed: Observed) -> Observed:
    """The same with straight lines in place of what a gauge read, where a test went steadily.

    The lines are straight in time or over the order of the readings.

    See `vjm_updating.observation.ramp_regression`. Others stay as they are: controlled by force, with several
    displacements that were read (`vjm_updating.observation.idle_axes` is for these), or by a drive that does not go
    straight.
    """
    driven = list(observed.slots.values())
    if observed.measurement.sheet.test.control != "displacement" or len(driven) != 1:
        return observed
    readings, noise, pose, k = observed.readings, observed.noise, observed.pose, driven[0]
    times = [readings.row.astype(float)] if observed.clock is None else [observed.clock, readings.row.astype(float)]
    path = steadiest(readings.sequence, times, pose[:, k], float(noise.pose[k]), observed.wrench, noise.wrench)
    if path is None:
        return observed
    return commanded(observed, {k: path})


def commanded(observed: Observed, steady: Mapping[int, RampRegression]) -> Observed:
    """The same with displacements, by their index, as they were commanded, and the rays of those."""
    pose = observed.pose.copy()
    for k, path in steady.items():
        pose[:, k] = path.regressed(pose[:, k])
    found = _rays(observed.measurement, observed.readings, pose, observed.noise)
    return replace(observed, pose=pose, rays=found, steady=dict(steady))


def planned(observed: Observed, posture: str, axis: Array, ramp: Array) -> Observed:
    """Readings to be taken in one posture, in one sequence, with the instruments of the test at hand.

    Forces are zero where a channel was read. There is no clock, and displacements are as read.

    Args:
        observed: the test at hand.
        posture: label.
        axis: ``(6,)`` displacement per unit of the ramp; one component is 1.
        ramp: at each reading ``(n,)``, mm or rad.
    """
    n = len(ramp)
    pose = ramp[:, None] * axis
    values = {name: pose[:, k] for name, k in observed.slots.items()}
    return replace(
        observed,
        readings=Readings("next", np.arange(n), np.full(n, posture), np.ones(n, dtype=int), values),
        pose=pose,
        wrench=np.where(observed.present.any(axis=0), 0.0, np.nan) * np.ones((n, 1)),
        rays=(Ray(posture, axis, axis, np.arange(n)),),
        clock=None,
        warmth=None,
        outliers=0,
        steady={},
    )


def _rays(measurement: Measurement, readings: Readings, pose: Array, noise: Noise) -> tuple[Ray, ...]:
    """Rays by posture and run: repeats may leave a bifurcation on different sides."""
    sigma = {n.subject: n.sigma for n in measurement.nuisances if n.kind is Kind.ZERO}
    zero = np.array([sigma.get(name, 0.0) for name in POSE])
    groups = np.array([f"{p} {r}" for p, r in zip(readings.posture, readings.run, strict=True)])
    found = rays(groups, pose, np.hypot(noise.pose, zero), measurement.chain.characteristic_length)
    return tuple(Ray(r.posture.rpartition(" ")[0], r.direction, r.measure, r.index) for r in found)


def temperature_of(measurement: Measurement, readings: Readings) -> Array | None:
    """Temperatures ``(n,)`` of some readings without the thermometer's noise, °C; None where none were read."""
    heat = readings.values.get(TEMPERATURE)
    return None if heat is None else smoothed(heat, measurement.sheet.errors(TEMPERATURE).noise)


def since_first(values: Array | None) -> Array | None:
    """What a column ``(n,)`` gained since its first reading; None where it has gaps or does not change."""
    return None if values is None or np.isnan(values).any() or np.ptp(values) == 0.0 else values - values[0]


# --- Readings of a test of one joint: its turn or shift is what was imposed, its load what was read ---------------
#
# Errors of both are in the covariance, so that it does not matter which of the two was imposed.


def observe_joint(measurement: Measurement) -> Observed:
    """Readings that have a motion and a load.

    Raises:
        ValueError: the load's channel has no noise.
    """
    readings = measurement.readings
    motion, effort = channels_of(measurement)
    usable = np.flatnonzero(~np.isnan(readings.values[motion]) & ~np.isnan(readings.values[effort]))
    readings = readings.only(usable)
    pose = np.zeros((len(readings), 6))
    pose[:, 0] = readings.values[motion]
    x = np.eye(6)[0]
    # weights are set in steps, whichever of the two a test is said to impose
    step = rounding_step(readings.values[effort])
    stepped = "" if rounded(OfJoint(measurement), effort, step) else effort
    return Observed(
        measurement,
        readings,
        pose,
        readings.values[effort][:, None],
        noise_of(measurement, (motion, *[""] * 5), (effort,), stepped),
        (Ray(measurement.drive.name, x, x, np.arange(len(readings))),),
        since_first(readings.values.get(TIME)),
        since_first(temperature_of(measurement, readings)),
        {motion: 0},
        (effort,),
    )


# --- Readings of a test by force: loads on the end-effector are imposed, displacements are read at gauges ---------
#
# What is neither imposed nor read is free. An absent load is zero, and a component of the end-effector's pose that
# has no gauge moves as it will, unless the sheet says that something holds it.


def observe_loads(measurement: Measurement) -> Observed:
    """Readings that have every load that was imposed, and a displacement.

    Raises:
        ValueError: a gauge has no noise, or the loads lie on too many rays.
    """
    readings = measurement.readings
    columns = tuple(gauge.channel for gauge in gauges_of(measurement))
    imposed = imposed_loads(measurement)
    read = np.column_stack([readings.values[name] for name in columns])
    usable = np.flatnonzero(~np.isnan(imposed).any(axis=1) & ~np.isnan(read).all(axis=1))
    readings, imposed, read = readings.only(usable), imposed[usable], read[usable]
    noise = noise_of(measurement, WRENCH, columns)
    zeros = {n.subject: n.sigma for n in measurement.nuisances if n.kind is Kind.ZERO}
    sigma = np.hypot(noise.pose, [zeros.get(name, 0.0) for name in WRENCH])
    groups = np.array([f"{p} {r}" for p, r in zip(readings.posture, readings.run, strict=True)])
    # a moment counts as the force that it is at the longest part's end
    found = rays(groups, imposed, sigma, 1.0 / measurement.chain.characteristic_length)
    return Observed(
        measurement,
        readings,
        imposed,
        read,
        noise,
        tuple(Ray(r.posture.rpartition(" ")[0], r.direction, r.measure, r.index) for r in found),
        since_first(readings.values.get(TIME)),
        since_first(temperature_of(measurement, readings)),
        {name: k for k, name in enumerate(WRENCH) if name in readings.values},
        columns,
    )
