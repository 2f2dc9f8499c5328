"""The JSON documents that the single commands print; N, mm, rad."""

from __future__ import annotations

from collections.abc import Iterable
from math import isnan

from pydantic import Field

from vjm import __version__
from vjm.continuation.path import EventKind, Path, travel
from vjm.io.findings import Finding
from vjm.io.path_files import words
from vjm_output.documents import DoubtRow, Matrix, Row, doubt_rows
from vjm_validation.metrics import PathMetrics, YieldRow, finite


class UnderLoads(Row):
    """A document of what a machine does under loads."""

    loads: list[str] = Field([])
    """What acts on the machine, in words: wrenches on its end, loads on its parts, its weight."""


class BucklingDocument(UnderLoads):
    """What ``validate buckling --json`` prints."""

    model: str
    model_sha256: str
    version: str
    chain: dict[str, dict[str, dict[str, PathMetrics]]]
    """By posture, ``tension`` or ``compression``, and engine label, as in ``summary.json``."""
    yields: list[YieldRow] = Field([])
    """Where the material yields first, path by path, where the model file says a yield stress; ``vjm`` only."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


class SectionRow(Row):
    """A cross-section that is known by its shape; x is along the beam, pairs are about or along y, then z."""

    name: str
    """Of the part, or of the shape."""
    shape: str
    area_mm2: float
    second_moments_mm4: list[float]
    section_moduli_mm3: list[float]
    """Of elastic bending: the moment over its largest stress."""
    torsion_constant_mm4: float
    """Saint-Venant's."""
    warping_constant_mm6: float
    """About the centre."""
    warping_length_mm: float
    """How far from a clamped end torsion is stiffer, as the end cannot warp."""
    shear_areas_mm2: list[float]
    """For deflection along y, along z, by the energy of the shear stresses."""
    shear_factors: list[float]
    """Shear areas over the area."""
    EA_N: float
    GJ_Nmm2: float
    EI_Nmm2: list[float]
    mass_kg_per_m: float
    """Zero where no density is known."""
    product_of_inertia_mm4: float = 0.0
    centroid_mm: list[float] = Field([0.0, 0.0])
    """Of a polygon, in the axes of its points."""
    shear_centre_mm: list[float] = Field([0.0, 0.0])
    """From the centroid."""
    mesh_errors: dict[str, float] = Field({})
    """Of a polygon: what a mesh of half the width changes, relative."""
    no_beam: str = ""
    """Why the profile is no section of a beam; empty where it is one."""


class SectionsDocument(Row):
    """What ``validate section --json`` prints."""

    version: str
    sections: list[SectionRow]


class ShareRow(Row):
    """What one part adds to the deflection of the end, see `vjm.shares`."""

    part: str
    kind: str
    """``joint``, ``bearing`` (a joint across its axis), ``beam``, ``spring``, ``drive``, ``mount``; ``motion`` of
    the passive joints where the end is held."""
    deflection: list[float]
    """Of the end by it alone, linear; shift and rotation vector, world axes."""
    energy: float | None
    """Its share in the linear strain energy, 0 to 1; null where there is none."""
    energy_loaded: float | None
    """The same at the loaded equilibrium."""


class SharesRow(Row):
    """The shares of all parts in one posture."""

    posture: str
    deflection: list[float]
    """Of the end, linear: the sum of the shares."""
    deflection_loaded: list[float]
    """Of the end at the loaded equilibrium."""
    nonlinearity: float | None
    """Largest change of a component by large deflections, over the largest component; turns count times the
    machine's characteristic length. Null where the load strains nothing to first order."""
    parts: list[ShareRow]


