"""From a drawing to the compliance of a part.

A part is meshed until the asked accuracy is met, two bounds, mass; and the compliances that model files take from
drawings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from vjm.child_process import Progress, free_ram
from vjm.io.solid_compliance import LIKE, SolidResult, SolidTable
from vjm.rotations import Array, shift_compliance
from vjm_fea.solid import work_apart
from vjm_fea.solid.compliance import Answer, PartEnds, RootSupport, TipLoad, answer, face_centre
from vjm_fea.solid.drawing import CoarseError, SolidDrawing, drawing
from vjm_fea.solid.elasticity import UPPER_WRENCH as UPPER
from vjm_fea.solid.elasticity import ElasticSolid, IsotropicMaterial, away_from_ends, stress_forms
from vjm_fea.solid.faces import selected

# --- A part's own sections from base to tip, and the column that they make ----------------------------------------

STATIONS = 41
"""Sections from base to tip. Of a part that tapers by a factor e the second moments are 0.01 % off by that."""
ELEMENTS = 5
"""Of the column between two of them: Euler's load is 1e-5 off."""


@dataclass(frozen=True)
class SectionsAlong:
    """Sections across the line from the base's centre to the tip's.

    Attributes:
        x: places ``(n,)`` along the line, mm.
        length: of the line, mm.
        axes: ``(3, 3)``, columns along the line and across it.
        area: ``(n,)`` mm².
        offset: of their centres from the line, across it, ``(n, 2)`` mm.
        second: second moments of area about their centres ``(n, 2, 2)``, mm⁴: ``∫ r rᵀ dA``, r across the line.
        depth: the larger width across the line, along the part's principal axes, ``(n,)`` mm.
    """

    x: Array
    length: float
    axes: Array
    area: Array
    offset: Array
    second: Array
    depth: Array

    @property
    def gyration(self) -> float:
        """Mean of the sections' larger radii of gyration, mm."""
        return float(np.mean(np.sqrt(np.linalg.eigvalsh(self.second)[:, 1] / self.area)))

    @property
    def straight(self) -> bool:
        """Whether the centres keep to the line, to a tenth of the depth."""
        return bool(np.all(np.linalg.norm(self.offset, axis=1) <= 0.1 * self.depth))


def sections_along(solid: ElasticSolid, start: Array, end: Array) -> SectionsAlong | None:
    """Sections of a meshed part between two points ``(3,)``; None where a plane across the line meets nothing.

    Each is a mean over twice the distance of two stations, weighted by a hat function: all of it is integrals over
    the volume, which the mesh gives without any cut.
    """
    length = float(np.linalg.norm(end - start))
    if length == 0.0:
        return None
    along = (end - start) / length
    axes = np.column_stack([along, np.linalg.svd(along[None, :])[2][1:].T])
    x, y, z = np.einsum("ab,beq->aeq", axes.T, np.asarray(solid.basis.global_coordinates()) - start[:, None, None])
    dx, step = np.asarray(solid.basis.dx), length / (STATIONS - 1)
    inside = (x >= 0.0) & (x <= length)
    low = np.clip((x / step).astype(int), 0, STATIONS - 2)
    share = x / step - low
    fields = np.stack([np.ones_like(x), x, y, z, y * y, y * z, z * z]) * dx
    sums = np.zeros((len(fields), STATIONS))
    for k, shape in enumerate(fields):
        for node, weight in ((low, 1.0 - share), (low + 1, share)):
            sums[k] += np.bincount(node[inside], (weight * shape)[inside], minlength=STATIONS)
    if np.any(sums[0] <= 0.0):
        return None
    width = np.full(STATIONS, step)
    width[[0, -1]] *= 0.5
    # hats at the ends are half ones, with their centre a third of the step inside
    place: Array = np.arange(STATIONS, dtype=np.float64) * step
    place[[0, -1]] += np.array([1.0, -1.0]) * step / 3.0
    area = sums[0] / width
    centre = (sums[2:4] / sums[0]).T
    second = np.empty((STATIONS, 2, 2))
    second[:, 0, 0], second[:, 0, 1], second[:, 1, 1] = sums[4:] / sums[0]
    second[:, 1, 0] = second[:, 0, 1]
    # the squares of the offsets within one hat belong to the slope of the centres, not to the section
    second = (second - centre[:, :, None] * centre[:, None, :]) * area[:, None, None]
    # widths along the axes of the whole, of what lies nearest to each station
    near = np.clip(np.rint(x / step).astype(int), 0, STATIONS - 1)
    widths = []
    for direction in np.linalg.eigh(second.sum(axis=0))[1].T:
        across = y * direction[0] + z * direction[1]
        highest, lowest = np.full(STATIONS, -np.inf), np.full(STATIONS, np.inf)
        np.maximum.at(highest, near[inside], across[inside])
        np.minimum.at(lowest, near[inside], across[inside])
        widths.append(highest - lowest)
    return SectionsAlong(place, length, axes, area, centre, second, np.max(widths, axis=0))


