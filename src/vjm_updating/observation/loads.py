"""Readings of a test by force: loads on the end-effector are imposed, displacements are read at gauges.

What is neither imposed nor read is free. An absent load is zero, and a component of the end-effector's pose that
has no gauge moves as it will, unless the sheet says that something holds it.
"""

from __future__ import annotations

import numpy as np

from vjm_updating.experiment import Kind, Measurement
from vjm_updating.experiment.channels import TIME, WRENCH
from vjm_updating.experiment.nominal_loads import gauges_of, imposed_loads
from vjm_updating.experiment.rays import Ray, rays
from vjm_updating.observation.noise import noise_of
from vjm_updating.observation.observed import Observed, since_first, temperature_of


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
