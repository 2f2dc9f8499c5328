"""Tests in which the end-effector is taken along ramps of displacement and its wrench is read; other kinds differ.

Every step of a diagnosis asks the kind of test for what differs, and none asks which it is. A further kind is a
class with the methods that differ from those of `RampTest`, and a line in `vjm_updating.diagnosis.kinds`. Its sheet
and columns are those of ramps; CONTRIBUTING.md says what a kind with columns of its own needs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from vjm.continuation.arc_length import trace
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import DEFAULT_REACH_MM, LoadCase
from vjm.model.machine import Machine
from vjm.model.parameters import compliance_factor
from vjm.rotations import Array
from vjm_updating.calibration.calibrated_model import extended_chain
from vjm_updating.constants import numerical, prior_scale, shown
from vjm_updating.diagnosis.document import CriticalPointRow, ExperimentRow, ValueRow
from vjm_updating.diagnosis.evidence import Costs, ScoredModel
from vjm_updating.diagnosis.experiment import propose
from vjm_updating.diagnosis.holdout import HoldOut, hold_out, split_of
from vjm_updating.diagnosis.screening import far_off
from vjm_updating.diagnosis.search import Search
from vjm_updating.diagnosis.stress import First, first_yield
from vjm_updating.diagnosis.verdict import Verdict
from vjm_updating.experiment import Measurement
from vjm_updating.experiment.comparison import Ray
from vjm_updating.experiment.data_file import TIME, WRENCH, unit_of
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem
from vjm_updating.inference.forward import Forward, Predictor, observe_ramps
from vjm_updating.inference.instruments import LEVER, InstrumentScale, InstrumentZero, ThermalDrift
from vjm_updating.inference.observed import Observed
from vjm_updating.inference.parameters import Evaluation
from vjm_updating.mechanisms.catalogue import Maker, catalogue
from vjm_updating.mechanisms.effect import Effect, ExperimentContext
from vjm_updating.mechanisms.equilibrium_tables import first_force
from vjm_updating.mechanisms.loads import LoadMisalignment
from vjm_updating.mechanisms.modified_chain import STANDARD_GRAVITY

# --- Critical forces of a test's half-rays: measured, and predicted by the nominal and by the extended model ------
#
# What readings show is the knee of force over displacement; the same knee is sought in both models' predictions of
# these readings, so that like is compared with like. Beside it stand the models' own critical points, located on
# their paths as `validate buckling` does, which also reach where no reading was taken.

LEAST = numerical(5)
"""Readings on either side of a knee."""
FURTHER = shown(1.5)
"""How far beyond the readings paths go."""


OwnPoint = tuple[str, float | None, First]
"""Kind of a model's own critical point (see `vjm.continuation.path.EventKind`) and its force in N, empty and None
where the path has none; and where the material yields."""


def knee(s: Array, force: Array) -> tuple[float, float] | None:
    """Place and force of the knee of a curve ``(n,)`` that rises, bends once and goes on nearly level, if one is.

    Of a curve that is not known everywhere, nan, there is none. The best continuous pair of straight lines of which
    the second is nearer to level than to going on as before. The first begins where the ramp does: it is steeper
    than half of the way from there. A curve that bends on behind its knee has no second one.
    """
    order = np.argsort(s)
    x, y = s[order], force[order]
    if len(x) < 2 * LEAST + 2 or np.isnan(y).any():
        return None
    best: tuple[float, float, float] | None = None
    for knot in x[LEAST:-LEAST]:
        X = np.column_stack([np.ones_like(x), np.minimum(x, knot), np.maximum(x - knot, 0.0)])
        c, *_ = np.linalg.lstsq(X, y, rcond=None)
        cost = float(np.sum((y - X @ c) ** 2))
        begun = c[1] * knot > 0.5 * (c[0] + c[1] * knot) > 0.0
        if begun and c[2] < c[1] - c[2] and (best is None or cost < best[0]):
            best = cost, float(knot), float(c[0] + c[1] * knot)
    straight = np.column_stack([np.ones_like(x), x])
    c, *_ = np.linalg.lstsq(straight, y, rcond=None)
    if best is None or best[0] > 0.5 * float(np.sum((y - straight @ c) ** 2)):
        return None
    return best[1:]


def _curve(observed: Observed, ray: Ray, sign: float) -> tuple[int, float, np.ndarray, Array, Array]:
    """One side of a ray as a curve of force by displacement, both positive outwards.

    Returns:
        The channel of the force and its sign on this side. Of the readings ``(k,)`` their indices, displacements in
        mm or rad, and forces in N.
    """
    c = int(np.argmax(np.abs(ray.direction[:3])))
    on = ray.index[(sign * (observed.imposed[ray.index] @ ray.measure) > 0.0) & observed.present[ray.index, c]]
    way = sign * float(np.sign(ray.direction[c]))
    return c, way, on, sign * (observed.imposed[on] @ ray.measure), way * observed.measured[on, c]


def _half_ray(fitter: LeastSquaresProblem, null: Fit, fit: Fit, ray: Ray, sign: float) -> CriticalPointRow | None:
    observed = fitter.forward.observed
    c, way, on, u, read = _curve(observed, ray, sign)
    if not len(on) or WRENCH[c] not in observed.wrench_channels:
        return None
    measured = knee(u, read)
    before, after = (
        (knee(u, read - way * one.evaluation.residual[on, c]) for one in (null, fit)) if measured else (None, None)
    )
    measured_force, before_force, after_force = (None if k is None else k[1] for k in (measured, before, after))
    load_case = LoadCase(ray.posture, max(DEFAULT_REACH_MM, FURTHER * float(u.max())), tuple(sign * ray.direction))
    nominal, nominal_force, _ = _point(observed.measurement.engine, observed.measurement.chain, load_case)
    extended, extended_force, yields = _extended(fitter, fit, load_case)
    return CriticalPointRow(
        posture=ray.posture,
        direction=_words(sign * ray.direction),
        reached_N=float(read.max()),
        measured_N=measured_force,
        before_N=before_force,
        after_N=after_force,
        nominal=nominal,
        nominal_N=nominal_force,
        extended=extended,
        extended_N=extended_force,
        yields_N=yields.force,
        yields=yields.words,
    )


SOFTENED = numerical(1.0 / 3.0)
"""Tangent stiffness along a ray over that without load, below which a machine is behind its critical point."""
NEAR = numerical(0.9)
"""Displacement of a critical point of which readings that lie further are set aside for the first search."""


def behind(observed: Observed, evaluation: Evaluation) -> np.ndarray:
    """Readings ``(n,)`` behind a critical point of the model."""
    result = np.zeros(len(observed.imposed), dtype=bool)
    if observed.columns != WRENCH:
        # what was read is not the wrench of the displacement that was imposed: there is no tangent stiffness
        return result
    for ray in observed.rays:
        k = np.einsum("i,nij,j->n", ray.direction, evaluation.stiffness[ray.index], ray.direction)
        s = np.abs(observed.imposed[ray.index] @ ray.measure)
        result[ray.index] = k < SOFTENED * k[np.argmin(s)]
    return result


def _critical(observed: Observed, evaluation: Evaluation) -> np.ndarray:
    """Readings ``(n,)`` near a critical point or behind it, that of the model or one that the readings show."""
    result = np.zeros(len(observed.imposed), dtype=bool)
    if observed.columns != WRENCH:
        return result
    far = behind(observed, evaluation)
    for ray in observed.rays:
        for sign in (1.0, -1.0):
            _, _, on, u, read = _curve(observed, ray, sign)
            bent = knee(u, read)
            places = [*u[far[on]], *(() if bent is None else bent[:1])]
            if places:
                result[on[u > NEAR * min(places)]] = True
    return result


def _words(direction: Array) -> str:
    along = np.flatnonzero(direction)
    if along.tolist() == [0]:
        return "tension" if direction[0] > 0.0 else "compression"
    return "along " + ", ".join(f"{v:.3g}" for v in direction[:3])


def _extended(fitter: LeastSquaresProblem, fit: Fit, load_case: LoadCase) -> OwnPoint:
    """Critical point of the extended model, and where its material would yield on the way there."""
    machine = fitter.forward.machine(fit.parameters, fit.evaluation.z, fit.hypothesis)
    axis, gravity = np.array([load_case.axis], dtype=float), None
    for effect, values in zip(fit.hypothesis, fit.values, strict=True):
        if isinstance(effect, LoadMisalignment):
            axis = effect.imposed(axis, values)
    if any(mass for _, mass in machine.weight):
        x, y, z = (STANDARD_GRAVITY * g for g in machine.gravity)
        gravity = (x, y, z)
    own = LoadCase(load_case.posture, load_case.to, tuple(axis[0].tolist()), gravity=gravity)
    chain = extended_chain(fitter, fit)
    if machine.asymmetry:
        axial_signs = machine.axial_signs(load_case.posture, first_force(machine, load_case.posture, axis[0]))
        for (part, ratio), way in zip(machine.asymmetry, axial_signs, strict=True):
            # which no file can say; here the way is known
            chain = compliance_factor(chain, part).apply(chain, ratio ** (-0.5 * way))
    return _point(machine.engine, chain, own, fitter)


def _point(
    engine: VjmEngine, chain: Machine, load_case: LoadCase, fitter: LeastSquaresProblem | None = None
) -> OwnPoint:
    """The critical point of a path; with a fitter, whose document knows the material, where that yields."""
    try:
        problem = engine.problem(chain, load_case)
        path = trace(problem, load_case)
    except (NoConvergenceError, ValueError):
        return "", None, First(None, "not known: the model has no path here")
    event = path.critical
    kind, force = ("", None) if event is None else (str(event.kind), float(event.force))
    if fitter is None:
        return kind, force, First(None, "")
    return kind, force, first_yield(problem, path, fitter.forward.observed.measurement.document["parts"])


LONG_BEFORE = prior_scale(4.0)
"""Spans of a test that its clock may have run before at most: one that shows the date says nothing."""
MOST_PAIRS = shown(5)
"""Members of a class that the next experiment tells from the most probable one."""


class RampTest:
    """The kind that takes every test, and the base of the others."""

    name = "ramps"
    predictor: ClassVar[type[Predictor]] = Forward
    costs = Costs()
    takes_effects = True

    def applies(self, measurement: Measurement) -> bool:
        """To every test; `observe` refuses those without a displacement."""
        return True

    def observe(self, measurement: Measurement) -> Observed:
        """The readings to be explained: all with a displacement and a wrench, of a chain with a link that bends.

        Raises:
            ValueError: the test cannot be diagnosed; one line.
        """
        if not measurement.chain.beams:
            raise ValueError(
                f"{measurement.sheet.file}: [test] model: no link of {measurement.chain.name} bends, and causes in "
                'forces are sought along one. `validate calibrate` fits its joints, and a sheet of kind = "poses" '
                "diagnoses it"
            )
        return observe_ramps(measurement)

    def forward(self, observed: Observed) -> Predictor:
        """What predicts the readings."""
        return self.predictor(observed)

    def effects(self, observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
        """The machine's effects, those of ``more`` included where the kind takes them, and the instruments'."""
        return ramp_effects(observed, more)

    def without_outliers(self, observed: Observed, outliers: np.ndarray) -> Observed:
        """The readings that count, where samples ``(n, 6)`` stand out: the others."""
        return observed.without(outliers)

    def critical(self, observed: Observed, evaluation: Evaluation) -> np.ndarray:
        """Readings ``(n,)`` that a search begins without: near a critical point, or behind it.

        There a small error of any parameter changes the force by much, and every fit from afar ends too early. The
        ``evaluation`` is the nominal machine's.
        """
        return _critical(observed, evaluation)

    def reweighted(self, fitter: LeastSquaresProblem, everything: Observed, best: Fit) -> Observed | None:
        """All readings with the noise that a fit shows, the sheet's; None where it is too far off to show any."""
        return None if far_off(fitter, best) else everything

    def completed(self, search: Search, best: ScoredModel) -> ScoredModel:
        """The hypothesis that a search ends with, once what it leaves out on purpose was tried: nothing here."""
        return best

    def hold_out(self, fitter: LeastSquaresProblem, null: Fit) -> HoldOut:
        """Postures one at a time, else directions, cycles or every third reading."""
        return hold_out(fitter, null, split_of(fitter.forward.observed))

    def critical_points(self, fitter: LeastSquaresProblem, null: Fit, fit: Fit) -> list[CriticalPointRow]:
        """Critical loads of the half-rays: those with a measured one first, then by the extended model's own."""
        rows: dict[tuple[str, str], CriticalPointRow] = {}
        for ray in fitter.forward.observed.rays:
            for sign in (1.0, -1.0):
                one = _half_ray(fitter, null, fit, ray, sign)
                if one is None:
                    continue
                key = one.posture, one.direction
                if key not in rows or rows[key].measured_N is None:
                    rows[key] = one

        def order(one: CriticalPointRow) -> tuple[bool, float]:
            force = one.extended_N
            return one.measured_N is None, np.inf if force is None else force

        return sorted(rows.values(), key=order)

    def parameters(
        self, fitter: LeastSquaresProblem, fit: Fit, values: Mapping[str, ValueRow]
    ) -> dict[str, ValueRow | str]:
        """What follows from a fit's parameters in a test of this kind: nothing beyond the causes' own."""
        return {}

    def scatter(self, observed: Observed) -> str:
        """In words, how far noise that was found exceeds the sheet's; empty: here the sheet's is kept."""
        return ""

    def next_experiment(self, fitter: LeastSquaresProblem, verdict: Verdict) -> ExperimentRow:
        """Posture, direction, cycles and holds that tell the most probable member from the others."""
        first = verdict.members[0]
        others: dict[frozenset[str], Fit] = {}
        for member in verdict.members:
            if member.causes != first.causes and len(others) < MOST_PAIRS:
                others.setdefault(member.causes, member.fit)
        proposal = propose(fitter, [first.fit, *others.values()])
        one, *rest = (" + ".join(sorted(causes)) for causes in (first.causes, *others))
        reason = f"tells {one} from {' and from '.join(rest)}"
        if proposal is None:
            return ExperimentRow(why=f"no ramp in a posture of the model {reason} by more than the noise")
        why = f"it {reason}: {proposal.channel} would differ by up to {proposal.difference:.3g}"
        return proposal.model_copy(update={"why": why})


