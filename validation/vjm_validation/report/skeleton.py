"""What of a chain is drawn: its lines, joints and ends, unloaded and displaced, and from where it is seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vjm.continuation.path import Equilibrium, Path
from vjm.model.joints import Joint
from vjm.model.machine import Machine
from vjm.model.parts import Beam
from vjm.rotations import Array
from vjm.vjm_engine import VjmEngine
from vjm_output.plot_style import FE, PAPER

MAGNIFICATIONS = (1, 2, 3, 5, 10, 20, 30, 50, 100, 200, 500, 1000)
SHARE = 0.2
"""Largest drawn displacement over the chain's extent: the shape shows and the machine is still recognised."""


@dataclass(frozen=True)
class Skeleton:
    """A chain as lines to draw.

    Attributes:
        points: ``(k, 3)``, mm, world, unloaded, from base to tool.
        moved: displacement ``(k, 3)`` of each, mm.
        pieces: (first row, last row + 1, whether thin) of each line. Thin are rigid arms and the gap that a
            lumped spring opens at the end of its rigid link.
        joints: rows of the passive joints.
        beads: whether the points bound lumped segments and deserve a mark.
        parts: name of the part of each point.
    """

    points: Array
    moved: Array
    pieces: tuple[tuple[int, int, bool], ...]
    joints: tuple[int, ...]
    beads: bool
    parts: tuple[str, ...] = ()

    def at(self, magnification: float) -> Array:
        """The points with their displacements magnified, ``(k, 3)``."""
        result: Array = self.points + magnification * self.moved
        return result


def skeleton(chain: Machine, path: Path, point: Equilibrium) -> Skeleton:
    """The lines of a path's chain at one of its points."""
    start = path.points[0]
    parts = [label.part for label in path.stations]
    thin = [label.fraction > 1.0 for label in path.stations]
    points, shape = start.shape, point.shape
    ends = _rigid_link_ends(chain, path, start)
    if ends:
        # a rigid link ends where its spring begins, which is no station: put it in front of the part's tip
        rows = list(ends)
        points = np.insert(points, rows, list(ends.values()), axis=0)
        shape = np.insert(shape, rows, list(_rigid_link_ends(chain, path, point).values()), axis=0)
        thin = [row in ends or flag for row, flag in enumerate(thin)]
        for row in reversed(rows):
            parts.insert(row, parts[row])
            thin.insert(row, False)
    return Skeleton(
        points=points,
        moved=shape - points,
        pieces=_pieces(parts, thin),
        joints=_joints(chain, parts),
        beads=path.engine not in (FE, PAPER),
        parts=tuple(parts),
    )


def _rigid_link_ends(chain: Machine, path: Path, point: Equilibrium) -> dict[int, Array]:
    """Where the rigid links of the paper's model end, before their springs, by the row of the tip behind."""
    if path.engine != PAPER:
        return {}
    model = VjmEngine().model(chain)
    kinematics = model.kinematics(point.state[: model.size])
    beams = {beam.name for beam in chain.beams}
    ends = {}
    for row, station in enumerate(model.stations):
        if station.part in beams and station.fraction == 0.0:
            spring = station.joint + 1
            ends[row + 1] = (kinematics.behind[spring] @ model.before[spring])[:3, 3]
    return ends


def _pieces(parts: Sequence[str], thin: Sequence[bool]) -> tuple[tuple[int, int, bool], ...]:
    pieces: list[tuple[int, int, bool]] = []
    for row in range(1, len(parts)):
        fine = thin[row] or parts[row] != parts[row - 1]
        if pieces and pieces[-1][2] == fine:
            pieces[-1] = (pieces[-1][0], row + 1, fine)
        else:
            pieces.append((row - 1, row + 1, fine))
    return tuple(pieces)


def _joints(chain: Machine, parts: Sequence[str]) -> tuple[int, ...]:
    """Rows where the passive joints sit: behind the part before them, or at the root of the first part."""
    rows, at = [], 0
    for part in chain.parts:
        if isinstance(part, Joint) and part.free:
            rows.append(at)
        elif part.name in parts:
            at = len(parts) - 1 - list(reversed(parts)).index(part.name)
            if not isinstance(part, Beam):
                at = min(at + 1, len(parts) - 1)
    return tuple(dict.fromkeys(rows))


def magnification(drawn: Sequence[Skeleton]) -> int:
    """The largest round factor that keeps the drawn displacements below `SHARE` of the chain's extent."""
    extent = max(float(np.max(np.ptp(one.points, axis=0))) for one in drawn)
    largest = max(float(np.max(np.linalg.norm(one.moved, axis=1))) for one in drawn)
    fitting = [m for m in MAGNIFICATIONS if m * largest <= SHARE * extent]
    return fitting[-1] if fitting else 1


@dataclass(frozen=True)
class Camera:
    """A view in parallel projection, so that a ruler holds everywhere in the picture.

    Attributes:
        focus: ``(3,)`` mm, world.
        right: unit vector ``(3,)`` to the right of the picture.
        up: unit vector ``(3,)``.
        half_width: of what has to be seen, mm.
        half_height: likewise.
    """

    focus: Array
    right: Array
    up: Array
    half_width: float
    half_height: float

    @property
    def towards_viewer(self) -> Array:
        """Unit vector ``(3,)`` from the scene to the eye."""
        result: Array = np.cross(self.right, self.up)
        return result

    @classmethod
    def framing(cls, right: Array, up: Array, drawn: Sequence[Skeleton], magnification: float) -> Camera:
        """The view along ``right × up`` that shows the unloaded and the displaced chains."""
        depth = np.cross(right, up)
        seen = np.vstack([drawn[0].points, *(one.at(magnification) for one in drawn)])
        across, above = seen @ right, seen @ up
        focus = (
            0.5 * (np.max(across) + np.min(across)) * right
            + 0.5 * (np.max(above) + np.min(above)) * up
            + np.mean(seen @ depth) * depth
        )
        return cls(focus, right, up, 0.5 * float(np.ptp(across)), 0.5 * float(np.ptp(above)))


def picture_axes(drawn: Sequence[Skeleton]) -> tuple[Array, Array]:
    """Right and up ``(3,)`` of a view onto the chain's axis and its largest sideways motion, from above."""
    rest = drawn[0].points
    axis = (rest[-1] - rest[0]) / np.linalg.norm(rest[-1] - rest[0])
    moved = np.vstack([one.moved for one in drawn])
    sideways = moved - np.outer(moved @ axis, axis)
    lateral = sideways[np.argmax(np.linalg.norm(sideways, axis=1))]
    if np.linalg.norm(lateral) < 1e-9:
        lateral = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    normal = np.cross(axis, lateral)
    normal = normal / np.linalg.norm(normal)
    up = np.eye(3)[2] if abs(normal[2]) < 0.8 else np.eye(3)[1]
    # the side from which the tool lies on the right
    if np.cross(up, normal) @ axis < 0.0:
        normal = -normal
    eye = normal - 0.25 * axis + 0.3 * up
    right = np.cross(up, eye)
    right = right / np.linalg.norm(right)
    above = np.cross(eye, right)
    return right, above / np.linalg.norm(above)


def ruler_length(drawn: Sequence[Skeleton]) -> float:
    """A round length, at most a quarter of the chain's extent, mm."""
    rough = 0.25 * float(np.max(np.ptp(drawn[0].points, axis=0)))
    decade = 10.0 ** np.floor(np.log10(rough))
    return float(max(m * decade for m in (1.0, 2.0, 5.0) if m * decade <= rough))
