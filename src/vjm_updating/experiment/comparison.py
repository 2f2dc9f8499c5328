"""Readings beside the nominal machine's prediction: what rules of plausibility look at.

Of a test of one joint also its columns and the lever at which its laws are given.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Joint
from vjm.rotations import Array
from vjm_updating.constants import numerical, physical_bound, prior_scale, stated_level
from vjm_updating.experiment.data_file import EFFORT, MOTION, POSE, WRENCH, split_point, unit_of
from vjm_updating.experiment.measured import Measurement
from vjm_updating.experiment.mistakes import RIGHT, UNITS, Mistake
from vjm_updating.inference.significance import level
from vjm_updating.mechanisms.equilibrium_tables import Gauge, HalfRay, PathTable, load_table, tabulate
from vjm_updating.mechanisms.modified_chain import ModifiedMachine

FEW = numerical(5)
"""Readings on each side of a change."""
CLEAR = stated_level(20.0)
"""Size of a prediction over its noise, see `Comparison.noise`, from which on a ratio or a sign is judged."""

MISSED = prior_scale(0.35)
"""Logarithm of a machine's forces over those of its model, where it is not as its sheet promises."""
DIFFERS = stated_level(level(1) * MISSED)
"""Logarithm of a factor beyond which forces are not those of a machine that differs from its model."""


class Comparison(ABC):
    """Readings beside the prediction by the unloaded machine's slope; a kind of test may know a better one.

    Attributes:
        words: what was read, in a word.
        labels: postures in the order of the file.
        given: columns of what was imposed, i: displacements, or loads.
        columns: of what was read, m: the wrench, or displacements.
        imposed: what was ``(n, i)``.
        read: what was ``(n, m)``; nan where there is no reading.
        unit: ``(m,)`` what makes moments forces, or rotations displacements.
    """

    words = "forces"

    def __init__(
        self,
        measurement: Measurement,
        given: tuple[str, ...],
        columns: tuple[str, ...],
        imposed: Array,
        read: Array,
    ) -> None:
        self.measurement, self.readings = measurement, measurement.readings
        self.labels: list[str] = list(dict.fromkeys(self.readings.posture.tolist()))
        self.given, self.columns, self.imposed, self.read = given, columns, imposed, read
        length = measurement.chain.characteristic_length
        lever = {"Nmm": 1.0 / length, "rad": length}
        self.unit = np.array([lever.get(unit_of(name), 1.0) for name in columns])
        self.slope = lru_cache(maxsize=None)(self._slope)

    @cached_property
    def straight(self) -> Machine:
        """The model with laws of joints as they are where they are stiffest, as beyond a clearance."""
        chain = self.measurement.chain
        parts = (
            replace(part, law=None, compliance=part.compliances[0])
            if isinstance(part, Joint) and part.law is not None and part.matrix is None
            else part
            for part in chain.parts
        )
        return replace(chain, parts=tuple(parts)) if chain.laws else chain

    @abstractmethod
    def _slope(self, posture: str) -> Array:
        """Derivative ``(m, i)`` of what is read by what is imposed, unloaded.

        Raises:
            NoConvergenceError: the nominal machine does not stand in the posture.
            ValueError: what is free makes it a mechanism.
        """

    def linear(self, way: Mistake = RIGHT, only: str = "") -> Array:
        """What the nominal machine would show ``(n, m)`` by its slope; nan where it is not known what was imposed.

        Under a ``way`` of being mistaken what was imposed is put right before; ``only`` is the label of the posture
        that is wanted.
        """
        imposed, result = way.put_right(self.imposed, self.given), np.full(self.read.shape, np.nan)
        for label in self.labels if not only else [only]:
            rows = self.readings.posture == label
            result[rows] = imposed[rows] @ self.slope(way.postures.get(label, label)).T
        return result

    def predicted(self, way: Mistake = RIGHT, only: str = "") -> Array:
        """The best prediction of this kind of test; see `linear`."""
        return self.linear(way, only)

    @property
    def of_joint(self) -> bool:
        """Whether one joint was tested."""
        return self.measurement.sheet.kind == "joint"

    @property
    def main(self) -> list[int]:
        """Which of what was read are forces, of a test by force displacements; all where none is."""
        indices = [k for k, name in enumerate(self.columns) if unit_of(name) in ("N", "mm")]
        return indices or list(range(len(self.columns)))

    @property
    def comparable(self) -> bool:
        """Whether what was imposed is known, and something was read."""
        known = self.of_joint or self.measurement.loaded or self.measurement.imposed
        return known and any(name in self.readings.values for name in self.columns)

    def at(self, label: str) -> np.ndarray:
        """Indices of the readings of a posture of which it is known what was imposed."""
        return np.flatnonzero((self.readings.posture == label) & ~np.isnan(self.imposed).any(axis=1))

    def pairs(self, predicted: Array) -> Iterator[tuple[str, Array, Array]]:
        """By the name of its column what was read beside a prediction ``(n, m)``, where both are known."""
        for k, name in enumerate(self.columns):
            known = ~np.isnan(self.read[:, k]) & ~np.isnan(predicted[:, k])
            if known.any():
                yield name, self.read[known, k], predicted[known, k]

    def noise(self, name: str) -> float:
        """Of a channel beside its prediction, standard deviation: its own, and what is made of that of the given.

        A stiff machine feels that of a gauge on an axis which nobody drives. Of postures the largest counts.
        """
        sheet = self.measurement.sheet
        return self._with_given(name, sheet.sigma(name).noise, [sheet.errors(n).noise for n in self.given])

    def zero(self, name: str) -> float:
        """Likewise of the constant errors of a channel and of the given."""
        sheet = self.measurement.sheet
        return self._with_given(name, sheet.errors(name).zero, [sheet.errors(n).zero for n in self.given])

    def _with_given(self, name: str, own: float, given: Sequence[float]) -> float:
        k = self.columns.index(name)
        made = (np.linalg.norm(self.slope(label)[k] * np.array(given)) for label in self.labels)
        return float(np.hypot(own, max(map(float, made))))

    def expected(self, name: str) -> bool:
        """Whether the model predicts a change of a channel that was read far above its noise."""
        if not self.comparable:
            return False
        predicted = self.predicted()[:, self.columns.index(name)]
        of_postures = (predicted[self.at(label)] for label in self.labels)
        spans = [float(np.nanmax(g) - np.nanmin(g)) for g in of_postures if not np.isnan(g).all()]
        return max(spans, default=0.0) > CLEAR * max(self.noise(name), 1e-12)