class StiffnessDocument(UnderLoads):
    """What ``validate stiffness --json`` prints."""

    model: str
    model_sha256: str
    version: str
    engine: str
    posture: str
    control: str
    """``displacement``: the pose is imposed; ``wrench``: the end-effector is free under a dead wrench."""
    displacement: list[float]
    """Of the end-effector: shift and rotation vector, world axes."""
    wrench: list[float]
    """On the end-effector, world axes."""
    end: str = ""
    """Name of the end frame; empty where the machine names none."""
    gravity: list[float] | None = None
    """m/s², where the parts have their weight."""
    stiffness_loaded: Matrix | None
    """K^F of eq. (18); null where a wrench moves nothing, so that it is infinite: see ``compliance_loaded``."""
    stiffness_unloaded: Matrix | None
    """K of eq. (5); null likewise."""
    compliance_loaded: Matrix | None = None
    """The inverse of K^F, mm/N, 1/N, rad/(N mm), of an end-effector that nothing but the machine holds; null where
    passive joints let it move without a force, or where the pose is imposed."""
    compliance_unloaded: Matrix | None = None
    """The inverse of K; null likewise."""
    rigid: list[list[float]] = Field([])
    """Unit wrenches under which the end-effector does not deflect: those that make K infinite."""
    torques: dict[str, float] | None = None
    """What holds each joint, N mm or N; null where it is not computed."""
    pulls: dict[str, float] = Field({})
    """Force of each spring between points, N; one that pushes is negative."""
    laws: list[str] = Field([])
    """Where each law of a spring is at the load: the loaded stiffness has its tangent there."""
    stable: bool | None
    """Under the control named above; null where the engine does not examine it. An unstable equilibrium is never
    reported."""
    eigenvalue: float | None
    """Smallest eigenvalue of the second variation, in units of the model's energy scale; null where the engine
    computes none."""
    eigenvalue_relative: float | None = None
    """The same over that of the unloaded machine, as ``validate curve`` has it: 0 at a critical point."""
    iterations: int | None
    """Null where postures are solved as a batch, which does not count them."""
    residual: float
    """Largest scaled component of the equilibrium equations."""
    events: list[str]
    """Critical points that the chain passed on the way."""
    shares: list[SharesRow] = Field([])
    """What each part adds to the deflection, with ``--shares``: in the posture, or in all where none is given."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


class ModeRow(Row):
    """One natural motion of a machine."""

    frequency_Hz: float  # noqa: N815  (the unit's symbol)
    growth_per_s: float
    """By which its amplitude grows; zero for a stable one."""
    largest_at: str
    """Where it moves most, ``part@fraction``; empty where no station moves."""
    shape: list[list[float]]
    """Motions of the stations, the largest being one."""


class ModesDocument(UnderLoads):
    """What ``validate modes --json`` prints."""

    model: str
    model_sha256: str
    version: str
    engine: str
    posture: str
    control: str
    """``displacement``: the end is held in its pose; ``wrench``: it is free."""
    end: str = ""
    """Name of the end frame; empty where the machine names none."""
    displacement: list[float]
    """Of the end at the equilibrium: shift and rotation vector, world axes."""
    verdict: str
    """``stable``, ``neutral``, ``divergence`` or ``flutter``, as far as these modes tell."""
    mass_kg: float
    """Of all parts."""
    massless: list[str]
    """Beams that have no mass."""
    stations: list[str]
    """Points of the shapes, ``part@fraction``."""
    positions: list[list[float]]
    """Where they stand, mm."""
    modes: list[ModeRow]
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


class SensitivityRow(Row):
    """The derivative of a quantity by one number of the model file."""

    parameter: str
    unit: str
    value: float
    derivative: float
    """Of the quantity, in its unit per unit of the parameter."""
    relative: float
    """Per cent of the quantity per per cent of the parameter."""
    factor: float | None
    """On the parameter that alone halves a deflection or a mass, or doubles a stiffness or a frequency; null where
    none up to ten does, or where it was not looked for."""
    difference: float | None = None
    """The derivative as a central difference of machines that were solved again; null where there is none."""
    doubt: str = ""
    """Why there is no such difference, or that the two disagree; empty where they agree."""
    geometric: bool = False
    """Whether it moves a point of the unloaded machine, as a length does."""


class SensitivityDocument(UnderLoads):
    """What ``validate sensitivity --json`` prints."""

    model: str
    model_sha256: str
    version: str
    engine: str
    posture: str
    quantity: str
    """``deflection``, ``stiffness``, ``critical``, ``frequency`` or ``mass``."""
    along: str
    """Component of a deflection or a stiffness; empty else."""
    value: float
    """Of the quantity."""
    unit: str
    """Of the quantity."""
    parameters: list[SensitivityRow]
    """The largest relative derivative first."""
    left_out: dict[str, str] = Field({})
    """Parameters that have no derivative, and why."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


class CurvePointRow(Row):
    """One equilibrium of a path."""

    ramp: float
    """The driven displacement's magnitude, or the load factor."""
    force: float
    """Magnitude of the driven component of the wrench, or the load factor."""
    stiffness: float | None
    """Derivative of the force by the ramp; null where it is infinite: the load does not move where it acts."""
    displacement: list[float]
    """Of the end-effector: shift and rotation vector, world axes."""
    wrench: list[float]
    """That the machine needs at the end-effector, world axes."""
    eigenvalue_relative: float | None
    """Smallest eigenvalue of the second variation over that of the unloaded machine; null where not computed."""
    unstable: int | None
    """Number of negative eigenvalues; null where not computed."""


