"""The JSON document that ``validate identify --json`` prints; N, mm, rad; entries count from 1."""

from __future__ import annotations

from pydantic import Field

from vjm_output.documents import DoubtRow, Matrix, Row


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


class RepairDocument(Row):
    """A change of one entry that was tried."""

    entry: str
    written: str
    """As the file has it."""
    proposed: float
    worst_misfit: float | None
    """Of the beam that suits the changed matrix best, in half-widths; null where that is no elastic body's."""
    form: str
    makes_a_beam: bool
    others_low: float | None
    """Lowest value of a beam that meets all entries but an asymmetric pair; null where there is none."""
    others_high: float | None


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
    """Symmetric; of a file, repaired where a repair is proposed."""
    uncertainty: list[list[float | None]]
    """Half the interval for which each entry stands; null where the entry was left out of the fits."""
    experiments: ExperimentsDocument | None
    references: list[ReferenceDocument]
    repairs: list[RepairDocument]
    """Tried changes of single entries, of a matrix that is not symmetric or no beam's."""
    beams: list[BeamDocument]
    """From the simplest form on, as far as the first that meets every entry."""
    findings: list[str]
    """The same in words."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""