def machines(factor: float) -> bool:
    """Whether a machine may show so many times what its model predicts."""
    return factor > 0.0 and abs(np.log(factor)) < DIFFERS


def thousandfold(ratio: Sequence[float]) -> bool:
    """Whether what is so many times its prediction is a machine's but for a factor of a thousand."""
    return any(all(machines(abs(r) * by) for r in ratio) for by in (1e3, 1e-3))


def units_between(ratio: Sequence[float], read: str, imposed: str = "") -> dict[str, str]:
    """By the words of `UNITS` the column that in this unit makes such multiples of the prediction a machine's."""
    return {
        words: name
        for name, sign in ((read, 1), (imposed, -1))
        for words, factor, names in UNITS
        if split_point(name)[1] in names and all(machines(abs(r) * factor**sign) for r in ratio)
    }


def instead(words: str, column: str, what: str) -> str:
    """``ux_mm in m instead of mm``."""
    own, unit = unit_of(column).replace("Nmm", "N mm"), words.partition(" in ")[2]
    arm = " mm" if own == "N mm" and words.startswith("forces") else ""
    return f"{what} in {unit}{arm} instead of {own}"


def ratio_of(f: Array, g: Array) -> tuple[float, float, float]:
    """Quartiles of measured to predicted in the large half, which a few outliers do not move; all 1 without it."""
    large = (np.abs(g) >= np.median(np.abs(g))) & (g != 0.0)
    if not large.any():
        return 1.0, 1.0, 1.0
    low, middle, high = np.percentile(f[large] / g[large], [25.0, 50.0, 75.0])
    return float(low), float(middle), float(high)


def correlation(a: Array, b: Array) -> float:
    """Correlation about zero of what is known of both; 0 where there is none."""
    known = ~np.isnan(a) & ~np.isnan(b)
    size = float(np.linalg.norm(a[known]) * np.linalg.norm(b[known]))
    return float(a[known] @ b[known]) / size if size > 0.0 else 0.0


# --- A test by force, beside what gauges read of the nominal machine under the loads ------------------------------

SMALL = numerical(1e-6, "N")
"""N: the load at which the unloaded machine's compliance is taken."""


def gauges_of(measurement: Measurement) -> tuple[Gauge, ...]:
    """The gauges that read displacements, in the order of the file's columns."""
    gauges = []
    for name in measurement.readings.channels:
        label, channel = split_point(name)
        if channel in POSE:
            point = measurement.sheet.points.get(label)
            where = ("", 1.0) if point is None else (point.body, point.at)
            gauges.append(Gauge(name, POSE.index(channel), *where))
    return tuple(gauges)


