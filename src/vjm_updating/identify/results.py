"""What was found, as parts of the document."""

from __future__ import annotations

import numpy as np

from vjm.rotations import Array
from vjm_updating.constants import shown
from vjm_updating.identify.candidates import Form, Target, as_people_write_it
from vjm_updating.identify.experiments import ComplianceMeasurement
from vjm_updating.identify.fitting import FormSearch, search
from vjm_updating.identify.matrix_file import RawMatrix, entry_name
from vjm_updating.identify.ranges import STIFFNESSES, Range, ranges
from vjm_updating.identify.report import (
    BeamDocument,
    ExperimentsDocument,
    RangeDocument,
    ReferenceDocument,
    RepairDocument,
)
from vjm_updating.identify.sanity import Repair

MOST_DIGITS = shown(9)
"""Of a model file's entries; more were computed, not printed."""


def searches(aim: Target) -> list[FormSearch]:
    """Searches over the forms of beam, from the simplest on, as far as the first that meets every entry."""
    found: list[FormSearch] = []
    for form in Form:
        found.append(search(aim, form))
        if found[-1].met:
            break
    return found


def beam_document(found: FormSearch) -> BeamDocument:
    """A search's beam, and how wide the set around it is."""
    fit = found.beam
    beam = as_people_write_it(fit.beam)
    section = beam.section
    assert section is not None
    misfit, aim = fit.misfit, fit.space.target
    open_ = np.where(np.isfinite(aim.half), aim.half, 0.0)

    def shown(stiffness: float, *, turn: bool) -> float | None:
        return stiffness if fit.space.shows(beam.length / stiffness, turn=turn) else None

    i, j = divmod(int(np.argmax(np.abs(misfit))), 6)
    widths = ranges([one for one in (found.nearest, *found.levelled) if one.met])
    return BeamDocument(
        form=fit.space.form.value,
        met=found.met,
        smallest_worst_misfit=found.worst,
        length_mm=beam.length,
        direction=beam.section_frame[:, 0].tolist(),
        section_axes=beam.section_frame.tolist(),
        offset_mm=beam.end_offset.tolist(),
        EA_N=shown(section.EA, turn=False),
        GJ_Nmm2=shown(section.GJ, turn=True),
        EIy_Nmm2=shown(section.EIy, turn=True),
        EIz_Nmm2=shown(section.EIz, turn=True),
        GAy_N=_finite(section.GAy),
        GAz_N=_finite(section.GAz),
        compliance=beam.beam_compliance().tolist(),
        misfit=misfit.tolist(),
        worst_entry=entry_name(min(i, j), max(i, j)),
        worst_misfit=fit.worst,
        worst_scaled=float(np.max(np.abs(misfit) * open_ / scaling(aim.matrix))),
        ranges={name: RangeDocument(low=r.low, high=_finite(r.high)) for name, r in widths.items()},
        not_identifiable=_not_identifiable(widths, fit.space.form),
    )


def _not_identifiable(widths: dict[str, Range], form: Form) -> list[str]:
    """Names of what the entries do not tell, where some beam meets them."""
    if not widths:
        return []
    names = [name for name in STIFFNESSES if name in widths and not widths[name].identifiable]
    # without a range of their own: no beam of this form needs them
    names += [] if form is Form.SHEARED else ["GAy_N", "GAz_N"]
    y, z = widths["EIy_Nmm2"], widths["EIz_Nmm2"]
    if min(y.high, z.high) > max(y.low, z.low):
        names.append("section's turn about the beam")
    return names


def experiments_document(found: ComplianceMeasurement, meshes: tuple[int, int, int]) -> ExperimentsDocument:
    """How a compliance was measured."""
    scale = scaling(found.compliance)
    return ExperimentsDocument(
        elements=list(meshes),
        loads=found.loads.tolist(),
        linearity=float(np.max(found.linearity / scale)),
        discretisation=float(np.max(found.discretisation / scale)),
        rounding=float(np.max(found.rounding / scale)),
        order=found.order,
        extrapolated=found.extrapolated,
        asymmetry=found.asymmetry,
        smallest_eigenvalue=found.smallest_eigenvalue,
        positive_definite=found.smallest_eigenvalue > 0.0,
    )


def reference_document(name: str, reference: Array, found: Array, *, printed: bool) -> ReferenceDocument:
    """Another matrix ``(6, 6)`` of the part beside the one found.

    Args:
        name: of the reference.
        reference: its entries.
        found: the identified compliance.
        printed: whether its entries are rounded ones, with as many digits as the longest of them has.
    """
    digits = _digits(reference) if printed else None
    outside = {}
    if digits is not None:
        with np.errstate(divide="ignore"):
            half = 0.5 * 10.0 ** (np.floor(np.log10(np.abs(reference))) - digits + 1)
        # a printed zero is zero within what its row's and column's diagonal entries resolve
        half = np.where(reference == 0.0, np.sqrt(np.outer(np.diag(half), np.diag(half))), half)
        misses = (found - reference) / half
        outside = {
            entry_name(i, j): float(misses[i, j]) for i in range(6) for j in range(i, 6) if abs(misses[i, j]) > 1.0
        }
    difference = float(np.max(np.abs(found - reference) / scaling(reference)))
    return ReferenceDocument(
        name=name, compliance=reference.tolist(), difference=difference, digits=digits, outside=outside
    )


def repair_document(raw: RawMatrix, repair: Repair, others: Range | None = None) -> RepairDocument:
    """A tried change, and the range of its entry over the beams that meet all others."""
    i, j = repair.entry
    return RepairDocument(
        entry=entry_name(i, j),
        written=raw.texts[i][j],
        proposed=repair.value,
        worst_misfit=_finite(repair.worst),
        form=repair.form.value,
        makes_a_beam=repair.makes_a_beam,
        others_low=None if others is None else others.low,
        others_high=None if others is None else others.high,
    )


def intervals(half: Array) -> list[list[float | None]]:
    """Half-intervals, none for an entry that was left out."""
    return [[_finite(value) for value in row] for row in half.tolist()]


def scaling(compliance: Array) -> Array:
    """√(c_ii c_jj) ``(6, 6)``, by which entries of different units become comparable."""
    result: Array = np.sqrt(np.outer(np.diag(compliance), np.diag(compliance)))
    return result


def _digits(matrix: Array) -> int | None:
    """Significant digits that the longest entry needs: those to which all were rounded; None for computed ones."""
    digits = max(
        next(n for n in range(1, 18) if float(f"{value:.{n - 1}e}") == value) for value in matrix[matrix != 0.0]
    )
    return digits if digits <= MOST_DIGITS else None


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