@dataclass(frozen=True)
class SectionedColumn:
    """A part as a column of its own sections, held at its base and free at its tip.

    Attributes:
        force: compression at the tip under which it buckles, N, without shear.
        misfit: largest difference of the bending that its sections imply to the part's, over √(c_ii c_jj).
    """

    force: float
    misfit: float


def column(sections: SectionsAlong, modulus: float, compliance: Array) -> SectionedColumn:
    """Buckling of the column whose bending stiffness is the modulus times the sections' second moments.

    Args:
        sections: of the part.
        modulus: Young's, MPa.
        compliance: of the part, ``(6, 6)``, read at the line's end, the drawing's axes.
    """
    n = ELEMENTS * (STATIONS - 1)
    h = sections.length / n
    middle = (np.arange(n) + 0.5) * h
    EI = np.empty((n, 2, 2))
    for i in range(2):
        for j in range(2):
            EI[:, i, j] = modulus * np.interp(middle, sections.x, sections.second[:, i, j])
    K, M = np.zeros((2 * (n + 1),) * 2), np.zeros((2 * (n + 1),) * 2)
    slope, mass = np.array([[1.0, -1.0], [-1.0, 1.0]]) / h, h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    for e in range(n):
        part = slice(2 * e, 2 * e + 4)
        K[part, part] += np.kron(slope, EI[e])
        M[part, part] += np.kron(mass, np.eye(2))
    # the slope is zero at the base; (EI θ')' + P θ = 0
    force = float(scipy.linalg.eigh(K[2:, 2:], M[2:, 2:], eigvals_only=True, subset_by_index=[0, 0])[0])
    # a couple m turns by ∫ (EI)⁻¹ m ds and moves by ∫ (L − s) (EI)⁻¹ m ds; slopes of (y, z) are (φz, −φy)
    inverse = np.linalg.inv(EI)
    turn = h * inverse.sum(axis=0)
    move = h * np.einsum("k,kij->ij", sections.length - middle, inverse)
    rows = np.kron(np.eye(2), sections.axes).T
    own = rows @ compliance @ rows.T
    slopes = np.array([[0.0, 1.0], [-1.0, 0.0]])
    found_turn = slopes @ own[4:, 4:] @ slopes.T
    found_move = own[1:3, 4:] @ slopes.T
    d = np.sqrt(np.diag(own))
    scale_turn = np.outer(d[[5, 4]], d[[5, 4]])
    scale_move = np.outer(d[1:3], d[[5, 4]])
    misfit = max(
        float(np.max(np.abs(turn - found_turn) / scale_turn)), float(np.max(np.abs(move - found_move) / scale_move))
    )
    return SectionedColumn(force, misfit)


# ------------------------------------------------------------------------------------------------------------------


# --- What a sequence of meshes says of the limit: observed order, extrapolated value, interval --------------------
#
# After Roache, *Verification and Validation in Computational Science and Engineering* (1998), chapter 5: three
# meshes with a common ratio r give the order ``p = ln((c1 − c2)/(c2 − c3))/ln r``, the limit
# ``c3 + (c3 − c2)/(rᵖ − 1)``, and an interval of `SAFE` times what the extrapolation changed. Where no order can be
# seen, the interval is `UNSEEN` times what the last meshes differ.

