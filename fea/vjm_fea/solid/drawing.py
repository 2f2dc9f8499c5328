"""Drawings in: STEP, BREP, closed STL and gmsh meshes, read and meshed by gmsh.

It is said whether a drawing holds one body, in one piece.
"""

from __future__ import annotations

import re
import signal
import threading
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import scipy.sparse
from scipy.sparse.csgraph import connected_components

from vjm.io.errors import printed
from vjm.rotations import Array
from vjm_fea.solid import load, work_apart
from vjm_fea.solid.faces import KINDS, Face, inside, is_drawing, re_entrant_edges
from vjm_fea.solid.mesh import Indices, SolidMesh, from_gmsh

"""gmsh's numbers of its elements."""


def one_body(gmsh: Any, name: str) -> int:  # noqa: ANN401
    """Make bodies that touch one, with common faces; gives how many they were.

    Raises:
        ValueError: there is none, or some do not touch.
    """
    bodies = [tag for _, tag in gmsh.model.getEntities(3)]
    if not bodies:
        raise ValueError(f"{name}: holds no solid, only surfaces or lines: export the part as a solid")
    count = len(bodies)
    if count == 1:
        return 1
    gmsh.model.occ.fragment([(3, bodies[0])], [(3, tag) for tag in bodies[1:]])
    gmsh.model.occ.synchronize()
    bodies = [tag for _, tag in gmsh.model.getEntities(3)]
    owner = {tag: tag for tag in bodies}
    for _, face in gmsh.model.getEntities(2):
        above, _ = gmsh.model.getAdjacencies(2, face)
        if len(above) == 2:
            old, new = owner[int(above[0])], owner[int(above[1])]
            owner = {tag: new if one == old else one for tag, one in owner.items()}
    _refuse(name, len(set(owner.values())))
    return count


def check_one_mesh(gmsh: Any, name: str, kind: str) -> int:  # noqa: ANN401
    """Refuse a mesh of tetrahedra, or the triangles of an STL, that fall apart; gives how many bodies it holds.

    Raises:
        ValueError: there is no body, or more than one.
    """
    if not gmsh.model.getEntities(3):
        raise ValueError(f"{name}: holds no solid, only surfaces or lines: export the part as a solid")
    corners, element = (3, TRIANGLE3) if kind == ".stl" else (4, TETRAHEDRON4)
    nodes = np.asarray(gmsh.model.mesh.getElementsByType(element)[1], dtype=np.int64).reshape(-1, corners)
    bodies = len([tag for _, tag in gmsh.model.getEntities(3)])
    if not len(nodes):
        return bodies
    pieces = _pieces(nodes)
    if kind == ".msh":
        _refuse(name, int(pieces.max()) + 1)
        return bodies
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    place = np.zeros(int(tags.max()) + 1, dtype=np.int64)
    place[tags.astype(np.int64)] = np.arange(len(tags))
    triangles = np.asarray(coordinates).reshape(-1, 3)[place[nodes]]
    surfaces = [triangles[pieces == k] for k in range(int(pieces.max()) + 1)]
    # a surface within another one is that of a hollow
    outer = [
        one
        for k, one in enumerate(surfaces)
        if not any(inside(one[0, 0], other) for m, other in enumerate(surfaces) if m != k)
    ]
    _refuse(name, len(outer))
    return bodies


def _pieces(nodes: Indices) -> Indices:
    """Number ``(m,)`` of the piece that each element, with its nodes ``(m, k)``, belongs to."""
    _, inverse = np.unique(nodes, return_inverse=True)
    rows = inverse.reshape(nodes.shape)
    pairs = np.concatenate([rows[:, [0, k]] for k in range(1, nodes.shape[1])])
    count = int(rows.max()) + 1
    links = scipy.sparse.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, labels = connected_components(links, directed=False)
    result: Indices = np.asarray(labels, dtype=np.int64)[rows[:, 0]]
    return result


