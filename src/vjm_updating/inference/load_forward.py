"""What gauges read of a machine under loads: equilibria along rays of loads, elements in series, instruments.

See `vjm_updating.inference.observed` for the kind of test. What an element deflects by moves all that is behind
it as a rigid body, to first order; held components push back, which
`vjm_updating.mechanisms.series_elements.balance`
finds.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import numerical
from vjm_updating.experiment import Kind
from vjm_updating.experiment.comparison import Ray, gauges_of
from vjm_updating.inference.forward import MARGIN, Predictor, drifted, own_effects, values_of
from vjm_updating.inference.parameters import Evaluation, FitParameter, Hypothesis, instrument_errors
from vjm_updating.mechanisms.effect import Effect
from vjm_updating.mechanisms.equilibrium_tables import Gauge, HalfRay, LoadedEquilibria, load_table
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, links_of
from vjm_updating.mechanisms.relaxation import Relaxation
from vjm_updating.mechanisms.series_elements import (
    AboutAxis,
    AlongAxis,
    AlongLine,
    AtJoint,
    Behind,
    ElementSite,
    SeriesElement,
    balance,
    force_on,
    retarded,
)

KEPT = numerical(400)
"""Tables that are kept."""

Found = tuple[Array, ...]
"""Of n readings what `LoadedEquilibria.at` gives."""


@dataclass
class LoadForward(Predictor):
    """Predicts displacements under loads: what loses its stability under a load bears no more of it."""

    whole_beams: ClassVar[bool] = True
    """Whether a modulus acts on all of its beam."""

    _tables: OrderedDict[tuple[object, ...], LoadedEquilibria] = field(default_factory=OrderedDict)

    def evaluate(
        self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis, beside: Array | None = None
    ) -> Evaluation:
        """Readings against a hypothesis; equilibria are solved anew whatever lies ``beside``.

        Raises:
            vjm.errors.NoConvergenceError: the machine does not bear the loads.
        """
        observed = self.observed
        machine = self.machine(unknowns, z, hypothesis)
        errors = instrument_errors(unknowns, z, observed.slots, observed.columns)
        of_loads, of_gauges = drifted(observed, hypothesis, values_of(unknowns, z, hypothesis))
        load = errors.true_displacement(observed.imposed - of_loads)
        own = own_effects(unknowns, z, hypothesis)
        for effect, v in own:
            load = effect.imposed(load, v)
        reading, compliance, carried, wrench, stiffness, by_beam = self._lookup(machine, own, load)
        beams = [beam.name for beam in machine.nominal.beams]
        relaxing = [r for e, v in own if (r := e.relaxation(machine, v)) is not None]
        if relaxing:
            # what acts all the time has relaxed what it can
            moved = by_beam - self._lookup(machine, own, np.zeros_like(load))[5]
            crept = [self._crept(moved[:, :, beams.index(r.part)], r) for r in relaxing]
            reading = reading + sum(crept, np.zeros_like(reading))
        elements = [element for effect, v in own for element in effect.elements(machine, v)]
        if elements:
            still, history = np.zeros_like(wrench), observed.unloaded

            def look(moved: Array) -> tuple[Array, Array]:
                return wrench + np.einsum("nij,nj->ni", stiffness, moved), stiffness

            balanced = balance(look, still, elements, history)
            reading = reading + np.einsum("nij,nj->ni", carried, balanced.pose)
            for k, element in enumerate(elements):
                motion = element.place.motion(history)
                slope = element.law(force_on(element.place, balanced.wrench, history), history)[1]
                seen = self._seen(element, motion)
                reading = reading + balanced.extension[:, [k]] * seen
                compliance = compliance + slope[:, None, None] * seen[:, :, None] * motion[:, None, :]
        turned = np.eye(6)
        for effect, v in own:
            turned = effect.imposed(turned, v)
        residual = errors.residual(observed.measured - of_gauges, reading)

        def exact(i: int) -> Array | None:
            """By a beam's modulus: of the logarithm of its compliance the negative."""
            c = unknowns[i]
            if not self.whole_beams or c.kind != Kind.MODULUS or c.subject not in beams:
                return None
            slope = errors.gain * by_beam[:, :, beams.index(c.subject)] * c.scale
            return np.where(np.isnan(observed.measured), 0.0, slope)

        return Evaluation(z, residual, reading, compliance @ turned.T, load, errors, exact)

    def _lookup(
        self, machine: ModifiedMachine, own: Sequence[tuple[Effect, Sequence[float]]], load: Array
    ) -> Found:
        """Equilibria under loads ``(n, 6)``; linear off the rays."""
        n, m = self.observed.measured.shape
        beams = len(machine.nominal.beams)
        shapes = (m,), (m, 6), (m, 6), (6,), (6, 6), (m, beams)
        result = tuple([np.zeros((n, *shape)) for shape in shapes])
        for ray in self.observed.rays:
            d, measure = ray.direction[None], ray.measure[None]
            for effect, v in own:
                d, measure = effect.imposed(d, v), effect.imposed(measure, v)
            s = load[ray.index] @ measure[0]
            for sign in (1.0, -1.0):
                side = s >= 0.0 if sign > 0.0 else s < 0.0
                if not side.any():
                    continue
                rows = ray.index[side]
                table = self._table(machine, HalfRay.of(ray.posture, sign * d[0], self._reach(ray, sign)))
                for target, values in zip(result, table.at(np.abs(s[side])), strict=True):
                    target[rows] = values
                off = load[rows] - s[side, None] * d[0]
                result[0][rows] += np.einsum("nij,nj->ni", result[1][rows], off)
                result[3][rows] += off
        return result

    def _crept(self, moved: Array, r: Relaxation) -> Array:
        """What gauges read ``(n, m)`` more since the stress of a beam relaxes: it deflects by its share, and later.

        Of what is linear in the beam's compliance; its relaxing shares φ and times τ are then delayed compliances
        ``φ/(1 − Σφ)`` and times ``τ/(1 − Σφ)`` under a load that does not depend on it. ``moved`` (n, m) is what
        they read by the logarithm of the beam's compliance.
        """
        rest = 1.0 - sum(r.shares)
        terms = zip(r.shares, r.times, strict=True)
        laws = [retarded(share / rest, time / rest) for share, time in terms]
        columns = [sum(law(column, self.observed.unloaded)[0] for law in laws) for column in moved.T]
        return np.column_stack(columns)

    def _reach(self, ray: Ray, sign: float) -> float:
        """How far a table goes: as far as the readings of every run along one ray, and their errors."""
        alike = [
            r for r in self.observed.rays if r.posture == ray.posture and np.array_equal(r.direction, ray.direction)
        ]
        s = sign * np.concatenate([self.observed.imposed[r.index] @ r.measure for r in alike])
        return max(float(s.max()) * MARGIN, 0.02 * float(np.abs(s).max()))

    def _table(self, machine: ModifiedMachine, half: HalfRay) -> LoadedEquilibria:
        key = machine.key, half
        if key not in self._tables:
            pulls = machine.axial_signs(half.posture, np.array(half.direction[:3])) if machine.asymmetry else ()
            measurement = self.observed.measurement
            self._tables[key] = load_table(machine, half, pulls, measurement.free, self._gauges)
            if len(self._tables) > KEPT:
                self._tables.popitem(last=False)
        self._tables.move_to_end(key)
        return self._tables[key]

    @cached_property
    def _gauges(self) -> tuple[Gauge, ...]:
        return gauges_of(self.observed.measurement)

    def _seen(self, element: SeriesElement, motion: Array) -> Array:
        """What gauges read ``(n, m)`` where the end-effector moves by ``motion`` (n, 6) with an element."""
        result = np.zeros((len(motion), len(self._gauges)))
        for i, gauge in enumerate(self._gauges):
            if not self._carries(element.place, gauge):
                continue
            moved = motion.copy()
            moved[:, :3] += np.cross(motion[:, 3:], self._arms[:, i])
            result[:, i] = moved[:, gauge.component]
        return result

    @cached_property
    def _arms(self) -> Array:
        """From the end-effector to each gauge's point ``(n, m, 3)`` in the unloaded posture, mm."""
        machine = ModifiedMachine(self.observed.measurement.chain, self.observed.measurement.engine)
        labels = self.observed.readings.posture.tolist()
        arms = {}
        for label in dict.fromkeys(labels):
            model = machine.model(label)
            k = model.kinematics(model.configuration(model.chain.posture(label)))
            lever_arms = []
            for gauge in self._gauges:
                joint, offset = model.find(gauge.body, gauge.fraction)
                T = k.behind[joint + 1]
                lever_arms.append(T[:3, 3] + T[:3, :3] @ offset - k.end[:3, 3])
            arms[label] = np.array(lever_arms)
        return np.array([arms[label] for label in labels])

    def _carries(self, place: ElementSite, gauge: Gauge) -> bool:
        """Whether what deflects in a place moves a gauge's point: what slips along a link does so at its root."""
        if not gauge.body:
            return True
        chain = self.observed.measurement.chain
        order = [part.name for part in chain.parts]
        body = order.index(gauge.body)
        match place:
            case AtJoint(joint=joint):
                return order.index(joint) < body
            case AlongLine(link=link):
                return order.index(link or links_of(chain)[-1]) <= body
            case Behind(link=link):
                # a foot's tip carries its link
                return order.index(link or links_of(chain)[0]) <= body
            case AlongAxis() | AboutAxis():
                # a drive before all joints, and the base, carry everything
                return True
            case _:
                raise TypeError(f"a place of the kind {type(place).__name__} has no order among the parts")
