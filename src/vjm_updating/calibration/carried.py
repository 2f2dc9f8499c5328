"""Uncertainty carried through to what the machine will do: unloaded stiffness and critical points.

To first order, with the exact derivatives of `vjm.sensitivity.gradients` at the critical points. Three sources,
each on its
own: what the calibration leaves open, what the sheet's tolerances allow of the nominal machine, and what the
rounding of the printed matrices (19) and (20) hides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.continuation.direction import Direction, ramp_end
from vjm.continuation.path import Path
from vjm.errors import NoConvergenceError
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parameters import Parameter, compliance_entry, section_value
from vjm.rotations import Array
from vjm.sensitivity.gradients import NOT_SERIAL, by_posture
from vjm.vjm_engine import VjmEngine
from vjm_updating.calibration.fit import CalibrationSolution
from vjm_updating.calibration.parameters import split_parts, unknowns
from vjm_updating.constants import numerical
from vjm_updating.experiment import Measurement
from vjm_updating.identify.rounding import PrintedEntry, printed_entries

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
    found = {}
    for posture in chain.postures:
        for direction in Direction:
            try:
                found[posture, direction] = engine.trace(
                    chain, LoadCase(posture, ramp_end(chain, posture, direction))
                )
            except (NoConvergenceError, ValueError):
                continue
    return found


def predicted(chain: Machine, engine: VjmEngine, parameters: Sequence[Parameter]) -> list[Predicted]:
    """Every figure of every path of a chain, with its derivatives by the parameters."""
    sensitivity = by_posture(engine, chain, parameters)
    result, nothing = [], ("",) * len(parameters)
    paths = paths_of(chain, engine)
    K0 = {posture: _unloaded_slopes(chain, engine, posture, parameters) for posture, _ in paths}
    for (posture, direction), path in paths.items():
        result.append(Predicted(posture, direction, "K0", "", path.points[0].tangent, K0[posture], nothing))
        if path.critical is None:
            continue
        if chain.is_tree:
            unknown = np.full(len(parameters), np.nan)
            by_force, by_s, reasons = unknown, unknown, (NOT_SERIAL,) * len(parameters)
        else:
            try:
                found = sensitivity(posture).critical(path)[0]
            except (ValueError, np.linalg.LinAlgError):
                continue
            by_force, by_s, reasons = found.force, found.s, found.reasons
        for quantity, value, slope in (
            ("F_cr", path.critical.force, by_force),
            ("d_cr", path.critical.s, by_s),
        ):
            result.append(Predicted(posture, direction, quantity, str(path.critical.kind), value, slope, reasons))
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
    found, at = fit.problem.unknowns, fit.problem.unknowns.on_chain
    chain = found.build(fit.z)
    figures = predicted(chain, fit.problem.engine, found.sensitivity_parameters(fit.z))
    return figures, fit.covariance[np.ix_(at, at)], [found.all[i].name for i in at]


def within_tolerances(measurement: Measurement) -> tuple[list[Predicted], Array, list[str]]:
    """Figures of the nominal machine within what its manufacturer promises."""
    machine = [n for n in measurement.nuisances if n.of_machine]
    found = unknowns(measurement.chain, measurement.engine, (), machine)
    z = np.zeros(len(found))
    figures = predicted(measurement.chain, measurement.engine, found.sensitivity_parameters(z))
    return figures, np.diag(found.sigma**2), [unknown.name for unknown in found.all]


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
