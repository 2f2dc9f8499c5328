"""Tests of a pinned column, controlled by the deflection of its middle, with the load read at each mark."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from vjm.io.shapes import Shape
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint
from vjm.rotations import Array
from vjm_updating.constants import definition, numerical, physical_bound, prior_scale, shown
from vjm_updating.diagnosis.stress import fibre_of, shape_of
from vjm_updating.experiment import Measurement, Readings
from vjm_updating.experiment.comparison import Ray
from vjm_updating.experiment.data_file import WRENCH, split_point
from vjm_updating.inference.fitting import Fit
from vjm_updating.inference.forward import Predictor, values_of
from vjm_updating.inference.instruments import InstrumentScale, InstrumentZero
from vjm_updating.inference.noise import Noise, noise_of
from vjm_updating.inference.observed import Observed
from vjm_updating.inference.parameters import Evaluation, FitParameter, Hypothesis, instrument_errors
from vjm_updating.mechanisms.column import column_force
from vjm_updating.mechanisms.effect import Effect, Quantity, part_table
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, beam_of, link_of
from vjm_updating.mechanisms.structure import LinkBow, LinkCompliance, LinkLength

CLAMPED = physical_bound(100.0)
"""Stiffness over EI/L from which a pin is as good as clamped: the critical load is then 4 % below."""


@dataclass(frozen=True)
class EndRestraint(Effect):
    """A rotational spring at each pin, from free to clamped; ``flexural`` is EI/L of the column, N mm per rad."""

    flexural: float = 1.0
    cause = "end_restraint"
    title = "the column's pins resist turning"

    def quantities(self) -> tuple[Quantity, ...]:
        """Its stiffness."""
        unit = 0.1 * self.flexural
        return (Quantity("stiffness_Nmm_per_rad", 0.0, CLAMPED * self.flexural, unit, neutral=0.0),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Those that raise the critical load by some 8 and 60 per cent."""
        return [(share * self.flexural,) for share in (0.2, 2.0)]


BEFORE = prior_scale(5)
"""Rows at the first mark before loading begins: of the files of marks known the shortest has six."""
LEAST = numerical(5)
"""Half of the marks from which noise is estimated."""
SET = definition(0.002)
"""Permanent strain at the proof stress."""
GONE = shown(0.01)
"""Share of the load that yield takes where the curve is said to depart from the elastic one."""


@dataclass(frozen=True)
class ColumnBow(LinkBow):
    """A bow in the plane in which the column buckles."""

    sizes: tuple[float, ...] = (0.5, 1.5, 4.0)
    extent = 1

    def quantities(self) -> tuple[Quantity, ...]:
        """Towards the positive deflection. Behind a bifurcation micrometres show: differences must be as small."""
        return (Quantity("amplitude_mm", -20.0, 20.0, 0.1, neutral=0.0),)

    def trials(self) -> Sequence[tuple[float, ...]]:
        """Small and large."""
        return [(size,) for size in self.sizes]

    def machine(self, machine: ModifiedMachine, values: Sequence[float]) -> ModifiedMachine:
        """Built with the bow."""
        return machine.with_bow(link_of(machine.nominal), values[0], 0.0)

    def reported(self, values: Sequence[float]) -> dict[str, float]:
        """Amplitude, and the side."""
        return {
            "link_bow.amplitude_mm": abs(float(values[0])),
            "link_bow.direction_rad": 0.0 if values[0] >= 0.0 else float(np.pi),
        }


@dataclass(frozen=True)
class ColumnYield(Effect):
    """Bending beyond yield by Ramberg and Osgood's law, fibre by fibre, about the handbook's ``stress``, MPa."""

    part: str = "link"
    stress: float = 250.0
    cause = "plasticity"
    title = "a permanent set after a yield load"

    def quantities(self) -> tuple[Quantity, ...]:
        """Stress at 0.2 % of permanent strain, and the exponent: the larger the sharper the knee."""
        return (
            Quantity("yield_stress_MPa", 0.3 * self.stress, 4.0 * self.stress, 0.1 * self.stress),
            Quantity("exponent", 3.0, 400.0, 20.0, usual=40.0, spread=1.5, log=True),
        )

    def trials(self) -> Sequence[tuple[float, ...]]:
        """About the handbook's value, rounded and sharp."""
        return [(share * self.stress, n) for n in (40.0, 8.0) for share in (0.8, 1.0, 1.25)]

    def write(self, document: dict[str, Any], nominal: Machine, values: Sequence[float]) -> None:
        """The section's yield stress; a file has no word for the exponent."""
        part_table(document, link_of(nominal))["section"]["yield_stress_MPa"] = float(values[0])