def imposed_loads(measurement: Measurement) -> Array:
    """Loads ``(n, 6)`` of a test by force, N, N mm; an absent one is zero."""
    readings = measurement.readings
    return np.column_stack([readings.values.get(name, np.zeros(len(readings))) for name in WRENCH])


class ByLoads(Comparison):
    """Readings of gauges beside the unloaded machine's compliance."""

    words = "displacements"

    def __init__(self, measurement: Measurement) -> None:
        self.gauges = gauges_of(measurement)
        columns = tuple(gauge.channel for gauge in self.gauges)
        read = np.column_stack([measurement.readings.values[name] for name in columns])
        super().__init__(measurement, WRENCH, columns, imposed_loads(measurement), read)

    def _slope(self, posture: str) -> Array:
        """Compliance ``(m, 6)``; see `Comparison`."""
        m = self.measurement
        table = load_table(
            ModifiedMachine(self.straight, m.engine),
            HalfRay.of(posture, np.eye(6)[0], SMALL),
            (),
            m.free,
            self.gauges,
        )
        return table.compliance[0]


# --- Readings as points on rays from the unloaded pose, along which the model is solved ---------------------------

NEAR = numerical(1e-3)
"""Distance of a reading from its ray, over the ray's length, that the loaded stiffness bridges; its error is the
square of that."""
MOST_RAYS = physical_bound(60)
"""In one posture; more is no set of ramps."""


@dataclass(frozen=True)
class Ray:
    """Readings of one posture whose displacements lie on one line through the unloaded pose.

    Attributes:
        direction: ``(6,)`` displacement per unit of the ramp, mm or rad.
        measure: ``(6,)`` whose product with a displacement is its place on the ray.
        index: of its readings ``(k,)``.
    """

    posture: str
    direction: Array
    measure: Array
    index: np.ndarray


def rays(posture: np.ndarray, pose: Array, noise: Array, length: float) -> list[Ray]:
    """Sort readings by rays, those furthest out first.

    ``pose`` (n, 6) is in mm and rad, ``noise`` (6,) that of a reading and its zero; a rad counts for ``length`` mm.

    Raises:
        ValueError: there are more than `MOST_RAYS`.
    """
    unit = np.repeat([1.0, length], 3)
    scaled, sigma = pose * unit, noise * unit
    near = 6.0 * float(np.linalg.norm(sigma))
    sorted_rays: list[Ray] = []
    for label in dict.fromkeys(posture.tolist()):
        left = np.flatnonzero(posture == label)
        mine = 0
        while len(left):
            points = scaled[left]
            furthest = points[np.argmax(np.linalg.norm(points, axis=1))]
            d = _clean(furthest, sigma)
            along = points @ d
            off = np.linalg.norm(points - along[:, None] * d, axis=1)
            on = off <= np.maximum(near, NEAR * np.abs(along))
            on[np.argmax(np.linalg.norm(points, axis=1))] = True
            # one coordinate alone counts in its own unit: a ramp about z is in rad
            size = unit[np.argmax(np.abs(d))] if np.count_nonzero(d) == 1 else 1.0
            sorted_rays.append(Ray(label, d * size / unit, d * unit / size, left[on]))
            left = left[~on]
            mine += 1
            if mine > MOST_RAYS:
                raise ValueError(
                    f"posture {label}: its displacements go in more than {MOST_RAYS} directions from the unloaded "
                    "pose: a calibration takes ramps; diagnose such data or leave rows out"
                )
    return sorted_rays


def _clean(furthest: Array, sigma: Array) -> Array:
    """Unit vector ``(6,)`` along a displacement, without the components that are noise."""
    real = np.where(np.abs(furthest) > 6.0 * sigma, furthest, 0.0)
    chosen = real if real.any() else furthest
    size = float(np.linalg.norm(chosen))
    return chosen / size if size > 0.0 else np.eye(6)[0]


# --- A test that imposes displacements, beside wrenches of the nominal machine off its load paths -----------------

REACH = numerical(0.1)
"""Of the longest part, beyond which no displacement is imposed on a machine: there its path is not sought."""