def _refuse(name: str, count: int) -> None:
    if count > 1:
        raise ValueError(f"{name}: holds {count} bodies that do not touch: export one part, or join them")


# --- An STL as the polyhedron that it is: its flat patches as plane surfaces, which can be meshed anew at any size
#
# The triangles of a drawing that was written coarsely are bad elements, and splitting keeps their shape. Triangles
# that lie in one plane make one surface; the small ones of a curved face stay as they are.

FLAT = 1e-6
"""Distance from a plane or a line, over the drawing's diagonal, up to which a corner lies in it: the rounding of
coordinates with seven digits."""

Edge = tuple[int, int]


def build(gmsh: Any, points: Array, faces: dict[int, Indices]) -> dict[int, list[int]]:  # noqa: ANN401
    """Make a new model with the polyhedron, as one volume.

    Args:
        gmsh: the library.
        points: corners ``(n, 3)``, mm.
        faces: triangles ``(k, 3)``, indices into them, by the number of the face; closed together.

    Returns:
        The plane surfaces of every face.

    Raises:
        ValueError: a surface's border does not close.
    """
    tolerance = FLAT * float(np.linalg.norm(np.ptp(points, axis=0)))
    patches: list[tuple[int, Indices]] = []
    for number, triangles in faces.items():
        patches += [(number, one) for one in _flat_patches(points, triangles, tolerance)]
    owners = defaultdict(list)
    for k, (_, triangles) in enumerate(patches):
        for edge in _borders(triangles):
            owners[edge].append(k)
    chains = _straightened(points, list(owners), tolerance)
    gmsh.model.add("polyhedron")
    geo = gmsh.model.geo
    corner = {node: geo.addPoint(*points[node].tolist()) for node in {node for ends in chains for node in ends}}
    line = {ends: geo.addLine(corner[ends[0]], corner[ends[1]]) for ends in chains}
    sides = defaultdict(list)
    for ends, members in chains.items():
        for k in owners[members[0]]:
            sides[k].append(ends)
    made: dict[int, list[int]] = {number: [] for number in faces}
    for k, (number, _) in enumerate(patches):
        loops = sorted(_loops(sides[k]), key=lambda loop: -_size(points, loop))
        signed = [[line[e] if e in line else -line[e[::-1]] for e in loop] for loop in loops]
        made[number].append(geo.addPlaneSurface([geo.addCurveLoop(one) for one in signed]))
    geo.addVolume([geo.addSurfaceLoop([tag for tags in made.values() for tag in tags])])
    geo.synchronize()
    return made


def _flat_patches(points: Array, triangles: Indices, tolerance: float) -> list[Indices]:
    """Connected triangles that lie in one plane."""
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    neighbours = defaultdict(list)
    for k, row in enumerate(triangles):
        for edge in _edges(row):
            neighbours[edge].append(k)
    left = np.ones(len(triangles), dtype=bool)
    patches = []
    # the largest triangle knows its plane best
    for seed in np.argsort(-areas):
        if not left[seed]:
            continue
        left[seed] = False
        members, stack = [seed], [seed]
        normal = normals[seed] / max(areas[seed], 1e-300)
        while stack:
            triangle = stack.pop()
            for edge in _edges(triangles[triangle]):
                for other in neighbours[edge]:
                    if left[other] and np.abs((corners[other] - corners[seed, 0]) @ normal).max() <= tolerance:
                        left[other] = False
                        members.append(other)
                        stack.append(other)
        patches.append(triangles[members])
    return patches


def _edges(row: Indices) -> list[Edge]:
    a, b, c = (int(node) for node in row)
    return [(min(p, q), max(p, q)) for p, q in ((a, b), (b, c), (c, a))]


def _borders(triangles: Indices) -> list[Edge]:
    """Edges of one triangle only."""
    counts: dict[Edge, int] = defaultdict(int)
    for row in triangles:
        for edge in _edges(row):
            counts[edge] += 1
    return [edge for edge, count in counts.items() if count == 1]


