"""From a drawing to the compliance of a part: meshes until the asked accuracy is met, two bounds, mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from vjm.child_process import Progress, free_ram
from vjm.rotations import Array, shift_compliance
from vjm_fea.solid.compliance import Answer, PartEnds, RootSupport, TipLoad, answer, face_centre
from vjm_fea.solid.convergence import MeshLimit, limit
from vjm_fea.solid.drawing import CoarseError, SolidDrawing, drawing
from vjm_fea.solid.elasticity import ElasticSolid, IsotropicMaterial
from vjm_fea.solid.faces import selected
from vjm_fea.solid.libraries import work_apart
from vjm_fea.solid.sections_along import SectionedColumn, SectionsAlong, column, sections_along

ACCURACY = 5e-3
"""Asked for where nothing is said, scaled."""
FIRST, LARGEST = 8000, 300_000
"""Unknowns of the first mesh, about, and of the last one at most."""
RATIO = 1.5
"""Of the sizes of elements from mesh to mesh."""
GROWTH, SPLIT = RATIO**2.5, 8.0
"""Of the unknowns from mesh to mesh: graded at edges, less than by volume; where elements are split, in eight."""
FINER = 1.6
"""Unknowns of a mesh over those of the one before, below which it replaces that one."""
FEWEST = 3
"""Meshes."""
BYTES = 14_000
"""Of working memory for one unknown at 300,000 unknowns, by measurement; fewer take less."""
HIGHEST_MODULUS, LOWEST_MODULUS = 2e6, 1e-2
"""Young's moduli that are believed, MPa: above diamond's, below rubber's."""


@dataclass(frozen=True)
class SolidTask:
    """A part to be identified.

    Attributes:
        path: of the drawing.
        material: of the part.
        base: words for faces, see `vjm_fea.solid.faces.selected`.
        tip: the same.
        at: point ``(3,)`` mm at which the compliance is read; None: the tip's centre of area.
        held: how the base is.
        unit_mm: mm of one unit of the file.
        accuracy: scaled half-width that ends the refinement.
        largest: unknowns of the last mesh at most.
        first: unknowns of the first mesh, about.
        tips: which bounds.
    """

    path: Path
    material: IsotropicMaterial
    base: tuple[str, ...]
    tip: tuple[str, ...]
    at: Array | None = None
    held: RootSupport = RootSupport.CLAMPED
    unit_mm: float = 1.0
    accuracy: float = ACCURACY
    largest: int = LARGEST
    first: int = FIRST
    tips: tuple[TipLoad, ...] = (TipLoad.RIGID, TipLoad.SPREAD)


@dataclass(frozen=True)
class Bound:
    """One kind of tip over all meshes.

    Attributes:
        limit: by virtual work.
        fitted: of the displacement field on the last mesh ``(6, 6)``.
        left_out: share of nodes that were outliers in it.
        meshes: compliance by virtual work of every mesh.
    """

    limit: MeshLimit
    fitted: Array
    left_out: float
    meshes: tuple[Array, ...]


@dataclass(frozen=True)
class SolidCompliance:
    """What was found.

    Attributes:
        task: that was set.
        bounds: by kind of tip.
        sizes: of the elements of every mesh, mm.
        unknowns: of every mesh.
        stopped: why there is no finer mesh: ``accuracy``, ``size`` or ``memory``.
        volume: mm³.
        centre: of mass ``(3,)``, mm.
        base_centre: of area ``(3,)``, mm.
        tip_centre: of area ``(3,)``, mm.
        at: where the compliance is read ``(3,)``, mm.
        thickness: twice the volume over the surface, mm: of a plate, its thickness.
        bodies: that the drawing holds; more than one are bonded where they touch.
        solid: the last mesh.
        answers: on it.
        ends: as face numbers.
    """

    task: SolidTask
    bounds: dict[TipLoad, Bound]
    sizes: tuple[float, ...]
    unknowns: tuple[int, ...]
    stopped: str
    volume: float
    centre: Array
    base_centre: Array
    tip_centre: Array
    at: Array
    thickness: float
    bodies: int
    solid: ElasticSolid = field(repr=False)
    answers: dict[TipLoad, Answer] = field(repr=False)
    ends: PartEnds

    @property
    def mass(self) -> float:
        """Kg."""
        return self.volume * self.task.material.density

    @cached_property
    def sections(self) -> SectionsAlong | None:
        """The part's own sections from base to tip; None where a plane across meets nothing."""
        return sections_along(self.solid, self.base_centre, self.tip_centre)

    @cached_property
    def column(self) -> SectionedColumn | None:
        """The part as a column of its own sections, where it has them and is straight."""
        if self.sections is None or not self.sections.straight:
            return None
        C = np.mean([bound.limit.compliance for bound in self.bounds.values()], axis=0)
        there = shift_compliance(C, self.tip_centre - self.at)
        return column(self.sections, self.task.material.youngs_modulus, there)

    @property
    def relative(self) -> float:
        """The largest scaled half-width of both bounds."""
        return max(bound.limit.relative for bound in self.bounds.values())


