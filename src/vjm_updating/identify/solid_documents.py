"""The JSON document that ``validate identify --solid --json`` prints; N, mm, rad, kg; the drawing's axes."""

from __future__ import annotations

from vjm_output.documents import Matrix, Row
from vjm_updating.identify.documents import BeamDocument


class MeshDocument(Row):
    """One mesh."""

    size_mm: float
    """Of the elements away from graded edges."""
    unknowns: int


class BoundDocument(Row):
    """The compliance for one kind of tip; scaled means over √(c_ii c_jj)."""

    tip: str
    """``rigid``: moves as one body, the lower bound; ``spread``: loaded by a traction, the upper one."""
    compliance: Matrix
    """By virtual work, extrapolated over the meshes."""
    interval: Matrix
    """Half of it, of every entry."""
    order: list[list[float | None]]
    """Observed over the last three meshes; null where the changes have two signs."""
    last_mesh: Matrix
    fitted: Matrix
    """The rigid motion nearest to the displacements of the tip's nodes on the last mesh, outliers left out."""
    fitted_difference: float
    """Largest scaled difference of the two on the last mesh."""
    left_out: float
    """Share of the nodes that were outliers."""
    smallest_eigenvalue: float
    """Of the scaled compliance; above zero."""


class TaperDocument(Row):
    """A straight beam from base to tip whose bending stiffnesses run from root to end, rigid in shear."""

    length_mm: float
    EIy_Nmm2: list[float]
    """At root and end, where the section's y is the second row of `BeamDocument.section_axes` transposed."""
    EIz_Nmm2: list[float]
    worst_scaled: float
    """Largest difference of its bending entries to the part's, scaled."""


class StressDocument(Row):
    """Von Mises stress under a wrench."""

    wrench: list[float]
    """N and N mm, where the compliance is read."""
    tip: str
    """How it enters."""
    largest_MPa: float  # noqa: N815
    """Of all nodes; at a clamped or a re-entrant edge it grows with every mesh and has no limit."""
    largest_at_mm: list[float]
    away_MPa: float  # noqa: N815
    """Half a thickness or more away from base and tip."""
    away_at_mm: list[float]
    yield_MPa: float | None  # noqa: N815
    factor_to_yield: float | None
    """By which the wrench may grow until the stress away from the ends is the yield stress."""


class SolidDocument(Row):
    """What ``validate identify --solid --json`` prints."""

    version: str
    name: str
    sha256: str
    """Of the drawing."""
    youngs_modulus_MPa: float  # noqa: N815
    poissons_ratio: float
    density_kg_per_m3: float | None
    base_faces: list[int]
    tip_faces: list[int]
    base_held: str
    """``clamped``, or ``mean``: still in the mean only."""
    base_centre_mm: list[float]
    tip_centre_mm: list[float]
    read_at_mm: list[float]
    """The point of the tip's body at which wrenches act and motions are read."""
    meshes: list[MeshDocument]
    stopped: str
    """``accuracy`` was met, or the next mesh would be beyond the asked ``size`` or the free ``memory``."""
    accuracy_asked: float
    accuracy_reached: float
    """Largest scaled half-width of both bounds."""
    bounds: list[BoundDocument]
    bounds_apart: float
    """Largest scaled difference of the bounds."""
    volume_mm3: float
    mass_kg: float | None
    centre_of_mass_mm: list[float]
    beams: list[BeamDocument]
    """Uniform ones, from the simplest form on, as far as the first that meets every entry."""
    taper: TaperDocument | None
    bodies: int
    """That the drawing holds; they are bonded where they touch."""
    buckling_N: float | None  # noqa: N815
    """Compression under which it buckles, held at its base and free at its tip, without shear; null: undecided."""
    stress: StressDocument | None
    """Under the wrench that was given."""
    warnings: list[str]
    findings: list[str]