SAFE, UNSEEN = 1.25, 3.0
LOWEST, HIGHEST = 0.7, 4.0
"""Orders that meshes have: a re-entrant corner makes twice its exponent (1.09 at 90°, a clamped edge about
1.4), smooth solutions of quadratic elements 4."""
CHANCE = 4.5
"""Order from which on two meshes agree by chance: irregular meshes come and go by some change."""
FLOOR = 1e-7
"""Scaled difference of meshes below which they agree."""


@dataclass(frozen=True)
class MeshLimit:
    """A compliance beyond the last mesh; scaled means over √(c_ii c_jj).

    Attributes:
        compliance: ``(6, 6)``.
        interval: half of it, ``(6, 6)``.
        order: observed ``(6, 6)``, NaN where none could be seen.
    """

    compliance: Array
    interval: Array
    order: Array

    @property
    def relative(self) -> float:
        """The largest half-width, scaled."""
        d = np.sqrt(np.diag(self.compliance))
        return float(np.max(self.interval / np.outer(d, d)))


def limit(sizes: Sequence[float], compliances: Sequence[Array]) -> MeshLimit:
    """Extrapolate from the last three meshes.

    Args:
        sizes: of the elements, mm, falling.
        compliances: ``(6, 6)`` on each mesh; three or more.
    """
    h = np.asarray(sizes[-3:], dtype=float)
    c1, c2, c3 = (np.asarray(one) for one in compliances[-3:])
    d = np.sqrt(np.diag(c3))
    scale = np.outer(d, d)
    near, far = (c3 - c2) / scale, (c2 - c1) / scale
    value, interval, order = c3.copy(), np.zeros((6, 6)), np.full((6, 6), np.nan)
    for i in range(6):
        for j in range(i, 6):
            v, half, p = _entry(near[i, j], far[i, j], h)
            value[i, j] = value[j, i] = c3[i, j] + v * scale[i, j]
            interval[i, j] = interval[j, i] = half * scale[i, j]
            order[i, j] = order[j, i] = p
    return MeshLimit(value, interval, order)


def _entry(near: float, far: float, h: NDArray[np.float64]) -> tuple[float, float, float]:
    """Change beyond the last mesh, half-width and order of one scaled entry."""
    size = max(abs(near), abs(far))
    if size < FLOOR:
        return 0.0, FLOOR, np.nan
    p = _order(near, far, h)
    if not LOWEST <= p <= CHANCE:
        # rising and falling by turns, slower or faster than anything known: the meshes only say how far apart
        return 0.0, UNSEEN * size, np.nan
    p = min(p, HIGHEST)
    change = near / ((h[1] / h[2]) ** p - 1.0)
    return change, max(SAFE * abs(change), FLOOR), p


def _order(near: float, far: float, h: NDArray[np.float64]) -> float:
    """Observed order of three meshes, whose ratios may differ a little; NaN where the changes have two signs."""
    if near == 0.0 or far / near <= 1.0:
        return np.nan
    p = np.log(far / near) / np.log(h[1] / h[2])
    for _ in range(30):
        q = np.log(((h[0] / h[1]) ** p - 1.0) / ((h[1] / h[2]) ** p - 1.0))
        p = max(0.1, (np.log(far / near) - q) / np.log(h[1] / h[2]))
    return float(p)


# ------------------------------------------------------------------------------------------------------------------


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
        point: point ``(3,)`` mm at which the compliance is read; None: the tip's centre of area.
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
    point: Array | None = None
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
        point: where the compliance is read ``(3,)``, mm.
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
    point: Array
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
        tip_compliance = shift_compliance(C, self.tip_centre - self.point)
        return column(self.sections, self.task.material.youngs_modulus, tip_compliance)

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
    return PartEnds(tuple(base), tuple(tip), task.point, task.held)