def check_material(material: IsotropicMaterial) -> None:
    """Refuse numbers that are no elastic solid's.

    Raises:
        ValueError: one line with the remedy.
    """
    E, nu = material.youngs_modulus, material.poissons_ratio
    if not LOWEST_MODULUS <= E <= HIGHEST_MODULUS:
        raise ValueError(f"--youngs: {E:g} MPa is no solid's: give MPa, 70000 for aluminium, 210000 for steel")
    if not 0.0 <= nu < 0.5:
        raise ValueError(
            f"--poisson: {nu:g} must be from 0 to below 0.5"
            + (
                ": at 0.5 nothing is compressible, which these elements cannot do; rubber takes 0.49"
                if nu >= 0.5
                else ""
            )
        )
    if nu > 0.495:
        raise ValueError(f"--poisson: {nu:g} is so near 0.5 that these elements lock: take 0.495 at most")
    if material.density != 0.0 and not 1e-8 <= material.density <= 3e-5:
        raise ValueError(
            f"--density: {1e9 * material.density:g} kg/m³ is no solid's: aluminium has 2700, steel 7850"
        )


def identify(task: SolidTask, progress: Progress | None = None) -> SolidCompliance:
    """Identify a part, in a child process: gmsh and the solver of sparse matrices are foreign code.

    Raises:
        ImportError: the extra is not installed.
        ValueError: a bad drawing, face or material, or a library met its limit of time; one line with the remedy.
        MemoryError: a library met its limit of working memory.
        OSError: the drawing cannot be read.
    """
    check_material(task.material)
    return work_apart(_identified, task, path=task.path, progress=progress or (lambda stage, done, total: None))


def _identified(task: SolidTask, progress: Progress) -> SolidCompliance:
    with drawing(task.path, task.unit_mm) as opened:
        return _identify(task, opened, progress)


def chosen_ends(task: SolidTask, opened: SolidDrawing) -> PartEnds:
    """Base and tip as face numbers.

    Raises:
        ValueError: no such face, or one that is both or touches both.
    """
    base = selected(opened.faces, task.base, "--base", opened.size)
    tip = selected(opened.faces, task.tip, "--tip", opened.size)
    both = sorted(set(base) & set(tip))
    if both:
        raise ValueError(
            f"--base and --tip: face {both[0]} is both: the part is held where it is loaded; give two faces"
        )
    return PartEnds(tuple(base), tuple(tip), task.at, task.held)


