"""What was identified: the JSON document and its parts, and sentences and tables for people."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from pydantic import Field
from rich.box import SIMPLE
from rich.console import Console

from vjm.io.errors import printed
from vjm.rotations import Array
from vjm_output.documents import DoubtRow, Matrix, Row
from vjm_output.terminal import TerminalTable
from vjm_updating.constants import shown
from vjm_updating.identify.beam_fit import (
    STIFFNESSES,
    Form,
    FormSearch,
    Range,
    Target,
    as_people_write_it,
    ranges,
    search,
)
from vjm_updating.identify.experiments import ComplianceMeasurement
from vjm_updating.identify.matrix_file import RawMatrix, asymmetric_pairs, entry_name

# --- The JSON document that ``validate identify --json`` prints; N, mm, rad; entries count from 1 -----------------


class ExperimentsDocument(Row):
    """How the compliance was measured; scaled means over √(c_ii c_jj)."""

    elements: list[int]
    """Of every beam, mesh by mesh."""
    loads: list[float]
    """Sizes of the larger loads by direction, N and N mm; the smaller ones are half of them; both signs act."""
    linearity: float
    """Largest scaled change that the smaller loads made, which was taken out."""
    discretisation: float
    """Largest scaled bound on what the finest mesh leaves open."""
    rounding: float
    """Largest scaled uncertainty by rounding."""
    order: float | None
    """Observed over the meshes; null where they agree to rounding, or too irregularly to see one."""
    extrapolated: bool
    asymmetry: float
    """Largest scaled difference of mirrored entries, removed by taking their mean."""
    smallest_eigenvalue: float
    """Of the scaled compliance."""
    positive_definite: bool


class ReferenceDocument(Row):
    """Another matrix of the same part, and how far the identified one is from it."""

    name: str
    """``beam theory``, or ``model file`` for the matrix that the file states."""
    compliance: Matrix
    difference: float
    """Largest, scaled over √(c_ii c_jj)."""
    digits: int | None
    """Significant digits of the reference, where it is printed."""
    outside: dict[str, float]
    """Entries that are not met within those digits: the miss in half units of the last one."""


class RangeDocument(Row):
    """Lowest and highest value over the beams found that meet every entry; null: no limit."""

    low: float
    high: float | None


class BeamDocument(Row):
    """The straight uniform beam of one form that suits the matrix best."""

    form: str
    met: bool
    """Whether it meets every entry within its interval."""
    smallest_worst_misfit: float
    """Of all beams of this form that were tried, the smallest largest misfit, in rounding half-widths."""
    length_mm: float
    direction: list[float]
    """Unit vector from root to end, in the matrix's axes."""
    section_axes: Matrix
    """Rotation from the section's axes, x along the beam, to the matrix's."""
    offset_mm: list[float]
    """Rigid, from the beam's end to the point where the matrix is read."""
    EA_N: float | None
    """Null where no entry tells it from infinity; so for all stiffnesses."""
    GJ_Nmm2: float | None
    EIy_Nmm2: float | None
    EIz_Nmm2: float | None
    GAy_N: float | None
    GAz_N: float | None
    compliance: Matrix
    misfit: Matrix
    """Of every entry, the beam's minus the matrix's, in rounding half-widths."""
    worst_entry: str
    worst_misfit: float
    """In rounding half-widths."""
    worst_scaled: float
    """The largest misfit over √(c_ii c_jj), of all entries."""
    ranges: dict[str, RangeDocument]
    """What the intervals leave open, where they are met; reached for certain, perhaps wider yet."""
    not_identifiable: list[str]


