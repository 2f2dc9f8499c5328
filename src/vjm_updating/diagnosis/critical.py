"""Critical forces of a test's half-rays: measured, and predicted by the nominal and by the extended model.

What readings show is the knee of force over displacement; the same knee is sought in both models' predictions of
these readings, so that like is compared with like. Beside it stand the models' own critical points, located on
their paths as `validate buckling` does, which also reach where no reading was taken.
"""

from __future__ import annotations

import numpy as np

from vjm.continuation.arc_length import trace
from vjm.continuation.direction import DEFAULT_REACH_MM
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parameters import compliance_factor
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_updating.constants import numerical, shown
from vjm_updating.diagnosis.document import CriticalPointRow
from vjm_updating.diagnosis.extended import extended_chain
from vjm_updating.diagnosis.stress import First, first_yield
from vjm_updating.experiment.channels import WRENCH
from vjm_updating.experiment.rays import Ray
from vjm_updating.inference.fitting import Fit, Fitter
from vjm_updating.mechanisms.load_misalignment import LoadMisalignment
from vjm_updating.mechanisms.modified_chain import STANDARD_GRAVITY
from vjm_updating.mechanisms.path_table import first_force

LEAST = numerical(5)
"""Readings on either side of a knee."""
FURTHER = shown(1.5)
"""How far beyond the readings paths go."""


OwnPoint = tuple[str, float | None, First]
"""Kind of a model's own critical point (see `vjm.continuation.path.EventKind`) and its force in N, empty and None
where the path has none; and where the material yields."""


def knee(s: Array, force: Array) -> float | None:
    """Force at the knee of a curve ``(n,)`` that rises, bends once and goes on nearly level; None where none is.

    The best continuous pair of straight lines of which the second is nearer to level than to going on as before.
    """
    order = np.argsort(s)
    x, y = s[order], force[order]
    if len(x) < 2 * LEAST + 2:
        return None
    best: tuple[float, float] | None = None
    for at in x[LEAST:-LEAST]:
        X = np.column_stack([np.ones_like(x), np.minimum(x, at), np.maximum(x - at, 0.0)])
        c, *_ = np.linalg.lstsq(X, y, rcond=None)
        cost = float(np.sum((y - X @ c) ** 2))
        if c[1] > 0.0 and c[2] < c[1] - c[2] and (best is None or cost < best[0]):
            best = cost, float(c[0] + c[1] * at)
    straight = np.column_stack([np.ones_like(x), x])
    c, *_ = np.linalg.lstsq(straight, y, rcond=None)
    if best is None or best[0] > 0.5 * float(np.sum((y - straight @ c) ** 2)):
        return None
    return best[1]


def critical_points(fitter: Fitter, null: Fit, fit: Fit) -> list[CriticalPointRow]:
    """The test's half-rays: those with a measured critical force first, then by the extended model's own."""
    found: dict[tuple[str, str], CriticalPointRow] = {}
    for ray in fitter.forward.observed.rays:
        for sign in (1.0, -1.0):
            one = _half_ray(fitter, null, fit, ray, sign)
            if one is None:
                continue
            key = one.posture, one.direction
            if key not in found or found[key].measured_N is None:
                found[key] = one

    def order(one: CriticalPointRow) -> tuple[bool, float]:
        force = one.extended_N
        return one.measured_N is None, np.inf if force is None else force

    return sorted(found.values(), key=order)


def _half_ray(fitter: Fitter, null: Fit, fit: Fit, ray: Ray, sign: float) -> CriticalPointRow | None:
    observed = fitter.forward.observed
    c = int(np.argmax(np.abs(ray.direction[:3])))
    s = observed.pose[ray.index] @ ray.measure
    on = ray.index[(sign * s > 0.0) & observed.present[ray.index, c]]
    if not len(on) or WRENCH[c] not in observed.wrench_channels:
        return None
    u = sign * (observed.pose[on] @ ray.measure)
    way = sign * float(np.sign(ray.direction[c]))
    read = way * observed.wrench[on, c]
    measured = knee(u, read)
    before, after = (
        (knee(u, read - way * one.at.residual[on, c]) for one in (null, fit)) if measured else (None, None)
    )
    load_case = LoadCase(ray.posture, max(DEFAULT_REACH_MM, FURTHER * float(u.max())), tuple(sign * ray.direction))
    nominal, nominal_force, _ = _point(observed.measurement.engine, observed.measurement.chain, load_case)
    extended, extended_force, yields = _extended(fitter, fit, load_case)
    return CriticalPointRow(
        posture=ray.posture,
        direction=_words(sign * ray.direction),
        reached_N=float(read.max()),
        measured_N=measured,
        before_N=before,
        after_N=after,
        nominal=nominal,
        nominal_N=nominal_force,
        extended=extended,
        extended_N=extended_force,
        yields_N=yields.force,
        yields=yields.words,
    )


def _words(direction: Array) -> str:
    along = np.flatnonzero(direction)
    if along.tolist() == [0]:
        return "tension" if direction[0] > 0.0 else "compression"
    return "along " + ", ".join(f"{v:.3g}" for v in direction[:3])


def _extended(fitter: Fitter, fit: Fit, load_case: LoadCase) -> OwnPoint:
    """Critical point of the extended model, and where its material would yield on the way there."""
    machine = fitter.forward.machine(fit.found, fit.at.z, fit.hypothesis)
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


def _point(engine: VjmEngine, chain: Machine, load_case: LoadCase, fitter: Fitter | None = None) -> OwnPoint:
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
