"""A part's compliance from its drawing, and the beam behind it: `validate identify --solid`.

Its documents, tables and pictures, and its stress under a wrench.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from scipy.optimize import brentq

from vjm import __version__
from vjm.io.errors import printed
from vjm.io.solid_compliance import LIKE, THIN, bonded_bodies
from vjm.rotations import Array, rotate_matrix6
from vjm_fea.solid.compliance import RootSupport, TipLoad
from vjm_fea.solid.elasticity import away_from_ends, von_mises
from vjm_fea.solid.faces import Face
from vjm_fea.solid.identify import Bound, SolidCompliance
from vjm_output import optional_drawing
from vjm_output.documents import Matrix, Row
from vjm_output.number_text import number, percent
from vjm_output.terminal import TerminalTable, two_columns
from vjm_updating.constants import numerical, physical_bound, shown, tuned
from vjm_updating.identify.beam_fit import Target
from vjm_updating.identify.report import BeamDocument, beam_document, scaling, searches

# --- The JSON document that ``validate identify --solid --json`` prints; N, mm, rad, kg; the drawing's axes -------


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


# --- A part identified from its drawing, in tables and sentences for people ---------------------------------------

TIPS = {
    "rigid": "tip moved as a rigid body: the lower bound",
    "spread": "wrench spread over the tip's face: the upper bound",
}
NOTHING = numerical(2e-4)
"""Of √(c_ii c_jj): what an irregular mesh leaves of an exact zero."""
HEADS = ("x", "y", "z", "φx", "φy", "φz")


def show(console: Console, document: SolidDocument) -> None:
    """Print a document."""
    console.print(two_columns(document.name, _rows(document)), highlight=False)
    for bound in document.bounds:
        console.print(_matrix(bound), highlight=False)
    console.print(_beams(document.beams), highlight=False)
    if document.stress is not None:
        console.print(two_columns("Von Mises stress under the wrench", _stress(document.stress)), highlight=False)
    for line in document.findings:
        console.print(f"- {line}", highlight=False, markup=False)
    for line in document.warnings:
        console.print(f"- WARNING: {line}", highlight=False, markup=False)


def _rows(document: SolidDocument) -> dict[str, str]:
    unknowns = ", ".join(f"{mesh.unknowns:,}" for mesh in document.meshes)
    held = "clamped" if document.base_held == "clamped" else "still in the mean"
    reached = percent(document.accuracy_reached)
    mass = "not known: give --density" if document.mass_kg is None else f"{printed(document.mass_kg, 5)} kg"
    return {
        "material": f"E {printed(document.youngs_modulus_MPa)} MPa, ν {printed(document.poissons_ratio)}",
        "base": f"faces {_numbers(document.base_faces)}, {held}, centre at {_point(document.base_centre_mm)} mm",
        "tip": f"faces {_numbers(document.tip_faces)}, centre at {_point(document.tip_centre_mm)} mm",
        "read at": f"{_point(document.read_at_mm)} mm, in the drawing's axes",
        "meshes": f"{unknowns} unknowns; {reached} reached, {percent(document.accuracy_asked)} asked",
        "mass": f"{mass}; volume {printed(document.volume_mm3, 5)} mm³",
        "centre of mass": f"{_point(document.centre_of_mass_mm)} mm",
    }


def _matrix(bound: BoundDocument) -> TerminalTable:
    table = TerminalTable(
        title=f"Compliance, {TIPS[bound.tip]} (mm/N, 1/N, rad/(N mm); ± half-width)",
        title_justify="left",
        box=SIMPLE,
    )
    table.add_column("")
    scale = [bound.compliance[i][i] ** 0.5 for i in range(6)]
    for head in HEADS:
        table.add_column(head, justify="right")
    for i, head in enumerate(HEADS):
        cells = []
        for j in range(6):
            value, half = bound.compliance[i][j], bound.interval[i][j]
            nothing = abs(value) <= max(half, NOTHING * scale[i] * scale[j])
            cells.append("0" if nothing else f"{value:.4e}\n± {100.0 * half / abs(value):.2g} %")
        table.add_row(head, *cells)
    return table


def _beams(beams: Sequence[BeamDocument]) -> TerminalTable:
    table = TerminalTable(title="Uniform beams", title_justify="left", box=SIMPLE)
    stiffnesses = ("EA, N", "GJ, N mm²", "EIy, N mm²", "EIz, N mm²")
    for head in ("form", "length, mm", *stiffnesses, "worst miss", "like the part"):
        table.add_column(head, justify="left" if head == "form" else "right")
    for beam in beams:
        sizes = (beam.length_mm, beam.EA_N, beam.GJ_Nmm2, beam.EIy_Nmm2, beam.EIz_Nmm2)
        miss = f"{beam.worst_entry} {percent(beam.worst_scaled)}"
        table.add_row(beam.form, *(number(value) for value in sizes), miss, "yes" if beam.met else "no")
    return table


def _stress(stress: StressDocument) -> dict[str, str]:
    rows = {
        "wrench": f"{_point(stress.wrench)} N, N mm, {TIPS[stress.tip].partition(':')[0]}",
        "largest away from the ends": f"{number(stress.away_MPa)} MPa at {_point(stress.away_at_mm)} mm",
        "largest of all": f"{number(stress.largest_MPa)} MPa at {_point(stress.largest_at_mm)} mm: at a clamped or "
        "re-entrant edge it has no limit",
    }
    if stress.yield_MPa is not None:
        rows["yields"] = f"at {number(stress.factor_to_yield)} times this wrench, away from the ends"
    return rows


def _numbers(values: Sequence[int]) -> str:
    return ", ".join(map(str, values))


def _point(values: Sequence[float]) -> str:
    return "[" + ", ".join(printed(0.0 if abs(value) < 1e-6 else value, 5) for value in values) + "]"


# --- Pictures of solids, rendered off the screen: the faces of a drawing numbered, and stress on deflected shapes--

SIZE = shown((1100, 850))
"""Of a rendered panel, pixels."""
DRAWN = shown(0.08)
"""Largest displacement as drawn, over the part's diagonal."""
CLIP = shown(99.5)
"""Percentile of stress at which the colours end: at a clamped edge the largest has no bound."""
LOADS = ("force along x", "force along y", "force along z", "moment about x", "moment about y", "moment about z")
COLOURS = ("#56B4E9", "#E69F00", "#009E73", "#F0E442", "#0072B2", "#D55E00", "#CC79A7", "#999999")


