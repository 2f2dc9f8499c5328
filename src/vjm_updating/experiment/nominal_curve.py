"""A test that imposes displacements, beside wrenches of the nominal machine off its load paths."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.experiment.channels import POSE, WRENCH
from vjm_updating.experiment.comparison import Comparison
from vjm_updating.experiment.measured import Measurement
from vjm_updating.experiment.mistaken_as import RIGHT, MistakenAs
from vjm_updating.experiment.rays import Ray, rays
from vjm_updating.mechanisms.modified_chain import ModifiedChain
from vjm_updating.mechanisms.path_table import HalfRay, PathTable, tabulate

REACH = numerical(0.1)
"""Of the longest part, beyond which no displacement is imposed on a machine: there its path is not sought."""


class ByDisplacements(Comparison):
    """Readings beside load paths of the nominal machine along their rays.

    Attributes:
        rays: of the readings; none where they do not lie on a few.
    """

    def __init__(self, measurement: Measurement) -> None:
        readings, sheet = measurement.readings, measurement.sheet
        super().__init__(measurement, POSE, WRENCH, readings.pose, readings.wrench)
        noise = np.array([np.hypot(one.noise, one.zero) for one in map(sheet.errors, POSE)])
        known, length = (
            np.flatnonzero(~np.isnan(readings.pose).any(axis=1)),
            measurement.chain.characteristic_length,
        )
        try:
            found = rays(readings.posture[known], readings.pose[known], noise, length)
        except ValueError:
            found = []
        self.rays: list[Ray] = [Ray(r.posture, r.direction, r.measure, known[r.index]) for r in found]
        self._machine = ModifiedChain(measurement.chain, measurement.engine)
        self._table = lru_cache(maxsize=None)(self._tabulated)

    def predicted(self, way: MistakenAs = RIGHT, only: str = "") -> Array:
        """Wrenches ``(n, 6)`` at the displacements; nan also where a machine does not go; see `linear`."""
        result, length = self.linear(way, only), self.measurement.chain.characteristic_length
        for ray in self.rays:
            if only and ray.posture != only:
                continue
            direction = way.put_right(ray.direction, POSE)
            size = float(np.linalg.norm(direction))
            place = self.imposed[ray.index] @ ray.measure
            farthest = REACH * length / float(np.linalg.norm(direction * np.repeat([1.0, length], 3)))
            for sign in (1, -1):
                here = place * sign > 0.0
                if not here.any() or size == 0.0:
                    continue
                s = np.abs(place[here])
                reach = min(float(s.max()), farthest)
                table = self._table(HalfRay.of(way.postures.get(ray.posture, ray.posture), sign * direction, reach))
                end = 0.0 if table is None else table.s[-1] * (1.0 + 1e-9)
                result[ray.index[here]] = np.nan if table is None else table.at(s)[0]
                result[ray.index[here][s > end]] = np.nan
        return result

    def _slope(self, posture: str) -> Array:
        """Stiffness ``(6, 6)``; see `Comparison`."""
        m = self.measurement
        return np.asarray(m.engine.problem(m.chain, LoadCase(posture, 1.0)).unloaded().stiffness)

    def _tabulated(self, half: HalfRay) -> PathTable | None:
        """Equilibria along half a ray; None where the machine does not stand there."""
        try:
            return tabulate(self._machine, half, ())
        except NoConvergenceError:
            return None