def _straightened(points: Array, edges: list[Edge], tolerance: float) -> dict[Edge, list[Edge]]:
    """Edges that continue each other in one line as one, with the edges that it consists of."""
    chains: dict[Edge, list[Edge]] = {edge: [edge] for edge in edges}
    edges_at: dict[int, set[Edge]] = defaultdict(set)
    for edge in edges:
        for node in edge:
            edges_at[node].add(edge)
    for node in list(edges_at):
        if len(edges_at[node]) != 2:
            continue
        one, other = edges_at[node]
        a, b = (next(end for end in edge if end != node) for edge in (one, other))
        joined = (min(a, b), max(a, b))
        if a == b or joined in chains or _off(points[node], points[a], points[b]) > tolerance:
            continue
        chains[joined] = chains.pop(one) + chains.pop(other)
        for end in (a, b):
            edges_at[end] = (edges_at[end] - {one, other}) | {joined}
        del edges_at[node]
    return chains


def _off(point: Array, a: Array, b: Array) -> float:
    """Distance of a point from the line between two others; infinite where it is not between them."""
    along = b - a
    length = float(np.linalg.norm(along))
    if length == 0.0 or not 0.0 < float((point - a) @ along) < length**2:
        return float("inf")
    return float(np.linalg.norm(np.cross(point - a, along))) / length


def _loops(edges: list[Edge]) -> list[list[Edge]]:
    """Directed edges in closed loops."""
    edges_at = defaultdict(list)
    for edge in edges:
        for node in edge:
            edges_at[node].append(edge)
    left = set(edges)
    loops = []
    while left:
        first = next(iter(left))
        left.discard(first)
        loop, end = [first], first[1]
        while end != first[0]:
            following = next((edge for edge in edges_at[end] if edge in left), None)
            if following is None:
                raise ValueError("its triangles do not close around a flat face: repair it, or export STEP")
            left.discard(following)
            directed = following if following[0] == end else following[::-1]
            loop.append((directed[0], directed[1]))
            end = directed[1]
        loops.append(loop)
    return loops


def _size(points: Array, loop: list[Edge]) -> float:
    """Area within a loop."""
    corners = points[[edge[0] for edge in loop]]
    return 0.5 * float(np.linalg.norm(np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)))


# ------------------------------------------------------------------------------------------------------------------


TRIANGLE6, TRIANGLE3, TETRAHEDRON10, TETRAHEDRON4, LINE3 = 9, 2, 11, 4, 8
"""gmsh's numbers of its elements."""
LONGEST, SHORTEST = 2e4, 0.5
"""Diagonals in mm of parts that are believed: a machine's part of 20 m, one of half a millimetre."""
GRADING = 0.35
"""Size of elements at graded edges over that elsewhere."""
REACH = 3.0
"""Distance from a graded edge, in sizes of elements, over which they grow."""
SMOOTH = np.deg2rad(30.0)
"""Angle between the triangles of an STL up to which they belong to one face."""
ALGORITHM = 10
"""HXT, gmsh's fast Delaunay mesher."""
DELAUNAY = 1
AROUND = 12
"""Fewest elements around a full circle."""


class CoarseError(ValueError):
    """No mesh, or one too coarse for the curved faces of the part: a finer one may do."""


