"""The chain and the load cases of a case on one mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.linalg import expm

from vjm.io.load_cases import from_plain
from vjm.io.schema import rotation
from vjm.model.joints import Joint
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Part, RigidOffset, Section
from vjm.rotations import AXES, Array, frame, translation, turn
from vjm_validation.verification.library import ArcTable, Case, RodTable, RunTable

ARC = "arc"
"""Name of the whole arc as a place for loads and points."""
POSTURE = "straight"
"""Label of a case's only posture."""


def chain_of(case: Case, mesh: int) -> Machine:
    """The chain of a case; an arc or a rod has ``mesh`` sides, any other chain is the same on every mesh."""
    file = case.file
    if file.arc is not None:
        return arc_chain(file.name, file.arc, mesh, case.files)
    if file.rod is not None:
        return rod_chain(file.name, file.rod, mesh, case.files)
    assert file.chain is not None
    table = file.chain
    parts = tuple(part.part() for part in table.parts)
    return Machine(
        file.name,
        parts,
        base=frame(rotation(table.turns)),
        postures={POSTURE: np.array(table.posture, dtype=float)},
        held={POSTURE: {part.name: 0.0 for part in parts if isinstance(part, Joint) and part.held}},
        title=file.title,
        files=case.files,
    )


def arc_chain(name: str, arc: ArcTable, sides: int, files: Mapping[str, str] | None = None) -> Machine:
    """An arc as straight sides, each along the chord of its piece but through the piece's own centroid.

    Rigid arms join the sides to the corners, which are points of the arc, and a section is softened so that a side
    deflects like the length of arc that it stands for. Then the zeroth and the first moment of a piece's length
    are exact and the second is to the leading order. In a plane a side is as flexible as its piece but for terms of
    the fourth order in the angle that it subtends. A chord in the arc's place would err with the second.
    """
    angle = np.deg2rad(arc.angle_deg) / sides
    chord = 2.0 * arc.radius_mm * np.sin(0.5 * angle)
    section = _softened(arc.section.stiffness(), chord / (arc.radius_mm * angle))
    bulge = arc.radius_mm * (np.sin(0.5 * angle) / (0.5 * angle) - np.cos(0.5 * angle))
    out, back = translation([0.0, bulge, 0.0]), translation([0.0, -bulge, 0.0])
    # a chord leaves the tangent by half of the angle that it subtends
    half = turn(AXES["z"], -0.5 * angle)
    parts: list[Part] = [RigidOffset(corner_name(0), half @ out)]
    for i in range(1, sides + 1):
        parts.append(Beam(f"side-{i}", chord, section=section))
        parts.append(RigidOffset(f"arm-{i}", back))
        parts.append(RigidOffset(corner_name(i), half if i == sides else half @ half @ out))
    if arc.hinged_end:
        parts.append(Joint("hinge", AXES["z"], passive=True))
    base = turn(AXES["z"], np.deg2rad(arc.start_deg))
    posture = np.zeros(1 if arc.hinged_end else 0)
    return Machine(name, tuple(parts), base=base, postures={POSTURE: posture}, files=files or {})


def rod_chain(name: str, rod: RodTable, sides: int, files: Mapping[str, str] | None = None) -> Machine:
    """A rod of constant curvature as straight beams, each along the tangent at the middle of its piece.

    Rigid arms join the beams' ends to the rod's own points, so that the unloaded shape is exact on any mesh. A beam
    of the piece's length stands for the piece with an error of the second order in the angle that it turns by.
    """
    length = rod.length_mm / sides
    half = _along(np.array(rod.curvature_per_mm), 0.5 * length)
    back = translation([-0.5 * length, 0.0, 0.0])
    parts: list[Part] = [RigidOffset(corner_name(0), half @ back)]
    for i in range(1, sides + 1):
        parts.append(Beam(f"side-{i}", length, section=rod.section.stiffness()))
        parts.append(RigidOffset(corner_name(i), back @ half if i == sides else back @ half @ half @ back))
    base = frame(rotation(rod.turns))
    return Machine(name, tuple(parts), base=base, postures={POSTURE: np.zeros(0)}, files=files or {})


def _along(curvature: Array, length: float) -> Array:
    """Frame ``(4, 4)`` of a curve's section after a length of it, from its own frame before."""
    twist = np.zeros((4, 4))
    twist[:3, :3] = np.cross(curvature, np.eye(3)).T
    twist[0, 3] = 1.0
    moved: Array = expm(twist * length)
    return moved


def _softened(section: Section, factor: float) -> Section:
    stiffness = {name: factor * getattr(section, name) for name in ("EA", "GJ", "EIy", "EIz", "GAy", "GAz")}
    return replace(section, **stiffness)


def corner_name(number: int) -> str:
    """Name of the rigid piece that begins at one corner of an arc; the root's is 0."""
    return f"corner-{number}"


def place(part: str, at: float, sides: int) -> tuple[str, float]:
    """Part and fraction of a point; one of the arc becomes the root of the rigid piece at one of its corners.

    Raises:
        ValueError: the point is no corner of the polygon.
    """
    if part != ARC:
        return part, at
    side = at * sides
    if abs(side - round(side)) > 1e-9:
        raise ValueError(f"{at} of the arc is no corner of a polygon of {sides} sides")
    return corner_name(round(side)), 0.0


def load_case_of(run: RunTable, mesh: int) -> LoadCase:
    """The load case of a run.

    Raises:
        ValueError: it makes no sense.
    """
    data = run.load_case.model_dump(exclude_none=True)
    places = [*data["loads"], *([data["control"]] if isinstance(data["control"], dict) else [])]
    for table in places:
        table["part"], table["at"] = place(table["part"], table["at"], mesh)
    return from_plain({"posture": POSTURE, **data})


def unloaded_position(chain: Machine) -> Array:
    """Position ``(3,)`` of the end-effector without load, mm, world."""
    model = Mechanism(chain)
    position: Array = model.kinematics(model.configuration(chain.posture(POSTURE))).end[:3, 3]
    return position