def ramp_effects(observed: Observed, more: Sequence[Maker] = ()) -> list[Effect]:
    """The catalogue of a ramp test: the machine's effects, and the instruments'."""
    force = float(np.nanmax(np.linalg.norm(np.nan_to_num(observed.measured[:, :3]), axis=1)))
    gravity = observed.measurement.sheet.test.gravity
    scene = replace(
        scene_of(observed, max(force, 1.0), float(np.abs(observed.imposed[:, :3]).max())),
        gravity=None if gravity is None else (gravity[0], gravity[1], gravity[2]),
    )
    return [*catalogue(scene, more), *instrument_effects(observed, scene.duration, _largest(observed, scene))]


def scene_of(observed: Observed, force: float, reach: float) -> ExperimentContext:
    """A test as its effects take it, without gravity; its largest force in N, and how far it moved, mm."""
    measurement, clock = observed.measurement, observed.clock
    return ExperimentContext(
        chain=measurement.chain,
        engine=measurement.engine,
        force=force,
        reach=reach,
        duration=0.0 if clock is None else float(np.ptp(clock)),
        interval=0.0 if clock is None else float(np.median(np.diff(clock))),
        rays=tuple((ray.posture, tuple(ray.direction.tolist())) for ray in observed.rays),
    )


def instrument_effects(observed: Observed, duration: float, largest: Mapping[str, float]) -> list[Effect]:
    """Errors of every channel.

    ``duration`` is in s, zero where there is no clock; ``largest`` has by unit the reading that gauges are made
    for.
    """
    effects: list[Effect] = []
    for channel in (*observed.pose_channels, *observed.wrench_channels):
        effects += [InstrumentZero(part=channel), InstrumentScale(part=channel)]
        most = largest[unit_of(channel)]
        if observed.warmth is not None:
            span = float(np.ptp(observed.warmth))
            effects.append(ThermalDrift(channel, "K", span, duration=duration, largest=most))
        if observed.clock is not None:
            span, first = float(np.ptp(observed.clock)), float(observed.readings.values[TIME][0])
            since = float(np.clip(first / span, 0.0, LONG_BEFORE))
            effects.append(ThermalDrift(channel, "s", span, since=since, largest=most))
    return effects


def _largest(observed: Observed, scene: ExperimentContext) -> dict[str, float]:
    """The largest reading by its unit: what gauges of that kind are made for."""
    moment = float(np.abs(np.nan_to_num(observed.measured[:, 3:])).max())
    turn = float(np.abs(observed.imposed[:, 3:]).max())
    return {"N": scene.force, "Nmm": max(moment, LEVER * scene.force), "mm": scene.reach, "rad": turn or np.inf}