@dataclass
class SolidDrawing:
    """A solid in gmsh's hands, while `drawing` is open.

    Attributes:
        gmsh: the library, with this drawing in it.
        file: its name, for messages.
        faces: of the solid, from one.
        size: diagonal of the solid's box, mm.
        volume: mm³.
        re_entrant: its edges at which the stress has no bound.
        fixed: the file is itself a mesh of the inside, which can only be split.
        surfaces: gmsh's surfaces of every face.
        bodies: that the file holds, bonded where they touch.
    """

    gmsh: Any
    file: str
    faces: list[Face]
    size: float
    volume: float
    re_entrant: list[int]
    fixed: bool
    surfaces: dict[int, list[int]]
    bodies: int

    def mesh(self, size: float, graded: Sequence[int] = ()) -> SolidMesh:
        """A mesh of ten-node tetrahedra.

        Args:
            size: of the elements away from graded edges, mm; of a file that is a mesh, it is split into eighths
                until its elements are no longer than that.
            graded: faces at whose borders, as at re-entrant edges, the elements are smaller by `GRADING`.

        Raises:
            ValueError: gmsh finds no mesh.
        """
        try:
            if self.fixed:
                self._split(size)
            else:
                self.gmsh.model.mesh.clear()
                self._sizes(size, graded)
                self._fill()
            self.gmsh.model.mesh.setOrder(2)
            self._check_elements()
        except Exception as error:
            if isinstance(error, ValueError | MemoryError):
                raise
            raise CoarseError(f"{self.file}: no mesh at {printed(size, 3)} mm: {_said(error)}") from error
        return self._read()

    def _sizes(self, size: float, graded: Sequence[int]) -> None:
        gmsh, field = self.gmsh, self.gmsh.model.mesh.field
        for name in ("MeshSizeFromPoints", "MeshSizeExtendFromBoundary"):
            gmsh.option.setNumber(f"Mesh.{name}", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", AROUND)
        gmsh.option.setNumber("Mesh.MeshSizeMin", 0.0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        for one in field.list():
            field.remove(one)
        edges = sorted({*self._borders(graded), *self.re_entrant})
        if not edges:
            return
        distance, threshold = field.add("Distance"), field.add("Threshold")
        field.setNumbers(distance, "CurvesList", edges)
        field.setNumber(distance, "Sampling", 60)
        for key, value in (
            ("InField", distance), ("SizeMin", GRADING * size), ("SizeMax", size),
            ("DistMin", 0.0), ("DistMax", REACH * size),
        ):  # fmt: skip
            field.setNumber(threshold, key, value)
        field.setAsBackgroundMesh(threshold)

    def _borders(self, faces: Sequence[int]) -> set[int]:
        tags = [(2, tag) for face in faces for tag in self.surfaces[face]]
        pairs = self.gmsh.model.getBoundary(tags, combined=True, oriented=False)
        return {int(tag) for _, tag in pairs}

    def _fill(self) -> None:
        """Tetrahedra by the fast mesher, or where that fails by the one that is slow and sure."""
        gmsh = self.gmsh
        try:
            gmsh.model.mesh.generate(3)
        except Exception:
            filled = False
        else:
            filled = len(gmsh.model.mesh.getElementsByType(TETRAHEDRON4)[0]) > 0
        if not filled:
            gmsh.option.setNumber("Mesh.Algorithm3D", DELAUNAY)
            try:
                gmsh.model.mesh.clear()
                gmsh.model.mesh.generate(3)
            finally:
                gmsh.option.setNumber("Mesh.Algorithm3D", ALGORITHM)

    def _split(self, size: float) -> None:
        gmsh = self.gmsh
        gmsh.model.mesh.setOrder(1)
        while True:
            tags, _ = gmsh.model.mesh.getElementsByType(TETRAHEDRON4)
            if (6.0 * self.volume / max(1, len(tags))) ** (1.0 / 3.0) <= 1.05 * size:
                return
            gmsh.model.mesh.refine()

    def _check_elements(self) -> None:
        tags, _ = self.gmsh.model.mesh.getElementsByType(TETRAHEDRON10)
        if not len(tags):
            raise CoarseError(f"{self.file}: gmsh finds no mesh of its inside")
        quality = np.array(self.gmsh.model.mesh.getElementQualities(tags, "minDetJac"))
        if quality.min() <= 0.0:
            # edges that the curved surface curved too far are made straight enough
            self.gmsh.model.mesh.optimize("HighOrderElastic")
            quality = np.array(self.gmsh.model.mesh.getElementQualities(tags, "minDetJac"))
        if quality.min() <= 0.0:
            raise CoarseError(
                f"{self.file}: {int(np.sum(quality <= 0.0))} elements are turned inside out by its curved faces: "
                "allow a finer mesh by `validate identify --largest`"
            )

    def _read(self) -> SolidMesh:
        mesh = self.gmsh.model.mesh
        tags, coordinates, _ = mesh.getNodes()
        index = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
        index[tags.astype(np.int64)] = np.arange(len(tags))
        _, nodes = mesh.getElementsByType(TETRAHEDRON10)
        triangles: dict[int, Indices] = {}
        for face in self.faces:
            corners = [mesh.getElementsByType(TRIANGLE6, tag)[1] for tag in self.surfaces[face.number]]
            triangles[face.number] = index[np.concatenate(corners).astype(np.int64)].reshape(-1, 6)
        return from_gmsh(
            np.asarray(coordinates).reshape(-1, 3), index[nodes.astype(np.int64)].reshape(-1, 10), triangles
        )


@contextmanager
def gmsh_session() -> Iterator[ModuleType]:
    """gmsh, initialised in this process and finalised at the end.

    `gmsh.initialize` gives SIGPIPE its default action, so that the process would die of the next write to a closed
    pipe or socket. It is put back: Python has it ignored, and such a write raises BrokenPipeError.

    Raises:
        ImportError: gmsh is not installed or does not load.

    Example:
        >>> with gmsh_session() as gmsh:
        ...     gmsh.model.add("part")
    """
    gmsh = load("gmsh")
    of_pipes = signal.getsignal(signal.SIGPIPE) if hasattr(signal, "SIGPIPE") else None
    gmsh.initialize(["", "-nopopup"], readConfigFiles=False, interruptible=False)
    try:
        # only the main thread of Python may set an action
        if of_pipes is not None and threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGPIPE, of_pipes)
        gmsh.option.setNumber("General.Terminal", 0)
        yield gmsh
    finally:
        gmsh.finalize()


@contextmanager
def drawing(path: str | Path, scale: float = 1.0) -> Iterator[SolidDrawing]:
    """Open a drawing; gmsh works in this process, which `drawn_faces` and `identify` make a child.

    Args:
        path: of a STEP, BREP, STL or gmsh mesh file.
        scale: mm of one unit of the file; STEP files say their unit themselves and come in mm.

    Raises:
        ImportError: gmsh is not installed or does not load.
        ValueError: no such kind of file, not one closed solid, or no size that a part has; one line.
        OSError: the file cannot be read.
    """
    path = Path(path)
    if not is_drawing(path.name):
        raise ValueError(f"{path.name}: no kind of drawing that is known: give {', '.join(KINDS)}")
    with open(path, "rb") as file:
        if not file.read(1):
            raise ValueError(f"{path.name}: the file is empty")
    with gmsh_session() as gmsh:
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("Mesh.Algorithm3D", ALGORITHM)
        gmsh.option.setNumber("Mesh.RandomSeed", 1)
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        gmsh.option.setNumber("Geometry.OCCScaling", scale)
        gmsh.model.add("part")
        yield _opened(gmsh, path, scale)


def drawn_faces(path: Path, scale: float = 1.0) -> tuple[list[Face], float]:
    """The faces of a drawing and its volume, mm³; gmsh reads it in a child process.

    Args:
        path: as `drawing`.
        scale: as `drawing`.

    Raises:
        ImportError: gmsh is not installed or does not load.
        ValueError: as `drawing`, or gmsh met its limit of time.
        OSError: the file cannot be read.
    """
    return work_apart(_read_faces, path, scale, path=path)


def _read_faces(path: Path, scale: float) -> tuple[list[Face], float]:
    with drawing(path, scale) as opened:
        return opened.faces, opened.volume


def _opened(gmsh: Any, path: Path, scale: float) -> SolidDrawing:  # noqa: ANN401
    kind = path.suffix.lower()
    try:
        if kind in (".stl", ".msh"):
            gmsh.merge(str(path))
        else:
            gmsh.model.occ.importShapes(str(path), highestDimOnly=False)
            gmsh.model.occ.synchronize()
    except Exception as error:
        raise ValueError(f"{path.name}: cannot be read as {kind[1:].upper()}: {_said(error)}") from error
    if kind in (".stl", ".msh") and scale != 1.0:
        gmsh.model.mesh.affineTransform([scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0])
    meshed = kind in (".stl", ".msh")
    if kind == ".stl":
        _close(gmsh, path.name)
    bodies = check_one_mesh(gmsh, path.name, kind) if meshed else one_body(gmsh, path.name)
    corners = np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
    size = float(np.linalg.norm(corners[1] - corners[0]))
    _check_size(path.name, size)
    if kind == ".msh":
        tags, _ = gmsh.model.mesh.getElementsByType(TETRAHEDRON4)
        if not len(tags):
            raise ValueError(f"{path.name}: holds no four-node tetrahedra: save the mesh with order 1")
    elif kind != ".stl":
        _mesh_faces(gmsh, path.name, size)
    faces = [_face(gmsh, int(tag), meshed=meshed) for _, tag in gmsh.model.getEntities(2)]
    surfaces = {face.number: [face.number] for face in faces}
    if kind == ".stl":
        surfaces = _polyhedron(gmsh, path.name, faces, size)
    if kind in (".step", ".stp"):
        names = _step_names(path)
        if len(names) == len(faces):
            faces = [replace(face, name=face.name or name) for face, name in zip(faces, names, strict=True)]
    if meshed:
        # of the tetrahedra: triangles may be turned inside out
        tags, _ = gmsh.model.mesh.getElementsByType(TETRAHEDRON4)
        volume = float(np.sum(gmsh.model.mesh.getElementQualities(tags, "volume")))
    else:
        volume = sum(float(gmsh.model.occ.getMass(3, tag)) for _, tag in gmsh.model.getEntities(3))
    fixed = kind == ".msh"
    edges = [] if fixed else re_entrant_edges(gmsh, np.concatenate([face.triangles for face in faces]))
    return SolidDrawing(gmsh, path.name, faces, size, volume, edges, fixed, surfaces, bodies)


def _polyhedron(gmsh: Any, name: str, faces: list[Face], size: float) -> dict[int, list[int]]:  # noqa: ANN401
    """The triangles of an STL as flat surfaces in a new model, coarsely filled; the surfaces of every face."""
    points, nodes = np.unique(
        np.concatenate([face.triangles.reshape(-1, 3) for face in faces]), axis=0, return_inverse=True
    )
    rows = np.split(nodes.reshape(-1, 3), np.cumsum([len(face.triangles) for face in faces])[:-1])
    try:
        surfaces = build(gmsh, points, {face.number: row for face, row in zip(faces, rows, strict=True)})
        gmsh.option.setNumber("Mesh.MeshSizeMax", size / 12.0)
        gmsh.model.mesh.generate(3)
    except Exception as error:
        raise ValueError(
            f"{name}: no mesh of its inside, its triangles may cross: {_said(error)}; repair it, or export STEP"
        ) from error
    return surfaces


def _mesh_faces(gmsh: Any, name: str, size: float) -> None:  # noqa: ANN401
    """A coarse mesh of the surface, which says where the faces are."""
    gmsh.option.setNumber("Mesh.MeshSizeMax", size / 12.0)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 16)
    try:
        gmsh.model.mesh.generate(2)
    except Exception as error:
        raise ValueError(f"{name}: its faces cannot be meshed: {_said(error)}") from error