class IdentificationDocument(Row):
    """What ``validate identify --json`` prints."""

    version: str
    source: str
    """``part``: virtual experiments; ``matrix``: a file."""
    name: str
    """Of the part, or of the file."""
    model: str | None
    sha256: str
    """Of the model file or the matrix file; empty for a chain without a file."""
    axes: str
    kind: str
    """``compliance``, or ``stiffness`` where a file gave that and it was inverted."""
    rounding: str
    """Where the intervals come from."""
    compliance: Matrix
    """Symmetric; of a pair that was left out, the mean."""
    uncertainty: list[list[float | None]]
    """Half the interval for which each entry stands; null where the entry was left out of the fits."""
    experiments: ExperimentsDocument | None
    references: list[ReferenceDocument]
    beams: list[BeamDocument]
    """From the simplest form on, as far as the first that meets every entry."""
    findings: list[str]
    """The same in words."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


# --- What was identified, in sentences and tables for people ------------------------------------------------------

NOTHING = shown(1e-6)
"""Of mm and degrees: an exact zero with its rounding."""
NARROW = shown(1e-4)
"""Half-width of a range, relative, below which it is written as ±."""

_LABELS = {
    "length_mm": "length, mm",
    "azimuth_deg": "direction in the x–y plane, °",
    "elevation_deg": "direction out of it, °",
    "offset_x_mm": "offset x, mm",
    "offset_y_mm": "offset y, mm",
    "offset_z_mm": "offset z, mm",
    "EA_N": "EA, N",
    "GJ_Nmm2": "GJ, N mm²",
    "EIy_Nmm2": "EI_y, N mm²",
    "EIz_Nmm2": "EI_z, N mm²",
    "GAy_N": "GA_y, N",
    "GAz_N": "GA_z, N",
}


def of_experiments(test: ExperimentsDocument, references: Sequence[ReferenceDocument]) -> list[str]:
    """Sentences on how the compliance was measured and what it agrees with."""
    lines = [
        f"linear to {test.linearity:.1e}, the mesh known to {test.discretisation:.1e}, rounding "
        f"{test.rounding:.1e}; an asymmetry of {test.asymmetry:.1e} was removed (all over √(c_ii c_jj))"
    ]
    if test.order is not None:
        lines.append(
            f"order {test.order:.2f} over {', '.join(map(str, test.elements))} elements a piece, "
            + ("extrapolated" if test.extrapolated else "too irregular to extrapolate")
        )
    else:
        lines.append(f"meshes of {', '.join(map(str, test.elements))} elements a beam agree to rounding")
    if not test.positive_definite:
        lines.append(
            f"NOT positive definite: smallest scaled eigenvalue {test.smallest_eigenvalue:.1e}; the body does not "
            "deflect in some direction, or hardly"
        )
    for reference in references:
        line = f"{reference.name}: within {reference.difference:.1e}"
        if reference.digits is not None:
            met = (
                "every printed entry is met"
                if not reference.outside
                else "printed entries not met: "
                + ", ".join(
                    f"{entry} by {abs(miss):.1f} half units of its last digit"
                    for entry, miss in reference.outside.items()
                )
            )
            line += f"; to {reference.digits} digits {met}"
        lines.append(line)
    return lines


def of_matrix(raw: RawMatrix) -> list[str]:
    """A sentence on each pair of entries of a matrix that is not symmetric."""
    return [
        f"not symmetric: {entry_name(i, j)} = {raw.texts[i][j]} but {entry_name(j, i)} = {raw.texts[j][i]}: "
        "both are left out below"
        for i, j in asymmetric_pairs(raw)
    ]


def of_beams(beams: Sequence[BeamDocument]) -> list[str]:
    """A sentence on each form of beam that was tried."""
    lines = []
    for beam in beams:
        if beam.met:
            lines.append(
                f"a uniform beam, {beam.form}, meets every entry: {_shape(beam)}; worst {beam.worst_entry} by "
                f"{beam.worst_misfit:.2f} rounding half-widths"
            )
            if beam.not_identifiable:
                names = ", ".join(name.split("_")[0] if "_" in name else name for name in beam.not_identifiable)
                lines.append(f"not identifiable from these entries: {names}")
            if beam.form == Form.OFFSET.value:
                lines.append("the beam that starts at this one's far end and runs back has the same matrix")
        else:
            lines.append(
                f"no uniform beam, {beam.form}, meets every entry. The worst is at least "
                f"{printed(beam.smallest_worst_misfit, 2)} rounding half-widths off. The nearest by least squares "
                f"has {_shape(beam)}, and misses {beam.worst_entry} by {printed(beam.worst_misfit, 2)}. No entry "
                f"is off by more than {printed(100.0 * beam.worst_scaled, 2)} % of √(c_ii c_jj)"
            )
    if beams and not beams[-1].met:
        lines.append("so it is no uniform beam: keep the matrix, or describe the part in several pieces")
    return lines


def show(console: Console, document: IdentificationDocument) -> None:
    """Print a document."""
    title = f"{document.model}: {document.name}" if document.model else document.name
    console.print(f"{title}, compliance in mm/N, 1/N, rad/(N mm), axes: {document.axes}", soft_wrap=True)
    console.print(_matrix(document))
    for beam in document.beams:
        console.print(_beam(beam))
    for line in document.findings:
        console.print(line, soft_wrap=True, highlight=False, markup=False)


def _shape(beam: BeamDocument) -> str:
    text = f"{beam.length_mm:.4g} mm along ({', '.join(f'{v + 0.0:.3f}' for v in _tidy(beam.direction))})"
    if any(beam.offset_mm):
        text += f", then rigidly ({', '.join(f'{v:.2f}' for v in _tidy(beam.offset_mm))}) mm"
    return text


def _tidy(values: Sequence[float]) -> list[float]:
    """Without what would print as a negative zero."""
    return [0.0 if abs(value) < 5e-4 else value for value in values]


def _matrix(document: IdentificationDocument) -> TerminalTable:
    table = TerminalTable(show_header=False, box=SIMPLE)
    for row, uncertainties in zip(document.compliance, document.uncertainty, strict=True):
        cells = []
        for value, open_ in zip(row, uncertainties, strict=True):
            if open_ is None:
                cells.append("left out")
            else:
                # an entry below its own uncertainty is nothing
                cells.append(f"{value:.5g} ± {open_:.1g}" if abs(value) > open_ else f"0 ± {open_:.1g}")
        table.add_row(*cells)
    return table


def _beam(beam: BeamDocument) -> TerminalTable:
    mark = "meets every entry" if beam.met else "does not meet every entry"
    table = TerminalTable(title=f"uniform beam, {beam.form}: {mark}", title_justify="left", box=SIMPLE)
    table.add_column("")
    table.add_column("value", justify="right")
    if beam.ranges:
        table.add_column("over all beams that meet every entry", justify="right")
    x, y, z = beam.direction
    values: dict[str, float | None] = {
        "length_mm": beam.length_mm,
        "azimuth_deg": math.degrees(math.atan2(y, x)),
        "elevation_deg": math.degrees(math.asin(max(-1.0, min(1.0, z)))),
    }
    if beam.form == Form.OFFSET.value:
        values |= {f"offset_{axis}_mm": v for axis, v in zip("xyz", beam.offset_mm, strict=True)}
    names = STIFFNESSES if beam.form == Form.SHEARED.value else STIFFNESSES[:4]
    values |= {name: getattr(beam, name) for name in names}
    for name, value in values.items():
        text = "infinite" if value is None else printed(0.0 if abs(value) < NOTHING else value, 6)
        table.add_row(_LABELS[name], text, *([_span(beam.ranges.get(name))] if beam.ranges else []))
    return table


def _span(span: RangeDocument | None) -> str:
    if span is None:
        return ""
    if span.high is None:
        return f"at least {printed(span.low, 4)}"
    half = 0.5 * (span.high - span.low)
    if half < NARROW * max(abs(span.low), abs(span.high), 1.0):
        return f"± {half:.1g}"
    return f"{printed(span.low, 5)} to {printed(span.high, 5)}"


MOST_DIGITS = shown(9)
"""Of a model file's entries; more were computed, not printed."""