def is_column(measurement: Measurement) -> bool:
    """Whether a test controlled a pinned beam by the deflection of its middle and read no end displacement."""
    point, channel = split_point(measurement.sheet.test.control)
    return bool(point) and channel == "uy_mm" and not measurement.imposed


def observe_column(measurement: Measurement) -> Observed:
    """What there is to be explained: the last reading at each mark, as long as the deflection grows.

    Raises:
        ValueError: the machine is no pinned beam, or the load was not read along it.
    """
    chain, sheet, control = measurement.chain, measurement.sheet, measurement.sheet.test.control
    where = sheet.points[split_point(control)[0]]
    pins = [isinstance(part, Joint) and part.free for part in chain.parts]
    pinned = pins == [True, False, True] and isinstance(chain.parts[1], Beam)
    if not pinned or where.at != 0.5 or where.body != link_of(chain):
        raise ValueError(
            f"{sheet.file}: control {control}: a test that a point controls is diagnosed for a beam between two "
            "pins, by its middle. Give the displacement of the end-effector instead"
        )
    readings = measurement.readings
    raw = readings
    if WRENCH[0] not in readings.values:
        raise ValueError(f"{readings.file}: column {WRENCH[0]} is missing: the load along the column is needed")
    if sheet.sigma(control).held:
        readings = readings.settled(control)
    mark, force = readings.values[control], readings.wrench
    known = np.flatnonzero(~np.isnan(mark) & ~np.isnan(force[:, 0]))
    readings = readings.only(known)
    mark = readings.values[control]
    # what comes back has another law; the last block of a file may be stale
    growing = np.concatenate([[True], mark[1:] > np.maximum.accumulate(mark)[:-1]])
    end = int(np.argmin(growing)) if not growing.all() else len(growing)
    readings = readings.only(np.arange(end))
    n = len(readings)
    pose = np.zeros((n, 6))
    pose[:, 0] = readings.values[control]
    wrench = np.full((n, 6), np.nan)
    wrench[:, 0] = readings.wrench[:, 0]
    noise = noise_of(measurement)
    own = np.zeros(6)
    own[0] = sheet.sigma(control).noise
    x = np.eye(6)[0]
    return Observed(
        measurement,
        readings,
        pose,
        wrench,
        replace(noise, pose=own),
        (Ray(str(readings.posture[0]), x, x, np.arange(n)),),
        None,
        None,
        {control: 0},
        zeros=zeros_before_loading(raw, control, sheet.sigma(WRENCH[0]).zero),
    )


def zeros_before_loading(readings: Readings, control: str, sigma: float) -> dict[str, tuple[float, float]]:
    """Bounds of the zeros of ruler and load cell, mm and N; of the cell only where there are rows before loading.

    What the cell reads before the first mark is left is its zero, or a load that the fixtures make already. So the
    zero lies between nothing and that, give or take three of the sheet's sigmas. Whoever goes from the unloaded
    shape to the first marks sees by which one the ruler is off: its zero is less than the distance of two marks.
    ``sigma`` is the sheet's of the zero, N.
    """
    marks, force = readings.values[control], readings.values[WRENCH[0]]
    steps = np.abs(np.diff(np.unique(marks)))
    bounds = {control: (-float(np.median(steps)), float(np.median(steps)))} if len(steps) else {}
    first = force[marks == marks[0]]
    if marks[0] != 0.0 or len(first) <= BEFORE or not np.isfinite(first[:BEFORE]).any():
        return bounds
    level = float(np.nanmedian(first[:BEFORE]))
    return bounds | {WRENCH[0]: (min(level, 0.0) - 3.0 * sigma, max(level, 0.0) + 3.0 * sigma)}