def _check_size(name: str, size: float) -> None:
    if size > LONGEST:
        raise ValueError(
            f"{name}: the part is {printed(size / 1e6, 3)} km long: is the file in other units, metres taken for "
            "millimetres, say? Give the mm of one unit of the file, "
            "`validate identify --unit-mm`, or unit_mm in a model"
        )
    if size < SHORTEST:
        raise ValueError(
            f"{name}: the part is {printed(size, 3)} mm long: is the file in metres? Give "
            "`validate identify --unit-mm 1000`, or unit_mm = 1000 in a model"
        )


def _close(gmsh: Any, name: str) -> None:  # noqa: ANN401
    """Make a solid of an STL's triangles.

    Raises:
        ValueError: it is open; says how many edges are.
    """
    gmsh.model.mesh.removeDuplicateNodes()
    _, nodes = gmsh.model.mesh.getElementsByType(TRIANGLE3)
    triangles = np.asarray(nodes, dtype=np.int64).reshape(-1, 3)
    if not len(triangles):
        raise ValueError(f"{name}: holds no triangle")
    pairs = np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    _, counts = np.unique(pairs, axis=0, return_counts=True)
    if np.any(counts != 2):
        raise ValueError(
            f"{name}: the surface is not closed: {int(np.sum(counts != 2))} edges do not join two triangles; "
            "repair it, or export the part as STEP"
        )
    # the triangles stay as they are; faces end where two of them meet at an angle
    gmsh.model.mesh.classifySurfaces(SMOOTH, True, False, np.pi)
    surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
    gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(surfaces)])
    gmsh.model.geo.synchronize()