def searches(aim: Target) -> list[FormSearch]:
    """Searches over the forms of beam, from the simplest on, as far as the first that meets every entry."""
    results: list[FormSearch] = []
    for form in Form:
        results.append(search(aim, form))
        if results[-1].met:
            break
    return results


def beam_document(result: FormSearch) -> BeamDocument:
    """A search's beam, and how wide the set around it is."""
    fit = result.beam
    beam = as_people_write_it(fit.beam)
    section = beam.section
    assert section is not None
    misfit, aim = fit.misfit, fit.space.target
    open_ = np.where(np.isfinite(aim.half), aim.half, 0.0)

    def shown(stiffness: float, *, turn: bool) -> float | None:
        return stiffness if fit.space.shows(beam.length / stiffness, turn=turn) else None

    i, j = divmod(int(np.argmax(np.abs(misfit))), 6)
    widths = ranges([one for one in (result.nearest, *result.levelled) if one.met])
    return BeamDocument(
        form=fit.space.form.value, met=result.met, smallest_worst_misfit=result.worst, length_mm=beam.length,
        direction=beam.section_frame[:, 0].tolist(), section_axes=beam.section_frame.tolist(),
        offset_mm=beam.end_offset.tolist(), EA_N=shown(section.EA, turn=False),
        GJ_Nmm2=shown(section.GJ, turn=True), EIy_Nmm2=shown(section.EIy, turn=True),
        EIz_Nmm2=shown(section.EIz, turn=True), GAy_N=_finite(section.GAy), GAz_N=_finite(section.GAz),
        compliance=beam.beam_compliance().tolist(), misfit=misfit.tolist(),
        worst_entry=entry_name(min(i, j), max(i, j)), worst_misfit=fit.worst,
        worst_scaled=float(np.max(np.abs(misfit) * open_ / scaling(aim.matrix))),
        ranges={name: RangeDocument(low=r.low, high=_finite(r.high)) for name, r in widths.items()},
        not_identifiable=_not_identifiable(widths, fit.space.form),
    )  # fmt: skip


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


