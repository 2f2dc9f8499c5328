"""What is known of one quantity of one case on one engine."""

from __future__ import annotations

from pydantic import Field

from vjm_output.documents import Row


class VerificationRow(Row):
    """One quantity of one case on one engine."""

    name: str
    """Case, run where it has several, and engine."""
    kind: str
    """``exact``: mathematics; ``code``: another program; ``published``: a printed figure."""
    quantity: str
    reference: float
    source: str
    value: float | None
    """On the finest mesh; null where the engine did not get there."""
    error: float | None
    """Of the value, relative to the reference or to the size that the case names."""
    tolerance: float
    order: float | None
    """Observed: least squares on the errors above 1e-8, three at least, where the reference is exact; else by
    Richardson's formula for three meshes."""
    passed: bool | None
    """Whether the error keeps to the tolerance, and for an exact reference also the order to theory within 0.2;
    null where the engine did not run: nothing is known then."""
    case: str = ""
    group: str = ""
    engine: str = ""
    """Family: vjm, exudyn, opensees, vjm-linear, msa."""
    meshes: list[int] = Field(default_factory=list)
    """Springs or elements of every beam."""
    values: list[float | None] = Field(default_factory=list)
    """One a mesh."""
    errors: list[float | None] = Field(default_factory=list)
    """One a mesh."""
    digits: float | None = None
    """Decimal digits of the value that agree with the reference."""
    extrapolated: float | None = None
    """Richardson's limit of the three finest meshes."""
    gci: float | None = None
    """Grid convergence index of the finest mesh, relative as the error; a safety factor of 1.25."""
    theoretical_order: float | None = None
    flag: str = ""
    """Exact at every mesh, or why the order is to be taken with care."""
    reason: str = ""
    """Of the tolerance."""
    uncertainty: float | None = None
    """Of a published reference, relative as the error."""
    not_run: str = ""
    """Why there is no value: the engine refuses, being not installed or unable to express the case, or gave up."""


class TriangulationRow(Row):
    """How far two engines are apart on one quantity of the paper's chain, and how far they may be."""

    posture: str
    direction: str
    quantity: str
    engines: tuple[str, str]
    at: float | None = None
    """Displacement in mm at which a whole curve differs most; null for a single point."""
    values: tuple[float, float] | None = None
    """Of each engine on its finest mesh; null where one did not run."""
    extrapolated: tuple[float | None, float | None] | None = None
    """Richardson's limits."""
    difference: float | None = None
    """Of the values, over the largest of them on the curve."""
    estimate: float | None = None
    """Sum of the two grid convergence indices, likewise."""
    within: bool | None = None
    """Whether the difference is covered by the estimate: then meshes explain it."""
    tolerance: float
    passed: bool | None
    """Whether the difference keeps to the tolerance; null where an engine is not installed."""
    not_run: str = ""
    """Which engine has no value, and why."""