TRIED = shown(100)
"""Triangles of a face, about, of which a visible one is sought for its number."""


def numbered_faces(faces: Sequence[Face]) -> bytes:
    """A PNG file of a drawing seen from two sides, every face in a colour with its number."""
    from vjm_output.plots import PAGE_WIDTH, figure, png

    with figure(0.5 * PAGE_WIDTH * SIZE[1] / SIZE[0] + 0.3) as (fig, axes):
        for ax, view in zip(axes, ((1.0, -1.4, 0.9), (-1.0, 1.4, -0.9)), strict=True):
            ax.imshow(_faces_from(faces, view))
            ax.set(xticks=[], yticks=[])
            ax.spines[:].set_visible(False)
        return png(fig)


def _faces_from(faces: Sequence[Face], view: tuple[float, float, float]) -> np.ndarray:
    pv = _pyvista()
    plotter = optional_drawing.plotter(SIZE)
    try:
        plotter.set_background("white")
        for i, face in enumerate(faces):
            surface = _surface(pv, face.triangles.reshape(-1, 3), np.arange(3 * len(face.triangles)).reshape(-1, 3))
            plotter.add_mesh(surface, color=COLOURS[i % len(COLOURS)], smooth_shading=False)
            border = surface.clean(tolerance=1e-6).extract_feature_edges(
                boundary_edges=True, feature_edges=False, manifold_edges=False
            )
            if border.n_points:
                plotter.add_mesh(border, color="black", line_width=2)
        places, texts = face_numbers(faces, np.asarray(view))
        plotter.add_point_labels(
            places, texts, font_size=26, shape_color="white", shape_opacity=0.8, always_visible=False, point_size=1
        )
        plotter.view_vector(view, viewup=(0.0, 0.0, 1.0))
        plotter.enable_parallel_projection()
        plotter.reset_camera()
        return np.asarray(plotter.screenshot(return_img=True))
    finally:
        plotter.close()