def _identify(task: SolidTask, opened: SolidDrawing, progress: Progress) -> SolidCompliance:
    ends = chosen_ends(task, opened)
    tips = task.tips
    # three meshes have to fit; the first one may be split once more than it had to be
    size = _first_size(opened, ends, min(task.first, task.largest // (512 if opened.fixed else 10)))
    sizes: list[float] = []
    unknowns: list[int] = []
    found: dict[TipLoad, list[Array]] = {tip: [] for tip in tips}
    limits: dict[TipLoad, MeshLimit] = {}
    while True:
        stage = f"mesh {len(sizes) + 1}"
        progress(stage, 0, 1 + len(tips))
        mesh = opened.mesh(size, [*ends.base, *ends.tip])
        if mesh.unknowns > task.largest:
            # only a mesh tells how many it has
            _check_any(opened, unknowns, mesh.unknowns, task.largest)
            stopped = "size"
            break
        solid = ElasticSolid(mesh, task.material)
        _check_apart(solid, ends)
        if unknowns and solid.mesh.unknowns < FINER * unknowns[-1]:
            # round faces, not the size, decided on the one before: it says nothing of convergence
            sizes.pop()
            unknowns.pop()
            for tip in tips:
                found[tip].pop()
        sizes.append(size)
        unknowns.append(solid.mesh.unknowns)
        stage = f"mesh {len(sizes)}: {unknowns[-1]} unknowns"
        stiffness = solid.stiffness()
        answers = {}
        for k, tip in enumerate(tips):
            progress(stage, 1 + k, 1 + len(tips))
            answers[tip] = answer(solid, ends, tip, stiffness)
            found[tip].append(answers[tip].compliance)
        progress(stage, 1 + len(tips), 1 + len(tips))
        if len(sizes) >= FEWEST:
            limits = {tip: limit(sizes, found[tip]) for tip in tips}
        stopped = _stop(task, unknowns, SPLIT if opened.fixed else GROWTH, limits)
        if stopped:
            break
        size /= 2.0 if opened.fixed else RATIO
    centres = face_centre(solid, ends.base), face_centre(solid, ends.tip)
    if not limits:
        limits = {tip: _unlimited(found[tip]) for tip in tips}
    surface = sum(face.area for face in opened.faces)
    return SolidCompliance(
        task=task,
        bounds={
            tip: Bound(limits[tip], answers[tip].fitted, answers[tip].left_out, tuple(found[tip])) for tip in tips
        },
        sizes=tuple(sizes),
        unknowns=tuple(unknowns),
        stopped=stopped,
        volume=solid.volume,
        centre=solid.centroid,
        base_centre=centres[0],
        tip_centre=centres[1],
        at=centres[1] if ends.at is None else np.asarray(ends.at, dtype=float),
        thickness=2.0 * solid.volume / surface,
        bodies=opened.bodies,
        solid=solid,
        answers=answers,
        ends=ends,
    )


def _first_size(opened: SolidDrawing, ends: PartEnds, target: int) -> float:
    """Size of elements of a mesh with about so many unknowns."""
    # a cube of side s holds about 6√2 tetrahedra of that side, each with 1.4 nodes of its own
    size = float((8.5 * 1.4 * 3.0 * opened.volume / target) ** (1.0 / 3.0))
    if opened.fixed:
        return size
    for attempt in range(6):
        try:
            count = opened.mesh(size, [*ends.base, *ends.tip]).unknowns
        except CoarseError:
            if attempt == 5:
                raise
            size /= RATIO
            target = 0
            continue
        if not target:
            break
        if 0.7 < count / target < 1.4:
            break
        size *= float(np.clip((count / target) ** (1.0 / 2.5), 0.4, 2.5))
    return size


def _check_any(opened: SolidDrawing, unknowns: Sequence[int], count: int, largest: int) -> None:
    """Refuse a part whose first mesh has more unknowns than are allowed."""
    if unknowns:
        return
    why = "the file's own mesh" if opened.fixed else "its coarsest mesh"
    raise ValueError(
        f"{opened.file}: {why} has {count} unknowns: allow them by `validate identify --largest {count}`, "
        f"now {largest}"
    )


def _check_apart(solid: ElasticSolid, ends: PartEnds) -> None:
    if np.intersect1d(solid.mesh.face_nodes(ends.base), solid.mesh.face_nodes(ends.tip)).size:
        raise ValueError(
            "--base and --tip: the faces meet at an edge: the part is held where it is loaded; choose others"
        )


def _stop(task: SolidTask, unknowns: Sequence[int], growth: float, limits: dict[TipLoad, MeshLimit]) -> str:
    """Why no finer mesh is made, empty where one is; ``growth`` of the unknowns is expected where none was seen."""
    if limits and max(one.relative for one in limits.values()) <= task.accuracy:
        return "accuracy"
    following = unknowns[-1] * (unknowns[-1] / unknowns[-2] if len(unknowns) > 1 else growth)
    if following > task.largest:
        return "size"
    return "memory" if following * BYTES > free_ram() else ""


def _unlimited(found: Sequence[Array]) -> MeshLimit:
    """Of fewer than three meshes: no order, and the interval is what they differ, or the whole of it."""
    last = found[-1]
    d = np.sqrt(np.diag(last))
    half = 3.0 * np.abs(last - found[-2]) if len(found) > 1 else np.outer(d, d)
    return MeshLimit(last, half, np.full((6, 6), np.nan))