def with_noise_found(observed: Observed, fit: Fit) -> Observed:
    """Readings with the noise of mark and load as a fit's residuals have it; see `noise_found`."""
    return replace(observed, noise=noise_found(observed, fit)[1])


def noise_found(observed: Observed, fit: Fit) -> tuple[float, Noise]:
    """The noise of mark and load as a fit's residuals have it, by maximum likelihood.

    Who goes to a ruler's marks by hand does better or worse than the sheet's guess. The mark's noise shows where
    the curve is steep, the load's where it is level.

    Returns:
        Twice the negative logarithm of the likelihood, but for a constant, and the noise.
    """
    sheet = observed.measurement.sheet
    mark, load = (float(sheet.sigma(name).noise) for name in (*observed.slots, WRENCH[0]))
    on = observed.present[:, 0]
    r, slope = fit.evaluation.residual[on, 0], fit.evaluation.stiffness[on, 0, 0]
    best, chosen = np.inf, (1.0, 1.0)
    ways = np.geomspace(0.05, 2.0, 16), np.geomspace(1.0, 100.0, 24)
    for a, b in product(*ways) if len(r) >= 2 * LEAST else [chosen]:
        variance = (b * load) ** 2 + (a * mark * slope) ** 2
        cost = float(np.sum(np.log(variance) + r**2 / variance))
        if cost < best:
            best, chosen = cost, (float(a), float(b))
    # parameters that were fitted have taken their share
    share = (len(r) / max(len(r) - fit.free - 2, 1)) ** 0.5 if len(r) >= 2 * LEAST else 1.0
    pose, wrench = observed.noise.pose.copy(), observed.noise.wrench.copy()
    pose[0], wrench[0] = mark * chosen[0] * share, load * max(chosen[1] * share, 1.0)
    return best, replace(observed.noise, pose=pose, wrench=wrench)


def column_effects(observed: Observed) -> list[Effect]:
    """The catalogue of such a test."""
    link = link_of(observed.measurement.chain)
    beam = beam_of(observed.measurement.chain, link)
    flexural = beam.effective_section().EIz / beam.length
    effects: list[Effect] = [
        ColumnBow(),
        LinkCompliance(beam=link),
        LinkLength(beam=link),
        EndRestraint(flexural=flexural),
    ]
    shape = _shape(observed.measurement)
    if shape is not None:
        effects.append(ColumnYield(stress=shape.yield_stress_MPa or 250.0))
    for channel in (*observed.pose_channels, WRENCH[0]):
        effects += [InstrumentZero(part=channel), InstrumentScale(part=channel)]
    return effects


def _shape(measurement: Measurement) -> Shape | None:
    """The link's shape, where it is known; it bends about its section's z axis."""
    return shape_of(part_table(measurement.document, link_of(measurement.chain)))