def _face(gmsh: Any, tag: int, *, meshed: bool) -> Face:  # noqa: ANN401
    """A face with the triangles of the coarse mesh; area and centre are exact where the drawing is no mesh."""
    corners = []
    for kind, count in ((TRIANGLE3, 3), (TRIANGLE6, 6)):
        _, nodes = gmsh.model.mesh.getElementsByType(kind, tag)
        if len(nodes):
            corners.append(np.asarray(nodes, dtype=np.int64).reshape(-1, count)[:, :3])
    tags, coordinates, _ = gmsh.model.mesh.getNodes(2, tag, includeBoundary=True)
    index = {int(one): i for i, one in enumerate(tags)}
    points = np.asarray(coordinates).reshape(-1, 3)
    rows = np.vstack(corners) if corners else np.zeros((0, 3), dtype=np.int64)
    triangles = points[[[index[int(node)] for node in row] for row in rows]] if len(rows) else np.zeros((0, 3, 3))
    areas = 0.5 * np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )
    if meshed:
        area = float(areas.sum())
        centre = (areas[:, None] * triangles.mean(axis=1)).sum(axis=0) / max(area, 1e-300)
    else:
        area = float(gmsh.model.occ.getMass(2, tag))
        centre = np.array(gmsh.model.occ.getCenterOfMass(2, tag))
    name = str(gmsh.model.getEntityName(2, tag)).rpartition("/")[2]
    groups = [gmsh.model.getPhysicalName(2, one) for one in gmsh.model.getPhysicalGroupsForEntity(2, tag)]
    every = triangles.reshape(-1, 3)
    return Face(
        tag,
        next((one for one in groups if one), name),
        area,
        centre,
        every.min(axis=0),
        every.max(axis=0),
        triangles,
    )


def _step_names(path: Path) -> list[str]:
    """Names of the faces of a STEP file with one shell, in its order; empty where there are none."""
    text = path.read_text(encoding="utf-8", errors="replace")
    shells = re.findall(r"=\s*CLOSED_SHELL\s*\(\s*'[^']*'\s*,\s*\(([^)]*)\)", text)
    if len(shells) != 1:
        return []
    named = dict(re.findall(r"(#\d+)\s*=\s*ADVANCED_FACE\s*\(\s*'([^']*)'", text))
    names = [named.get(one.strip(), "") for one in shells[0].split(",")]
    return names if any(names) else []


def _said(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