def _identify(task: SolidTask, opened: SolidDrawing, progress: Progress) -> SolidCompliance:
    ends = chosen_ends(task, opened)
    tips = task.tips
    # three meshes have to fit; the first one may be split once more than it had to be
    size = _first_size(opened, ends, min(task.first, task.largest // (512 if opened.fixed else 10)))
    sizes: list[float] = []
    unknowns: list[int] = []
    compliances: dict[TipLoad, list[Array]] = {tip: [] for tip in tips}
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
                compliances[tip].pop()
        sizes.append(size)
        unknowns.append(solid.mesh.unknowns)
        stage = f"mesh {len(sizes)}: {unknowns[-1]} unknowns"
        stiffness = solid.stiffness()
        answers = {}
        for k, tip in enumerate(tips):
            progress(stage, 1 + k, 1 + len(tips))
            answers[tip] = answer(solid, ends, tip, stiffness)
            compliances[tip].append(answers[tip].compliance)
        progress(stage, 1 + len(tips), 1 + len(tips))
        if len(sizes) >= FEWEST:
            limits = {tip: limit(sizes, compliances[tip]) for tip in tips}
        stopped = _stop(task, unknowns, SPLIT if opened.fixed else GROWTH, limits)
        if stopped:
            break
        size /= 2.0 if opened.fixed else RATIO
    centres = face_centre(solid, ends.base), face_centre(solid, ends.tip)
    if not limits:
        limits = {tip: _unlimited(compliances[tip]) for tip in tips}
    surface = sum(face.area for face in opened.faces)
    return SolidCompliance(
        task=task,
        bounds={
            tip: Bound(limits[tip], answers[tip].fitted, answers[tip].left_out, tuple(compliances[tip]))
            for tip in tips
        },
        sizes=tuple(sizes),
        unknowns=tuple(unknowns),
        stopped=stopped,
        volume=solid.volume,
        centre=solid.centroid,
        base_centre=centres[0],
        tip_centre=centres[1],
        point=centres[1] if ends.point is None else np.asarray(ends.point, dtype=float),
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


def _unlimited(compliances: Sequence[Array]) -> MeshLimit:
    """Of fewer than three meshes: no order, and the interval is what they differ, or the whole of it."""
    last = compliances[-1]
    d = np.sqrt(np.diag(last))
    half = 3.0 * np.abs(last - compliances[-2]) if len(compliances) > 1 else np.outer(d, d)
    return MeshLimit(last, half, np.full((6, 6), np.nan))


def computed(path: Path, table: SolidTable) -> SolidResult:
    """A compliance by solid finite elements.

    Raises:
        ImportError: the extra ``solid`` is not installed.
        ValueError: a bad drawing, face or material, or the asked accuracy is not met.
    """
    tip = TipLoad(table.tip_moves)
    task = SolidTask(
        path=path,
        material=IsotropicMaterial(table.youngs_modulus_MPa, table.poissons_ratio),
        base=_words(table.base),
        tip=_words(table.tip),
        held=RootSupport(table.base_held),
        unit_mm=table.unit_mm,
        accuracy=0.01 * table.accuracy_percent,
        tips=(tip,),
    )
    part = identify(task)
    limit, column = part.bounds[tip].limit, part.column
    if limit.relative > task.accuracy:
        raise ValueError(
            f"{path.name}: {100.0 * limit.relative:.2g} % is as near as {part.unknowns[-1]} unknowns come: ask "
            "for less by accuracy_percent"
        )
    away = away_from_ends(part.solid, [*part.ends.base, *part.ends.tip], part.thickness)
    points, forms = stress_forms(part.solid, part.answers[tip].displacements, away)
    return SolidResult(
        drawing=path.name,
        compliance=limit.compliance.tolist(),
        interval=limit.interval.tolist(),
        reach_mm=(part.point - part.base_centre).tolist(),
        volume_mm3=part.volume,
        centre_of_mass_mm=(part.centre - part.base_centre).tolist(),
        thickness_mm=part.thickness,
        bodies=part.bodies,
        buckling_N=column.force if column is not None and column.misfit + limit.relative <= LIKE else None,
        stress_at_mm=(points - part.base_centre).tolist(),
        stress_forms=forms[:, UPPER[0], UPPER[1]].tolist(),
        unknowns=part.unknowns[-1],
    )


def _words(faces: list[str] | str) -> tuple[str, ...]:
    return (faces,) if isinstance(faces, str) else tuple(faces)