def experiments_document(measurement: ComplianceMeasurement, meshes: tuple[int, int, int]) -> ExperimentsDocument:
    """How a compliance was measured."""
    scale = scaling(measurement.compliance)
    return ExperimentsDocument(
        elements=list(meshes), loads=measurement.loads.tolist(),
        linearity=float(np.max(measurement.linearity / scale)),
        discretisation=float(np.max(measurement.discretisation / scale)),
        rounding=float(np.max(measurement.rounding / scale)), order=measurement.order,
        extrapolated=measurement.extrapolated, asymmetry=measurement.asymmetry,
        smallest_eigenvalue=measurement.smallest_eigenvalue,
        positive_definite=measurement.smallest_eigenvalue > 0.0,
    )  # fmt: skip


def reference_document(name: str, reference: Array, compliance: Array, *, printed: bool) -> ReferenceDocument:
    """Another matrix ``(6, 6)`` of the part beside the one found; entries that are printed are rounded ones.

    They have as many digits as the longest of them.
    """
    digits = _digits(reference) if printed else None
    outside = {}
    if digits is not None:
        with np.errstate(divide="ignore"):
            half = 0.5 * 10.0 ** (np.floor(np.log10(np.abs(reference))) - digits + 1)
        # a printed zero is zero within what its row's and column's diagonal entries resolve
        half = np.where(reference == 0.0, np.sqrt(np.outer(np.diag(half), np.diag(half))), half)
        misses = (compliance - reference) / half
        outside = {
            entry_name(i, j): float(misses[i, j]) for i in range(6) for j in range(i, 6) if abs(misses[i, j]) > 1.0
        }
    difference = float(np.max(np.abs(compliance - reference) / scaling(reference)))
    return ReferenceDocument(
        name=name, compliance=reference.tolist(), difference=difference, digits=digits, outside=outside
    )


def intervals(half: Array) -> list[list[float | None]]:
    """Half-intervals, none for an entry that was left out."""
    return [[_finite(value) for value in row] for row in half.tolist()]


def scaling(compliance: Array) -> Array:
    """√(c_ii c_jj) ``(6, 6)``, by which entries of different units become comparable."""
    return np.sqrt(np.outer(np.diag(compliance), np.diag(compliance)))


def _digits(matrix: Array) -> int | None:
    """Significant digits that the longest entry needs: those to which all were rounded; None for computed ones."""
    digits = max(
        next(n for n in range(1, 18) if float(f"{value:.{n - 1}e}") == value) for value in matrix[matrix != 0.0]
    )
    return digits if digits <= MOST_DIGITS else None


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
