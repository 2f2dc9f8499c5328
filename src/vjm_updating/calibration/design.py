"""What a calibration predicts, with its uncertainty, and the next experiment that shrinks it most.

The uncertainty is carried through to unloaded stiffness and critical points.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.continuation.path import Path
from vjm.design.critical import event_rates
from vjm.design.linear_state import loaded_posture
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import COMPONENTS, Direction, LoadCase, ramp_end
from vjm.model.machine import Machine
from vjm.model.parameters import Parameter, compliance_entry, section_value
from vjm.plain_numbers import plain_number
from vjm.rotations import Array
from vjm_updating.calibration.document import ProposedRampRow
from vjm_updating.calibration.fit import CalibrationSolution
from vjm_updating.calibration.parameters import split_parts, unknowns
from vjm_updating.constants import numerical
from vjm_updating.experiment import Measurement
from vjm_updating.identify.rounding import PrintedEntry, printed_entries
from vjm_updating.inference.fitting import LeastSquaresProblem
from vjm_updating.inference.observed import planned

QUANTITIES = {"K0": "N/mm", "F_cr": "N", "d_cr": "mm"}
STEP = numerical(1e-4)
"""Of the central differences of the unloaded stiffness, in a parameter's scale."""
PRINTED, LINK = "orthoglide-chain", "link"
"""The model whose matrices are printed to two digits, and the part whose section is quotients of the diagonal."""
QUOTIENTS = {0: "EA", 3: "GJ", 4: "EIy", 5: "EIz"}
"""Entries of that diagonal."""


@dataclass(frozen=True)
class Predicted:
    """One figure of one path, and how it depends on what is not known exactly.

    Attributes:
        posture: label.
        direction: tension or compression.
        quantity: one of `QUANTITIES`.
        kind: of the critical point; empty for K0.
        value: N/mm, N or mm.
        gradient: by the parameters ``(m,)``, nan where there is no derivative.
        reasons: why there is none, by parameter; empty where there is.
    """

    posture: str
    direction: Direction
    quantity: str
    kind: str
    value: float
    gradient: Array
    reasons: tuple[str, ...]

    def std(self, covariance: Array) -> float:
        """Standard deviation under the parameters' covariance ``(m, m)``; nan where a needed slope is missing."""
        moving = np.diagonal(covariance) > 0.0
        if np.isnan(self.gradient[moving]).any():
            return float("nan")
        g = np.where(moving, np.nan_to_num(self.gradient), 0.0)
        return float(np.sqrt(max(float(g @ covariance @ g), 0.0)))


def paths_of(chain: Machine, engine: VjmEngine) -> dict[tuple[str, Direction], Path]:
    """The comparison's path of every posture and direction that has one."""
    paths = {}
    for posture in chain.postures:
        for direction in Direction:
            try:
                paths[posture, direction] = engine.trace(
                    chain, LoadCase(posture, ramp_end(chain, posture, direction))
                )
            except (NoConvergenceError, ValueError):
                continue
    return paths


def predicted(chain: Machine, engine: VjmEngine, parameters: Sequence[Parameter]) -> list[Predicted]:
    """Every figure of every path of a chain, with its derivatives by the parameters."""
    result, nothing = [], ("",) * len(parameters)
    paths = paths_of(chain, engine)
    asked = {
        posture: loaded_posture(chain, posture, displacement=(0.0,) * 6, engine=engine) for posture, _ in paths
    }
    K0 = {posture: _unloaded_slopes(chain, engine, posture, parameters) for posture in asked}
    for (posture, direction), path in paths.items():
        result.append(Predicted(posture, direction, "K0", "", path.points[0].tangent, K0[posture], nothing))
        if path.critical is None:
            continue
        try:
            rates = event_rates(asked[posture], path, parameters, K0[posture])
        except (ValueError, np.linalg.LinAlgError):
            continue
        for quantity, value, slope in (
            ("F_cr", path.critical.force, rates.force),
            ("d_cr", path.critical.s, rates.s),
        ):
            kind = str(path.critical.kind)
            result.append(Predicted(posture, direction, quantity, kind, value, slope, rates.reasons))
    return result


def _unloaded_slopes(chain: Machine, engine: VjmEngine, posture: str, parameters: Sequence[Parameter]) -> Array:
    load_case = LoadCase(posture, 1.0)  # to the other side it is the same
    result = np.zeros(len(parameters))
    for i, parameter in enumerate(parameters):
        h = STEP * parameter.scale
        more, less = (
            engine.problem(parameter.apply(chain, parameter.value + sign * h), load_case).unloaded().tangent
            for sign in (1.0, -1.0)
        )
        result[i] = (more - less) / (2.0 * h)
    return result


def _entry(chain: Machine, entry: PrintedEntry) -> float:
    beam = next(beam for beam in chain.beams if beam.name == entry.part)
    assert beam.compliance is not None
    return float(beam.compliance[entry.row, entry.column])


def after_calibration(fit: CalibrationSolution) -> tuple[list[Predicted], Array, list[str]]:
    """Figures of the calibrated machine, the covariance of what they depend on, and its names."""
    unknowns, on_chain = fit.problem.unknowns, fit.problem.unknowns.on_chain
    chain = unknowns.build(fit.z)
    figures = predicted(chain, fit.problem.engine, unknowns.sensitivity_parameters(fit.z))
    return figures, fit.covariance[np.ix_(on_chain, on_chain)], [unknowns.all[i].name for i in on_chain]