class ByDisplacements(Comparison):
    """Readings beside load paths of the nominal machine along their rays; none where they do not lie on a few."""

    def __init__(self, measurement: Measurement) -> None:
        readings, sheet = measurement.readings, measurement.sheet
        super().__init__(measurement, POSE, WRENCH, readings.pose, readings.wrench)
        noise = np.array([np.hypot(one.noise, one.zero) for one in map(sheet.errors, POSE)])
        known = np.flatnonzero(~np.isnan(readings.pose).any(axis=1))
        length = measurement.chain.characteristic_length
        try:
            known_rays = rays(readings.posture[known], readings.pose[known], noise, length)
        except ValueError:
            known_rays = []
        self.rays: list[Ray] = [Ray(r.posture, r.direction, r.measure, known[r.index]) for r in known_rays]
        self._machine = ModifiedMachine(measurement.chain, measurement.engine)
        self._table = lru_cache(maxsize=None)(self._tabulated)

    def predicted(self, way: Mistake = RIGHT, only: str = "") -> Array:
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
                side = place * sign > 0.0
                if not side.any() or size == 0.0:
                    continue
                s = np.abs(place[side])
                reach = min(float(s.max()), farthest)
                posture, table = way.postures.get(ray.posture, ray.posture), None
                # what one row makes of another in its unit may be further than the machine goes
                while table is None and reach >= s.min():
                    table = self._table(HalfRay.of(posture, sign * direction, reach))
                    reach *= 0.5
                end = 0.0 if table is None else table.s[-1] * (1.0 + 1e-9)
                result[ray.index[side]] = np.nan if table is None else table.at(s)[0]
                result[ray.index[side][s > end]] = np.nan
        return result

    def _slope(self, posture: str) -> Array:
        """Stiffness ``(6, 6)``; see `Comparison`."""
        m = self.measurement
        return np.asarray(m.engine.problem(self.straight, LoadCase(posture, 1.0)).unloaded().stiffness)

    def _tabulated(self, half: HalfRay) -> PathTable | None:
        """Equilibria along half a ray; None where the machine does not stand there."""
        try:
            return tabulate(self._machine, half, ())
        except NoConvergenceError:
            return None


def channels_of(measurement: Measurement) -> tuple[str, str]:
    """Columns of the motion and of the load."""
    motion, effort = (
        next(name for name in names if name in measurement.readings.values) for names in (MOTION, EFFORT)
    )
    return motion, effort


def levers_of(measurement: Measurement) -> tuple[float, float, float]:
    """The lever L in mm at which the joint's laws are told, and what makes readings of its motion and load.

    Returns:
        L, 1 where the joint slides; motion at L, mm, per unit of the motion's column; the load's column per N at L.
    """
    motion, effort = channels_of(measurement)
    if measurement.drive.slides:
        return 1.0, 1.0, 1.0
    length, lever = measurement.chain.characteristic_length, measurement.sheet.lever
    of_motion = length if motion == MOTION[0] else length / (lever.gauge_mm or np.nan)
    of_load = length if effort == EFFORT[0] else length / (lever.force_mm or np.nan)
    return length, of_motion, of_load


def one_sided(measurement: Measurement) -> bool:
    """Whether the joint was loaded to one side only, so that nothing shows the other end of its backlash.

    A side counts where a load and a motion of its sign were read together. Friction alone turns the load's sign on
    the way back, while the motion keeps its own.
    """
    sides = []
    for name in channels_of(measurement):
        read, own = measurement.readings.values[name], measurement.sheet.sigma(name)
        # the largest of n standard normal deviations is near the root of 2 ln n
        clear = np.hypot(own.noise, own.zero) * np.sqrt(2.0 * np.log(max(len(read), 2)))
        sides.append(np.where(np.abs(read) > clear, np.sign(read), 0.0))
    motion, load = sides
    return not all(np.any((motion == side) & (load == side)) for side in (1.0, -1.0))


def stiffness_of(measurement: Measurement) -> float:
    """Of the joint in the model at its lever, N/mm."""
    length, _, _ = levers_of(measurement)
    return 1.0 / measurement.joint_compliance / length**2


class OfJoint(Comparison):
    """The load beside the compliance of one joint in the model."""

    words = "loads"

    def __init__(self, measurement: Measurement) -> None:
        motion, effort = channels_of(measurement)
        imposed, read = (measurement.readings.values[name][:, None] for name in (motion, effort))
        super().__init__(measurement, (motion,), (effort,), imposed, read)

    def _slope(self, posture: str) -> Array:
        """Stiffness ``(1, 1)`` in the units of the columns, the same in every posture."""
        _, of_motion, of_load = levers_of(self.measurement)
        return np.full((1, 1), of_load * stiffness_of(self.measurement) * of_motion)