class CurveEventRow(Row):
    """A critical point of a path."""

    kind: EventKind
    at: float
    """The ramp there."""
    force: float
    """Of the driven component, or the load factor."""
    stiffness_before: float | None
    """At 0.99 of the path up to there; null for a stiffness knee."""
    stiffness_after: float | None
    """At 1.01 of it, on the stable branch; null likewise."""


class LawChangeRow(Row):
    """Where a spring passes from one region of its law to the next."""

    what: str
    """``joint``, ``actuator``, ``mount``, ``spring`` or ``cable``."""
    name: str
    """Of it."""
    region: str
    """That it comes into, in words."""
    at: float
    """The ramp there."""
    force: float
    """Of the driven component, or the load factor."""


class CurveDocument(Row):
    """What ``validate curve --json`` prints."""

    model: str
    model_sha256: str
    version: str
    engine: str
    posture: str
    load_case: dict[str, str]
    """As in the first line of a curve file."""
    points: list[CurvePointRow]
    events: list[CurveEventRow]
    law_changes: list[LawChangeRow] = Field([])
    """Of springs with laws, in the order of the path; from engines vjm only."""
    complete: bool
    """Whether the path reached its end."""
    stopped: str
    """Why it did not; empty where it did."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


def curve_document(path: Path, doubts: Iterable[Finding] = ()) -> CurveDocument:
    """A path as a document."""
    rows = zip(path.points, path.force.tolist(), path.eigenvalue_relative.tolist(), strict=True)
    return CurveDocument(
        model=path.model,
        model_sha256=path.model_sha256,
        version=__version__,
        engine=path.engine,
        posture=path.load_case.posture,
        load_case=words(path.load_case),
        points=[
            CurvePointRow(
                ramp=p.ramp,
                force=force,
                stiffness=finite(p.tangent),
                displacement=p.displacement.tolist(),
                wrench=p.wrench.tolist(),
                eigenvalue_relative=None if isnan(relative) else relative,
                unstable=None if p.unstable < 0 else p.unstable,
            )
            for p, force, relative in rows
        ],
        events=[
            CurveEventRow(
                kind=event.kind,
                at=travel(path, event.point) if event.point else event.s,
                force=event.force,
                stiffness_before=finite(event.stiffness_before),
                stiffness_after=finite(event.stiffness_after),
            )
            for event in path.events
        ],
        law_changes=[
            LawChangeRow(
                what=change.what,
                name=change.name,
                region=change.region,
                at=change.point.ramp,
                force=change.force,
            )
            for change in path.law_changes
        ],
        complete=path.complete,
        stopped=path.stopped,
        doubts=doubt_rows(doubts),
    )


class MapRowsDocument(UnderLoads):
    """What ``validate map --json`` prints: every pose with its values."""

    model: str
    model_sha256: str
    version: str
    engine: str
    quantity: str
    columns: list[str]
    """Of ``values``."""
    places_mm: list[list[float | None]]
    """x, y and z of the tool in the world, of a platform from home; null where it is not reached."""
    joints: dict[str, list[float | None]]
    """Of an arm: coordinates of each joint, pose by pose; empty for a platform."""
    values: list[list[float | None]]
    """Null where there is none, or where it is infinite."""
    parts: list[str] = Field([])
    """Of a map of the shares: name of the part with the largest share, pose by pose; empty where there is none."""
    kinds: list[str] = Field([])
    """Of a map of the shares: kind of what deflects in that part, such as ``joint``, ``bearing`` or ``beam``."""
    status: list[str]
    """``ok``, or why there is no value."""
    wrench: list[float]
    """On the platform or the end, N and N mm."""
    against: str
    """Engine of the difference; empty where none is asked for."""
    difference_percent: list[float | None]
    """Of the shown column to that engine's, pose by pose; null where one has no value; empty without another."""
    files: list[str]
    """That were written."""
    doubts: list[DoubtRow] = Field([])
    """What is implausible about the model."""


class MapsDocument(Row):
    """What ``validate map --json`` prints for several wrenches."""

    maps: list[MapRowsDocument]
    """One a wrench."""
