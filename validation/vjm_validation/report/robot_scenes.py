"""Whole robots in space: unloaded and at the critical point, the lumped model over the beams, to be turned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vjm.continuation.path import Equilibrium, Path
from vjm.io.machine_file import load_model
from vjm.machine.legs import ATTACHMENT, ROOT
from vjm.rotations import Array
from vjm_output.plot_style import FE, PAPER, REFINED, Picture
from vjm_validation.report.renders import rendered_states
from vjm_validation.report.scenes import radii_of, scene
from vjm_validation.report.skeleton import Skeleton
from vjm_validation.studies.robots import ROBOT, RobotStudy

SHOWN = (("isotropic", -1, REFINED), ("isotropic", 1, PAPER), ("Q1", -1, REFINED))
"""Pose, sign of the displacement along x, and the engine that is drawn over the finite elements."""


def robot_renders(study: RobotStudy) -> list[Picture]:
    """The Orthoglide pressed and pulled, where the study has the paths."""
    pictures = []
    for pose, sign, label in SHOWN:
        paths = {engine: study.curves.get((pose, sign, engine)) for engine in (FE, label)}
        usable = {engine: path for engine, path in paths.items() if path is not None and path.stations}
        if not usable:
            continue
        pressed = "pressed against x" if sign < 0 else "pulled along x"
        what = (
            "The leg along x of the paper's chains leans, that of beams stays straight. The artefact of one spring "
            "a link is the whole robot's too."
            if label == PAPER
            else "The leg along x bends sideways; beads bound the lumped model's segments."
        )
        pictures.append(
            rendered_states(
                f"robot_{pose}_{'compression' if sign < 0 else 'tension'}",
                f"The whole Orthoglide at {pose}, {pressed}",
                what,
                usable,
                robot_skeleton,
                from_above,
                scene(usable, robot_skeleton, _radii(), from_above),
            )
        )
    return pictures


def robot_skeleton(path: Path, point: Equilibrium) -> Skeleton:
    """The lines of a robot's legs, and thin ones from their ends to the middle of these, which is the platform."""
    own = [i for i, label in enumerate(path.stations) if label.part.partition("/")[2] not in ("", ROOT, ATTACHMENT)]
    rest, shape = path.points[0].shape[own], point.shape[own]
    stations = [path.stations[i] for i in own]
    legs = [label.part.partition("/")[0] for label in stations]
    parts = [label.part for label in stations]
    thin = [label.fraction > 1.0 for label in stations]
    ends = [max(i for i, name in enumerate(legs) if name == leg) for leg in dict.fromkeys(legs)]
    points, moved = [rest], [shape]
    pieces, joints = [], []
    begin = 0
    for row in range(1, len(legs) + 1):
        if row < len(legs) and legs[row] == legs[row - 1] and parts[row] != parts[row - 1]:
            joints.append(row)
        if row == len(legs) or legs[row] != legs[row - 1]:
            pieces += _of_leg(parts, thin, begin, row)
            begin = row
    centre, moved_centre = rest[ends].mean(axis=0), shape[ends].mean(axis=0)
    for end in ends:
        pieces.append((begin, begin + 2, True))
        begin += 2
        points.append(np.stack([rest[end], centre]))
        moved.append(np.stack([shape[end], moved_centre]))
        parts += ["platform", "platform"]
    unloaded = np.concatenate(points)
    return Skeleton(
        points=unloaded,
        moved=np.concatenate(moved) - unloaded,
        pieces=tuple(pieces),
        joints=(*joints, *ends),
        beads=path.engine not in (FE, PAPER),
        parts=tuple(parts),
    )


def _of_leg(parts: Sequence[str], thin: Sequence[bool], begin: int, end: int) -> list[tuple[int, int, bool]]:
    """Lines of the rows from ``begin`` to ``end``: one for each part, thin where a rigid arm leads to the next."""
    pieces: list[tuple[int, int, bool]] = []
    for row in range(begin + 1, end):
        fine = thin[row] or parts[row] != parts[row - 1]
        if pieces and pieces[-1][2] == fine:
            pieces[-1] = (pieces[-1][0], row + 1, fine)
        else:
            pieces.append((row - 1, row + 1, fine))
    return pieces


def from_above(drawn: Sequence[Skeleton]) -> tuple[Array, Array]:
    """Right and up ``(3,)`` of a view from the middle between the legs, so that none hides another."""
    rest = drawn[0].points
    begins = rest[[first for first, _, _ in drawn[0].pieces]]
    eye = np.array([1.0, 0.6, 0.8])
    # towards where the machine is not
    eye = eye * np.where(np.mean(begins, axis=0) > rest[-1], -1.0, 1.0)
    up = np.array([0.0, 0.0, 1.0])
    right = np.cross(up, eye)
    right /= np.linalg.norm(right)
    above = np.cross(eye, right)
    return right, above / np.linalg.norm(above)


def _radii() -> dict[str, float]:
    """Of the legs' beams, mm, by leg and part."""
    return radii_of(load_model(ROBOT))
