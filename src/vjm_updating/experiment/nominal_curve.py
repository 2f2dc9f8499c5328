"""Wrenches of the nominal machine at displaced poses, off its load paths: what readings are compared with."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_updating.constants import definition, numerical
from vjm_updating.experiment.channels import POSE, WRENCH
from vjm_updating.experiment.measurement import Measurement
from vjm_updating.experiment.rays import Ray, rays
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.path_table import HalfRay, PathTable, tabulate

REACH = numerical(0.1)
"""Of the longest part, beyond which no displacement is imposed on a machine: there its path is not sought."""
UNCHANGED, ONE = definition(tuple(range(6))), definition(np.ones(6))


class NominalCurves:
    """Load paths of the nominal machine along the rays of the readings.

    Attributes:
        measurement: sheet, readings, machine.
        given: columns of what was imposed.
        columns: of what was read.
        imposed: displacements ``(n, 6)``.
        read: wrenches ``(n, 6)``.
        rays: of the readings; none where they do not lie on a few.
    """

    given, columns = POSE, WRENCH

    def __init__(self, measurement: Measurement) -> None:
        self.measurement = measurement
        readings = measurement.readings
        self.imposed, self.read = readings.pose, readings.wrench
        known = np.flatnonzero(~np.isnan(readings.pose).any(axis=1))
        try:
            found = rays(
                readings.posture[known],
                readings.pose[known],
                self._noise(),
                measurement.chain.characteristic_length,
            )
        except ValueError:
            found = []
        self.rays: list[Ray] = [Ray(r.posture, r.direction, r.measure, known[r.index]) for r in found]
        self._machine = ModifiedChain(measurement.chain, measurement.engine)
        self._table = lru_cache(maxsize=None)(self._tabulated)
        self._stiffness = lru_cache(maxsize=None)(self._unloaded)

    def _noise(self) -> Array:
        known = [self.measurement.sheet.instrument.get(name) for name in POSE]
        return np.array([0.0 if one is None else np.hypot(one.noise, one.zero) for one in known])

    def predicted(
        self,
        factors: Array = ONE,
        order: tuple[int, ...] = UNCHANGED,
        postures: Mapping[str, str] | None = None,
        only: str = "",
    ) -> Array:
        """Wrenches ``(n, 6)`` at the readings' displacements; nan where a machine does not go, or nothing was read.

        Args:
            factors: by which displacements are multiplied ``(6,)``.
            order: in which their columns are taken, before they are multiplied.
            postures: in which others the machine stands instead, by label.
            only: label of the posture that is wanted; all by default.
        """
        readings, length = self.measurement.readings, self.measurement.chain.characteristic_length
        pose = readings.pose[:, list(order)] * factors
        other = postures or {}
        result = np.full((len(readings), 6), np.nan)
        for label in dict.fromkeys(readings.posture.tolist()):
            if not only or label == only:
                at = (readings.posture == label) & ~np.isnan(pose).any(axis=1)
                result[at] = pose[at] @ self._stiffness(other.get(label, label)).T
        for ray in self.rays:
            if only and ray.posture != only:
                continue
            direction = ray.direction[list(order)] * factors
            size = float(np.linalg.norm(direction))
            place = readings.pose[ray.index] @ ray.measure
            farthest = REACH * length / float(np.linalg.norm(direction * np.repeat([1.0, length], 3)))
            for sign in (1, -1):
                here = place * sign > 0.0
                if not here.any() or size == 0.0:
                    continue
                s = np.abs(place[here])
                reach = min(float(s.max()), farthest)
                table = self._table(HalfRay.of(other.get(ray.posture, ray.posture), sign * direction, reach))
                end = 0.0 if table is None else table.s[-1] * (1.0 + 1e-9)
                result[ray.index[here]] = np.nan if table is None else table.at(s)[0]
                result[ray.index[here][s > end]] = np.nan
        return result

    def slope(self, posture: str) -> Array:
        """Derivative ``(6, 6)`` of the wrench by the displacements, unloaded."""
        return self._stiffness(posture)

    def _unloaded(self, posture: str) -> Array:
        """Stiffness ``(6, 6)``, for readings on no ray.

        Raises:
            NoConvergenceError: the nominal machine has no equilibrium in the posture.
        """
        m = self.measurement
        return np.asarray(m.engine.problem(m.chain, LoadCase(posture, 1.0)).unloaded().stiffness)

    def _tabulated(self, half: HalfRay) -> PathTable | None:
        """Equilibria along half a ray; None where the machine does not stand there."""
        try:
            return tabulate(self._machine, half, ())
        except NoConvergenceError:
            return None