def face_numbers(faces: Sequence[Face], view: Array) -> tuple[Array, list[str]]:
    """Where to write the numbers of the faces that are seen: on the visible triangle nearest to the centre."""
    places, texts = [], []
    toward = view / np.linalg.norm(view)
    every = np.concatenate([face.triangles for face in faces])
    size = float(np.linalg.norm(np.ptp(every.reshape(-1, 3), axis=0)))
    for face in faces:
        centres = face.triangles.mean(axis=1)
        order = np.argsort(np.linalg.norm(centres - face.centre, axis=1))
        # evenly through the face, the centre first
        tried = order[:: max(1, len(order) // TRIED)]
        seen = next((centres[k] for k in tried if not _covered(centres[k], toward, every, 1e-6 * size)), None)
        if seen is not None:
            # a little in front of the face, which hides what lies on it
            places.append(seen + 0.02 * size * toward)
            texts.append(str(face.number) if not face.name else f"{face.number} {face.name}")
    return np.array(places).reshape(-1, 3), texts


def _covered(point: Array, toward: Array, triangles: Array, near: float) -> bool:
    """Whether a triangle ``(k, 3, 3)`` lies between a point and a viewer far away (Möller and Trumbore's test)."""
    a, e1, e2 = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(toward, e2)
    det = np.sum(e1 * p, axis=1)
    met = det != 0.0
    det = np.where(met, det, 1.0)
    u = np.sum((point - a) * p, axis=1) / det
    q = np.cross(point - a, e1)
    v, t = q @ toward / det, np.sum(e2 * q, axis=1) / det
    return bool(np.any(met & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > near)))


def load_pictures(part: SolidCompliance, tip: TipLoad) -> bytes:
    """A PNG file of six panels: von Mises stress on the shape that each unit wrench deflects."""
    return _panels(part, [(LOADS[k], part.answers[tip].displacements[:, k], k < 3) for k in range(6)])


def wrench_picture(part: SolidCompliance, tip: TipLoad, wrench: Array) -> bytes:
    """A PNG file of von Mises stress on the deflected shape under a wrench ``(6,)`` N, N mm."""
    return _panels(part, [("the wrench", part.answers[tip].displacements @ wrench, None)])


def _panels(part: SolidCompliance, cases: Sequence[tuple[str, Array, bool | None]]) -> bytes:
    from vjm_output.plots import PAGE_WIDTH, figure, png

    columns = min(3, len(cases))
    rows = len(cases) // columns
    width = PAGE_WIDTH / columns
    with figure(rows * (width * SIZE[1] / SIZE[0] + 0.45), columns, rows=rows) as (fig, axes):
        for ax, (name, u, force) in zip(axes, cases, strict=True):
            stress = von_mises(part.solid.stress(u))
            points = part.solid.mesh.points
            largest = float(np.max(np.linalg.norm(u.reshape(-1, 3), axis=1)))
            factor = DRAWN * float(np.linalg.norm(np.ptp(points, axis=0))) / max(largest, 1e-300)
            top = float(np.percentile(stress, CLIP))
            ax.imshow(_deflected(part, u, stress, factor, top))
            ax.set(xticks=[], yticks=[])
            ax.spines[:].set_visible(False)
            unit = {True: "MPa per N", False: "MPa per N mm", None: "MPa"}[force]
            ax.set_title(f"{name}\nvon Mises 0 to {number(top, 3)} {unit}", fontsize=7.5)
        return png(fig)


def _deflected(part: SolidCompliance, u: Array, stress: Array, factor: float, top: float) -> np.ndarray:
    pv = _pyvista()
    points, triangles = part.solid.mesh.points, np.concatenate(list(part.solid.mesh.faces.values()))
    plotter = optional_drawing.plotter(SIZE)
    try:
        plotter.set_background("white")
        rest = _surface(pv, points, triangles)
        plotter.add_mesh(rest, color="#d0d0d0", opacity=0.25)
        moved = _surface(pv, points + factor * u.reshape(-1, 3), triangles)
        moved["stress"] = stress
        plotter.add_mesh(moved, scalars="stress", cmap="viridis", clim=(0.0, top), show_scalar_bar=False)
        plotter.view_vector((1.0, -1.4, 0.9), viewup=(0.0, 0.0, 1.0))
        plotter.enable_parallel_projection()
        plotter.reset_camera()
        return np.asarray(plotter.screenshot(return_img=True))
    finally:
        plotter.close()


def _surface(pv: Any, points: Array, triangles: np.ndarray) -> Any:  # noqa: ANN401
    cells = np.hstack([np.full((len(triangles), 1), 3), triangles]).ravel()
    return pv.PolyData(np.asarray(points), cells)


def _pyvista() -> Any:  # noqa: ANN401
    # takes seconds to import
    import pyvista

    return pyvista


# --- Stress of an identified part under a wrench, and how far from yield it is ------------------------------------


def stress_document(part: SolidCompliance, wrench: Array, yield_stress: float | None) -> StressDocument:
    """Largest von Mises stress under a wrench.

    Args:
        part: the part.
        wrench: ``(6,)`` N and N mm, where the compliance is read, spread over the tip where that was computed.
        yield_stress: MPa, where known.
    """
    tip = TipLoad.SPREAD if TipLoad.SPREAD in part.answers else next(iter(part.answers))
    stress = von_mises(part.solid.stress(part.answers[tip].displacements @ wrench))
    points = part.solid.mesh.points
    away = away_from_ends(part.solid, [*part.ends.base, *part.ends.tip], part.thickness)
    where = int(np.argmax(stress))
    inner = int(np.argmax(np.where(away, stress, -1.0)))
    return StressDocument(
        wrench=wrench.tolist(), tip=tip.value, largest_MPa=float(stress[where]),
        largest_at_mm=points[where].tolist(), away_MPa=float(stress[inner]), away_at_mm=points[inner].tolist(),
        yield_MPa=yield_stress,
        factor_to_yield=None if yield_stress is None else yield_stress / float(stress[inner]),
    )  # fmt: skip


# --- A straight tapered beam like a compliance: bending stiffness at root and end in both planes, in closed form

EXTREME = physical_bound(np.log(50.0))
"""Logarithm of the largest ratio of bending stiffnesses that is sought."""
POINTS, WEIGHTS = numerical(np.polynomial.legendre.leggauss(40))


def tapered(C: Array, reach: Array) -> TaperDocument | None:
    """The tapered beam along a line, or None where the part does not bend like one.

    Bending stiffness runs as ``EI(s) = EI_0 (EI_1/EI_0)^(s/L)``. A cantilever's end turns by ``m ∫ds/EI`` and moves
    by ``m ∫(L−s)ds/EI``: their ratio, the lever, gives the ratio of the stiffnesses, the turn their size; what the
    end moves under a force, ``∫(L−s)²ds/EI``, is then left to compare.

    Args:
        C: compliance ``(6, 6)`` at the end, mm, N, rad.
        reach: from root to end ``(3,)``, mm.
    """
    L = float(np.linalg.norm(reach))
    if L == 0.0:
        return None
    x = reach / L
    across = np.linalg.svd(x[None, :])[2][1:].T
    # the principal directions of bending across the line
    turns = across @ np.linalg.eigh(across.T @ C[3:, 3:] @ across)[1]
    axes = np.column_stack([x, turns[:, 0], np.cross(x, turns[:, 0])])
    own = rotate_matrix6(C, axes.T)
    scale = np.sqrt(np.diag(own))
    EI, misses = [], []
    for move, turn, sign in ((2, 4, -1.0), (1, 5, 1.0)):
        lever = sign * own[move, turn] / own[turn, turn] / L
        if not _lever(-EXTREME) < lever < _lever(EXTREME):
            return None
        k = float(brentq(lambda k, lever=lever: _lever(k) - lever, -EXTREME, EXTREME))
        root = L * _moment(k, 0) / own[turn, turn]
        EI.append([float(root), float(root * np.exp(k))])
        deflection = L**3 * _moment(k, 2) / root
        misses.append(abs(deflection - own[move, move]) / scale[move] ** 2)
    return TaperDocument(length_mm=L, EIy_Nmm2=EI[0], EIz_Nmm2=EI[1], worst_scaled=float(max(misses)))


def _moment(k: float, power: int) -> float:
    """``∫ (1 − t)^power e^(−k t) dt`` from 0 to 1."""
    t = 0.5 * (POINTS + 1.0)
    return 0.5 * float(np.sum(WEIGHTS * (1.0 - t) ** power * np.exp(-k * t)))


def _lever(k: float) -> float:
    """Lever of the end's turning over the length; rises with k, one half for a uniform beam."""
    return _moment(k, 1) / _moment(k, 0)


LIKE_A_BEAM = tuned(5e-3)
"""Scaled half-interval within which a beam counts as the part's, where the bounds are closer."""
DEPTHS = physical_bound(6.0)
"""Length over the mean depth below which plane sections do not stay plane: 20 radii of gyration of a rectangle."""
TAPERS = tuned(0.05)
"""Scaled difference up to which a tapered beam is named."""


def solid_document(
    part: SolidCompliance, stress: StressDocument | None = None, *, bonded: bool = False
) -> SolidDocument:
    """What was found, with the beams that are like it, as a document; ``bonded`` bodies are meant to be one."""
    task, bounds = part.task, part.bounds
    beams = beams_of(part)
    taper = tapered(middle(part), part.point - part.base_centre)
    force, words = buckling_of(part, beams)
    return SolidDocument(
        version=__version__, name=task.path.name, sha256=hashlib.sha256(task.path.read_bytes()).hexdigest(),
        youngs_modulus_MPa=task.material.youngs_modulus, poissons_ratio=task.material.poissons_ratio,
        density_kg_per_m3=1e9 * task.material.density or None, base_faces=list(part.ends.base),
        tip_faces=list(part.ends.tip), base_held=task.held.value, base_centre_mm=part.base_centre.tolist(),
        tip_centre_mm=part.tip_centre.tolist(), read_at_mm=part.point.tolist(),
        meshes=[MeshDocument(size_mm=h, unknowns=n) for h, n in zip(part.sizes, part.unknowns, strict=True)],
        stopped=part.stopped, accuracy_asked=task.accuracy, accuracy_reached=part.relative,
        bounds=[_bound(tip, bound) for tip, bound in bounds.items()], bounds_apart=apart(part),
        volume_mm3=part.volume, mass_kg=part.mass or None, centre_of_mass_mm=part.centre.tolist(), beams=beams,
        taper=taper, stress=stress, bodies=part.bodies, buckling_N=force,
        warnings=_warnings(part, beams, bonded), findings=_findings(part, beams, taper, words),
    )  # fmt: skip


def middle(part: SolidCompliance) -> Array:
    """Mean ``(6, 6)`` of the bounds."""
    return np.mean([bound.limit.compliance for bound in part.bounds.values()], axis=0)


def apart(part: SolidCompliance) -> float:
    """Largest scaled difference of the bounds; zero where there is one only."""
    matrices = [bound.limit.compliance for bound in part.bounds.values()]
    return float(np.max(np.abs(matrices[0] - matrices[-1]) / scaling(matrices[0])))


def beams_of(part: SolidCompliance) -> list[BeamDocument]:
    """The uniform beams nearest to the mean of the bounds, which count as met between them or within 0.5 %."""
    C = middle(part)
    matrices = [bound.limit.compliance for bound in part.bounds.values()]
    half = np.max([bound.limit.interval for bound in part.bounds.values()], axis=0)
    half = half + 0.5 * np.abs(matrices[0] - matrices[-1])
    return [beam_document(one) for one in searches(Target(C, np.maximum(half, LIKE_A_BEAM * scaling(C))))]


def _bound(tip: TipLoad, bound: Bound) -> BoundDocument:
    C, last = bound.limit.compliance, bound.meshes[-1]
    return BoundDocument(
        tip=tip.value, compliance=C.tolist(), interval=bound.limit.interval.tolist(),
        order=[[None if np.isnan(p) else float(p) for p in row] for row in bound.limit.order],
        last_mesh=last.tolist(), fitted=bound.fitted.tolist(),
        fitted_difference=float(np.max(np.abs(bound.fitted - last) / scaling(last))), left_out=bound.left_out,
        smallest_eigenvalue=float(np.linalg.eigvalsh(C / scaling(C))[0]),
    )  # fmt: skip


def _warnings(part: SolidCompliance, beams: list[BeamDocument], bonded: bool) -> list[str]:
    beam = beams[-1]
    texts = []
    if part.relative > part.task.accuracy:
        why = (
            "more unknowns than --largest"
            if part.stopped == "size"
            else "more working memory than this machine has free"
        )
        texts.append(
            f"the asked accuracy of {percent(part.task.accuracy)} is not met: {percent(part.relative)} are left, "
            f"and the next mesh needs {why}"
        )
    if part.bodies > 1 and not bonded:
        texts.append(f"{bonded_bodies(part.bodies)}: --bonded says that this is meant")
    sections = part.sections
    if sections is not None and sections.straight:
        depth = float(np.mean(sections.depth))
        if sections.length < DEPTHS * depth:
            texts.append(
                f"too stubby for a beam: {number(sections.length, 3)} mm from base to tip with a depth of "
                f"about {number(depth, 2)} mm; take the 6×6 compliance, not the beam"
            )
        if sections.gyration > THIN * part.thickness:
            texts.append(
                f"walls of about {number(part.thickness, 3)} mm at a radius of gyration of "
                f"{number(sections.gyration, 3)} mm. They may buckle by themselves, which neither the 6×6 "
                "compliance nor a beam knows"
            )
    if not beam.met:
        texts.append(
            f"no uniform beam is like this part: the best misses {beam.worst_entry} by "
            f"{number(beam.worst_misfit, 3)} half-widths, {percent(beam.worst_scaled)} of √(c_ii c_jj)"
        )
    return texts


def buckling_of(part: SolidCompliance, beams: Sequence[BeamDocument]) -> tuple[float | None, str]:
    """Compression in N under which a part buckles, held at its base and free at its tip, and words on it.

    None where undecided. By whichever is nearer to the part: the column of its own sections, or the uniform beam of
    its own length.

    Euler's load goes with the stiffness and with the length to the power of −2: its error is about the column's
    misfit in bending, or twice the beam's in length, and that of the compliance. Above `LIKE` nothing is said
    of the force.
    """
    sections, beam, ways = part.sections, beams[-1], []
    if part.column is not None:
        miss = part.column.misfit
        ways.append(
            (miss, part.column.force, f"a column of its own sections, whose bending misses by {percent(miss)}")
        )
    EI = [value for value in (beam.EIy_Nmm2, beam.EIz_Nmm2) if value is not None]
    if beam.met and len(EI) == 2 and sections is not None and sections.straight:
        off = 2.0 * abs(beam.length_mm / sections.length - 1.0)
        euler = float(np.pi**2 * min(EI) / (4.0 * beam.length_mm**2))
        ways.append((off, euler, f"that uniform beam, whose length misses the part's by {percent(0.5 * off)}"))
    if part.relative > LIKE:
        known = f"the compliance is known to {percent(part.relative)} only"
        return None, f"whether it buckles, and when, is undecided: {known}"
    if not ways or min(ways)[0] + part.relative > LIKE:
        return None, "whether it buckles, and when, is undecided: it bends like no beam of its own length"
    _, force, like = min(ways)
    return force, f"free at its tip, without shear, it buckles at {number(force, 3)} N of compression as {like}"


def _findings(
    part: SolidCompliance, beams: list[BeamDocument], taper: TaperDocument | None, buckling: str
) -> list[str]:
    lines = [
        f"between a rigid tip and a wrench spread over its face: {percent(apart(part))} of √(c_ii c_jj) at most"
        if len(part.bounds) > 1
        else "one kind of tip only: no bounds",
    ]
    for tip, bound in part.bounds.items():
        difference = np.max(np.abs(bound.fitted - bound.meshes[-1]) / scaling(bound.meshes[-1]))
        lines.append(
            f"{tip.value} tip: the displacement field's rigid motion differs from virtual work by "
            f"{percent(float(difference))}, {percent(bound.left_out)} of the nodes left out"
        )
    if part.bodies > 1:
        lines.append(bonded_bodies(part.bodies))
    lines.append(buckling)
    if taper is not None and not beams[0].met and taper.worst_scaled < TAPERS:
        lines.append(
            f"as a straight tapered beam from base to tip: EIy {number(taper.EIy_Nmm2[0], 3)} to "
            f"{number(taper.EIy_Nmm2[1], 3)}, EIz {number(taper.EIz_Nmm2[0], 3)} to "
            f"{number(taper.EIz_Nmm2[1], 3)} N mm². "
            f"Its bending misses by {percent(taper.worst_scaled)} at most"
        )
    lines.append(
        "linear. A load that turns the tip by θ shortens the part's reach by about θ²/6 of it, 0.17 % at 0.1 rad, "
        "which this matrix does not know"
    )
    if part.task.held is RootSupport.CLAMPED:
        lines.append("the base is held at every point; a real joint deflects more")
    return lines