class ColumnForward(Predictor):
    """Predicts the loads at the marks; both sides are alike."""

    def evaluate(
        self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis, beside: Array | None = None
    ) -> Evaluation:
        """Readings against a hypothesis; no tables are needed for it."""
        observed = self.observed
        errors = instrument_errors(unknowns, z, observed.slots)
        place = errors.true_displacement(observed.imposed)
        w = place[:, 0]
        wrench = np.zeros((len(w), 6))
        wrench[:, 0] = -self._force(unknowns, z, hypothesis, w)
        stiffness = np.zeros((len(w), 6, 6))
        stiffness[:, 0, 0] = np.gradient(wrench[:, 0], w)
        return Evaluation(z, errors.residual(observed.measured, wrench), wrench, stiffness, place, errors)

    def evaluate_nominal(self, deflection: Array) -> Array:
        """Loads ``(n,)`` of the sheet's own column, straight and elastic, at deflections ``(n,)`` of its middle."""
        beam = beam_of(self.observed.measurement.chain, link_of(self.observed.measurement.chain))
        return column_force(deflection, beam.length, beam.effective_section().EIz)

    def yield_unknown(self) -> str:
        """Why there is no first yield."""
        measurement = self.observed.measurement
        fibre = fibre_of(part_table(measurement.document, link_of(measurement.chain)))
        return fibre if isinstance(fibre, str) else "not on the way to the last reading"

    def first_yield(
        self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis, *, handbook: bool = False
    ) -> tuple[float, float] | None:
        """Load in N and deflection in mm at which the middle's outer fibre reaches the proof stress on the way.

        With ``handbook`` by the model's own yield stress where no cause has one.
        """
        stress = self._stress(unknowns, z, hypothesis)
        if stress is None and handbook:
            stress = self._handbook()
        machine = self.machine(unknowns, z, hypothesis)
        return self._reached(
            stress, machine.chain(), _bow(machine), lambda w: self._force(unknowns, z, hypothesis, w)
        )

    def handbook_yield(self) -> str:
        """Where the sheet's own column, straight and elastic, would reach the model's yield stress: no fit."""
        stress = self._handbook()
        onset = self._reached(stress, self.observed.measurement.chain, 0.0, self.evaluate_nominal)
        if stress is None or onset is None:
            return self.yield_unknown()
        where = f"{onset[1]:.3g} mm and {onset[0]:.4g} N"
        return f"{stress:.4g} MPa in the model file: without any fit, yield from {where} on"

    def _handbook(self) -> float | None:
        shape = _shape(self.observed.measurement)
        return None if shape is None else shape.yield_stress_MPa

    def _reached(
        self, stress: float | None, chain: Machine, bow: float, force: Callable[[Array], Array]
    ) -> tuple[float, float] | None:
        """Load and deflection at which the middle's outer fibre has a stress, by beam theory."""
        shape = _shape(self.observed.measurement)
        if stress is None or shape is None:
            return None
        w = np.linspace(0.05, float(self.observed.imposed[:, 0].max()), 240)
        P = force(w)
        section = beam_of(chain, link_of(chain)).effective_section()
        inertia = section.EIz / (section.EA / shape.area)
        reached = P / shape.area + P * (bow + w) * 0.5 * shape.sides[0] / inertia
        over = np.flatnonzero(reached >= stress)
        return (float(P[over[0]]), float(w[over[0]])) if len(over) else None

    def departs(self, fit: Fit) -> float | None:
        """Deflection in mm from which yield lowers a fit's load by `GONE`; None where it does not on the way."""
        w = np.linspace(0.05, float(self.observed.imposed[:, 0].max()), 240)
        plain, load = (
            self._force(fit.parameters, fit.evaluation.z, fit.hypothesis, w, elastic=e) for e in (True, False)
        )
        lower = np.flatnonzero(load < (1.0 - GONE) * plain)
        return float(w[lower[0]]) if len(lower) else None

    def _stress(self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis) -> float | None:
        for effect, values in zip(hypothesis, values_of(unknowns, z, hypothesis), strict=True):
            if isinstance(effect, ColumnYield):
                return values[0]
        return None

    def _force(
        self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis, w: Array, *, elastic: bool = False
    ) -> Array:
        machine = self.machine(unknowns, z, hypothesis)
        beam = beam_of(machine.chain(), link_of(machine.nominal))
        section = beam.effective_section()
        shape = _shape(self.observed.measurement)
        known = list(zip(hypothesis, values_of(unknowns, z, hypothesis), strict=True))
        held = sum(values[0] for effect, values in known if isinstance(effect, EndRestraint))
        for effect, values in known:
            if isinstance(effect, ColumnYield) and shape is not None and not elastic:
                modulus = section.EA / shape.area
                euler = np.pi**2 * section.EIz / beam.length**2
                # the load's own stress is there before the bending
                left = max(values[0] - euler / shape.area, 1.0)
                proof = left * section.EIz / modulus / (0.5 * shape.sides[0])
                return column_force(
                    w, beam.length, section.EIz, _bow(machine), proof, shape, values[1], SET * modulus / left, held
                )
        return column_force(w, beam.length, section.EIz, _bow(machine), restraint=held)


def _bow(machine: ModifiedMachine) -> float:
    """Amplitude of the column's bow towards the positive deflection, mm."""
    return machine.bow_of(link_of(machine.nominal))[0]