def within_tolerances(measurement: Measurement) -> tuple[list[Predicted], Array, list[str]]:
    """Figures of the nominal machine within what its manufacturer promises."""
    machine = [n for n in measurement.nuisances if n.of_machine]
    coordinates = unknowns(measurement.chain, measurement.engine, (), machine)
    z = np.zeros(len(coordinates))
    figures = predicted(measurement.chain, measurement.engine, coordinates.sensitivity_parameters(z))
    return figures, np.diag(coordinates.sigma**2), [unknown.name for unknown in coordinates.all]


def within_rounding(measurement: Measurement) -> tuple[list[Predicted], Array, list[str]]:
    """Figures of the nominal machine within the rounding of the printed matrices that its springs take.

    An entry is off by up to half a unit of its last digit, evenly and independently of the others. A link that is
    split has its section from the diagonal of (20), and its rounding from there; a foot that is split is a fit to
    the whole of (19), whose rounding is not carried.
    """
    chain, engine = measurement.chain, measurement.engine
    if chain.name != PRINTED:
        return [], np.zeros((0, 0)), []
    by_section = split_parts(engine, chain)
    parameters, widths = [], []
    for entry in printed_entries(chain):
        if entry.part not in by_section:
            parameters.append(compliance_entry(chain, entry.part, entry.row + 1, entry.column + 1))
            widths.append(entry.half_unit)
        elif entry.part == LINK and entry.row == entry.column and entry.row in QUOTIENTS:
            # L over the printed entry: off by the same share
            parameter = section_value(chain, entry.part, QUOTIENTS[entry.row])
            parameters.append(parameter)
            widths.append(parameter.value * entry.half_unit / _entry(chain, entry))
    variance = np.array(widths) ** 2 / 3.0
    return predicted(chain, engine, parameters), np.diag(variance), [p.name for p in parameters]


READINGS = numerical(20)
"""Of a candidate, evenly along its ramp."""
_RAMP = re.compile(r"(?P<posture>[A-Za-z][A-Za-z0-9_-]*):(?:(?P<axis>[a-z]+):)?(?P<to>[-+0-9.eE]+)")


def parsed_ramps(texts: Sequence[str], chain: Machine) -> list[LoadCase]:
    """Feasible ramps as ``POSTURE:END`` along x or ``POSTURE:AXIS:END``, mm or rad: ``D:-12``, ``B:y:2``.

    Raises:
        ValueError: one is none, or the chain has no such posture.
    """
    ramps = []
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
            ramps.append(LoadCase(match["posture"], plain_number(match["to"]), axis))
        except ValueError as error:
            raise ValueError(f"'{text}': {error}") from error
    return ramps


def usual_ramps(fit: CalibrationSolution) -> list[LoadCase]:
    """Every posture along x to both sides, as far as the test went in that posture, else on the average.

    Of a test by force: a force along each axis along which the end-effector is free, as large as the test's.
    """
    problem, chain = fit.problem, fit.problem.unknowns.chain
    if problem.observed.measurement.loaded:
        free = problem.observed.measurement.free
        largest = float(np.abs(problem.observed.imposed[:, :3]).max())
        axes = [axis for axis in COMPONENTS[:3] if axis in free and largest > 0.0]
        return [LoadCase(posture, largest, axis) for posture in chain.postures for axis in axes]
    ends: dict[tuple[str, float], float] = {}
    for ray in problem.observed.rays:
        for value in problem.observed.imposed[ray.index, 0]:
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
    rows, left_out = [], []
    for ramp in ramps:
        try:
            more = _information(fit, ramp)
        except (NoConvergenceError, np.linalg.LinAlgError, ValueError) as error:
            left_out.append(f"{named(ramp)}: {' '.join(str(error).split())}")
            continue
        after = np.linalg.inv(before + more)
        volume = np.linalg.slogdet(after[:p, :p])[1] - np.linalg.slogdet(fit.covariance[:p, :p])[1]
        rows.append(
            ProposedRampRow(
                posture=ramp.posture,
                ramp=f"{ramp.axis}:{ramp.to:.4g}",
                parameters_shrink_to=float(np.exp(0.5 * volume / max(p, 1))),
                figure_std=float(np.sqrt(slope @ after @ slope)) if target is not None else None,
            )
        )
    return sorted(rows, key=lambda row: row.parameters_shrink_to), left_out


def named(ramp: LoadCase) -> str:
    """``D:x:-12``."""
    return f"{ramp.posture}:{ramp.axis}:{ramp.to:g}"


def _information(fit: CalibrationSolution, ramp: LoadCase) -> Array:
    """What the readings of a candidate would say ``(n_z, n_z)``."""
    places = np.linspace(0.0, ramp.to, READINGS + 1)[1:]
    observed = planned(fit.problem.observed, ramp.posture, np.abs(ramp.direction), places)
    unknowns = fit.problem.unknowns.all
    own = LeastSquaresProblem(
        fit.problem.forward(observed), unknowns, fit.whitening.reading(observed), fit.fitter.rounding
    )
    evaluation = own.forward.evaluate(unknowns, fit.z, ())
    own.weigh(evaluation)
    J = own.whitening.flat(own.slopes(unknowns, evaluation, ()))
    return J.T @ J
