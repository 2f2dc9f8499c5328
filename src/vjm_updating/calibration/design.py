"""Which posture next: the experiment that shrinks what is uncertain most.

A candidate is a ramp with the channels and instruments of the test at hand. Added to it, it raises the information
of the posterior. D-optimal is the one that shrinks the volume of the parameters' covariance most, I-optimal the one
that shrinks the variance of one predicted figure most (Pukelsheim, *Optimal Design of Experiments*, 2006, ch. 6).
Zero and scale errors stay those of the test: the set-up is not taken down.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from vjm.continuation.direction import Direction
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, LoadCase
from vjm.model.machine import Machine
from vjm.plain_numbers import plain_number
from vjm.rotations import Array
from vjm_updating.calibration.carried import QUANTITIES, Predicted
from vjm_updating.calibration.document import ProposedRampRow
from vjm_updating.calibration.fit import CalibrationSolution
from vjm_updating.constants import numerical
from vjm_updating.inference.fitting import Fitter
from vjm_updating.observation.observed import planned

READINGS = numerical(20)
"""Of a candidate, evenly along its ramp."""
_RAMP = re.compile(r"(?P<posture>[A-Za-z][A-Za-z0-9_-]*):(?:(?P<axis>[a-z]+):)?(?P<to>[-+0-9.eE]+)")


def parsed_ramps(texts: Sequence[str], chain: Machine) -> list[LoadCase]:
    """Feasible ramps as ``POSTURE:END`` along x or ``POSTURE:AXIS:END``, mm or rad: ``D:-12``, ``B:y:2``.

    Raises:
        ValueError: one is none, or the chain has no such posture.
    """
    found = []
    for text in texts:
        match = _RAMP.fullmatch(text)
        axis = (match["axis"] or "x") if match else ""
        if match is None or axis not in COMPONENTS:
            raise ValueError(f"'{text}' is no ramp: write POSTURE:END or POSTURE:AXIS:END, such as D:-12 or B:y:2")
        if match["posture"] not in chain.postures:
            known = ", ".join(chain.postures)
            raise ValueError(
                f"'{text}': no posture '{match['posture']}' ({known}): add it to the sheet's [postures]"
            )
        try:
            found.append(LoadCase(match["posture"], plain_number(match["to"]), axis))
        except ValueError as error:
            raise ValueError(f"'{text}': {error}") from error
    return found


def usual_ramps(fit: CalibrationSolution) -> list[LoadCase]:
    """Every posture along x to both sides, as far as the test went in that posture, else on the average.

    Of a test by force: a force along each axis along which the end-effector is free, as large as the test's.
    """
    problem, chain = fit.problem, fit.problem.unknowns.chain
    if problem.observed.measurement.loaded:
        free = problem.observed.measurement.free
        largest = float(np.abs(problem.observed.pose[:, :3]).max())
        axes = [axis for axis in COMPONENTS[:3] if axis in free and largest > 0.0]
        return [LoadCase(posture, largest, axis) for posture in chain.postures for axis in axes]
    ends: dict[tuple[str, float], float] = {}
    for ray in problem.observed.rays:
        for value in problem.observed.pose[ray.index, 0]:
            key = (ray.posture, float(np.sign(value)))
            ends[key] = max(ends.get(key, 0.0), abs(float(value)))
    least = 1e-3 * chain.characteristic_length
    usual = max(float(np.mean(list(ends.values()) or [0.0])), least)
    return [
        LoadCase(posture, way.sign * max(ends.get((posture, way.sign), usual), least))
        for posture in chain.postures
        for way in Direction
    ]


def in_view(figures: Sequence[Predicted], covariance: Array, wanted: str = "") -> Predicted | None:
    """The figure that is to become certain.

    Args:
        figures: predicted ones.
        covariance: of what they depend on.
        wanted: ``POSTURE:DIRECTION:QUANTITY``, such as ``D:compression:F_cr``; by default the critical force that
            is known worst, relative to its value.

    Raises:
        ValueError: there is no such figure, or no derivative of it.
    """
    known = [f for f in figures if np.isfinite(f.std(covariance))]
    if wanted:
        chosen = next((f for f in known if wanted == label(f)), None)
        if chosen is None:
            raise ValueError(
                f"'{wanted}' is no predicted figure with a derivative: write POSTURE:DIRECTION:QUANTITY with one "
                f"of {', '.join(QUANTITIES)}; there are {', '.join(label(f) for f in known)}"
            )
        return chosen
    forces = [f for f in known if f.quantity == "F_cr"] or known
    return max(forces, key=lambda f: f.std(covariance) / abs(f.value), default=None)


def label(figure: Predicted) -> str:
    """``D:compression:F_cr``."""
    return f"{figure.posture}:{figure.direction}:{figure.quantity}"


def candidates(
    fit: CalibrationSolution, target: Predicted | None, ramps: Sequence[LoadCase]
) -> tuple[list[ProposedRampRow], list[str]]:
    """What each ramp would bring, the best for the parameters first, and the ramps that the model cannot follow."""
    unknowns = fit.problem.unknowns
    before = np.linalg.inv(fit.covariance)
    p = unknowns.parameters
    slope = np.zeros(len(unknowns))
    if target is not None:
        slope[unknowns.on_chain] = np.nan_to_num(target.gradient)
    found, left_out = [], []
    for ramp in ramps:
        try:
            more = _information(fit, ramp)
        except (NoConvergenceError, np.linalg.LinAlgError, ValueError) as error:
            left_out.append(f"{named(ramp)}: {' '.join(str(error).split())}")
            continue
        after = np.linalg.inv(before + more)
        volume = np.linalg.slogdet(after[:p, :p])[1] - np.linalg.slogdet(fit.covariance[:p, :p])[1]
        found.append(
            ProposedRampRow(
                posture=ramp.posture,
                ramp=f"{ramp.axis}:{ramp.to:.4g}",
                parameters_shrink_to=float(np.exp(0.5 * volume / max(p, 1))),
                figure_std=float(np.sqrt(slope @ after @ slope)) if target is not None else None,
            )
        )
    return sorted(found, key=lambda row: row.parameters_shrink_to), left_out


def named(ramp: LoadCase) -> str:
    """``D:x:-12``."""
    return f"{ramp.posture}:{ramp.axis}:{ramp.to:g}"


def _information(fit: CalibrationSolution, ramp: LoadCase) -> Array:
    """What the readings of a candidate would say ``(n_z, n_z)``."""
    places = np.linspace(0.0, ramp.to, READINGS + 1)[1:]
    observed = planned(fit.problem.observed, ramp.posture, np.abs(ramp.direction), places)
    found = fit.problem.unknowns.all
    own = Fitter(fit.problem.forward(observed), found, fit.whitening.reading(observed), fit.fitter.rounding)
    at = own.forward.evaluate(found, fit.z, ())
    own.weigh(at)
    J = own.whitening.flat(own.slopes(found, at, ()))
    result: Array = J.T @ J
    return result
