"""Files of bodies and joints: a machine as its drawing shows it. Its loops are found from what connects the bodies.

All places and directions are those of one posture, the drawn one, in the axes of the world. Joints and beams
connect bodies; the ground is one of them. A tree of them is taken from the ground on, and the rest closes
loops. The result is the document of a chain file, which has closures for the loops, and is checked as one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pydantic

from vjm.io.body_joints import JOINT_KINDS, BodyJointTable, Content, check_keys, coordinates, joint_parts
from vjm.io.body_tables import BodyBeamTable, BodyFile, BodyTable, EndTable, SpringTable
from vjm.io.closure_tables import CouplingTable
from vjm.io.errors import ModelFileError, did_you_mean, one_line
from vjm.io.schema import ModelFile, known_keys
from vjm.io.sections import Table
from vjm.machine.closing import Closing
from vjm.rotations import Array, rotation_vector

KIND = "bodies"
GROUND = "ground"
"""Name of the body that does not move."""
DRAWN = "drawn"
"""Label of the posture in which the file gives all places."""
DRAWN_BESIDE = 1e-6
"""Of a beam's length: places in a file have six digits."""
END = "end-effector"
"""Name of the last part, behind the body that carries the tool."""

_TABLES: dict[str, type[Table]] = {
    "": BodyFile, "bodies": BodyTable, "joint": BodyJointTable, "beams": BodyBeamTable,
    "end": EndTable, "units": Table,
    "point_spring": SpringTable, "coupling": CouplingTable,
}  # fmt: skip
_CUT_LAST = ("beam", *JOINT_KINDS)
"""Where loops are cut: at a joint of the last kind, if there is one."""


@dataclass(frozen=True)
class _Edge:
    """A joint or beam between two bodies."""

    table: BodyJointTable | BodyBeamTable
    kind: str
    bodies: tuple[str, str]
    places: tuple[Array, Array]
    """Where it begins and ends, world axes, as drawn."""


@dataclass
class _BodyTree:
    """The parts of a chain file as they are strung."""

    edges: list[_Edge]
    masses: Mapping[str, BodyTable]
    parts: list[Content] = field(default_factory=list)
    closures: list[Content] = field(default_factory=list)
    origin: dict[str, Array] = field(default_factory=lambda: {GROUND: np.zeros(3)})
    """Where each body's frame is, which has the axes of the world as drawn."""
    behind: dict[str, str] = field(default_factory=lambda: {GROUND: ""})
    """The part at whose end that frame is."""


def chain_document(content: Mapping[str, Any], file: str) -> Content:
    """The document of the chain file that says the same as one of bodies and joints.

    Args:
        content: as TOML gives it, of kind `KIND`.
        file: name for messages.

    Returns:
        Its first posture is `DRAWN`; the file's own have all coordinates, as the loops close.

    Raises:
        ModelFileError: it describes no machine; one line that says how to correct it.
    """
    try:
        table = BodyFile.model_validate(content)
    except pydantic.ValidationError as error:
        said = one_line(error, content, lambda name: list(_TABLES.get(name, BodyFile).model_fields))
        raise ModelFileError(f"{file}: {said}") from error
    try:
        result = _document(table)
        result["postures"] |= _postures(table, ModelFile.model_validate(result))
    except pydantic.ValidationError as error:
        raise ModelFileError(f"{file}: {one_line(error, result, known_keys)}") from error
    except ValueError as error:
        raise ModelFileError(f"{file}: {error}") from error
    return result


def _document(table: BodyFile) -> Content:
    """The chain file's document with the drawn posture alone."""
    edges = [*map(_beam, table.beams), *map(_joint, table.joints)]
    names = [GROUND, *(body.name for body in table.bodies)]
    _refuse_names(names, edges, table)
    kept = _spanning(edges, names)
    tree = _BodyTree(edges, {body.name: body for body in table.bodies})
    _string(tree, GROUND, kept)
    lost = [name for name in names if name not in tree.origin]
    if lost:
        raise ValueError(f"body '{lost[0]}' is connected to nothing that is connected to the ground: add a joint")
    for i, edge in enumerate(edges):
        if i not in kept:
            _close(tree, edge)
    end = np.array(table.end.at_mm) - tree.origin[table.end.body]
    tree.parts.append(_link(END, end, table.end.turns) | {"after": tree.behind[table.end.body]})
    used = {part["name"] for part in tree.parts}
    drawn = {name: joint.drawn for joint in table.joints for name in coordinates(joint) if name in used}
    result: Content = {
        "format": 1, "name": table.name, "title": table.title, "source": table.source, "units": table.units,
        "parts": tree.parts, "closures": tree.closures,
        "point_springs": [_spring(tree, spring) for spring in table.point_springs],
        "couplings": [
            *(coupling.model_dump(exclude_unset=True) for coupling in table.couplings),
            *(row for joint in table.joints for row in JOINT_KINDS[joint.kind].couplings(joint)),
        ],
        "postures": {DRAWN: drawn}, "poses": dict(table.poses),
    }  # fmt: skip
    return result | ({"springs": table.springs} if table.springs else {})


def _postures(table: BodyFile, drawn: ModelFile) -> dict[str, dict[str, float]]:
    """Coordinates of all joints in the file's own postures, of which it gives the held joints'.

    Raises:
        ValueError: a joint that is none, or the loops do not close.
    """
    machine, home = drawn.chain(), drawn.given(DRAWN)
    closing = Closing(machine, DRAWN) if table.postures and machine.closes else None
    result = {}
    for label, values in table.postures.items():
        if label == DRAWN:
            raise ValueError(f"posture '{DRAWN}' is that in which the file gives all places: take another label")
        unknown = sorted(set(values) - set(home))
        if unknown:
            raise ValueError(
                f"posture '{label}': there is no joint '{unknown[0]}'{did_you_mean(unknown[0], home)}; "
                f"joints are {', '.join(home) or 'none'}"
            )
        result[label] = home | values
        if closing is not None:
            try:
                q = closing.held({**machine.held[DRAWN], **values})
            except ValueError as error:
                raise ValueError(f"posture '{label}': {error}") from error
            result[label] = dict(zip(closing.tree.names, q.tolist(), strict=True))
    return result


def _beam(table: BodyBeamTable) -> _Edge:
    places = np.array(table.from_mm, dtype=float), np.array(table.to_mm, dtype=float)
    if np.array_equal(*places):
        raise ValueError(f"beam '{table.name}': from_mm and to_mm are one point")
    return _Edge(table, "beam", (table.between[0], table.between[1]), places)


def _joint(table: BodyJointTable) -> _Edge:
    place = np.array(table.at_mm, dtype=float)
    check_keys(table)
    return _Edge(table, table.kind, (table.between[0], table.between[1]), (place, place))


def _refuse_names(bodies: list[str], edges: list[_Edge], table: BodyFile) -> None:
    """Refuse names that stand twice, and bodies that are none.

    Raises:
        ValueError: naming them.
    """
    names = [*bodies, *(edge.table.name for edge in edges), END]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ValueError(f"the name '{twice[0]}' stands twice among bodies, joints and beams: rename one")
    asked: list[tuple[str, Iterable[str]]] = [(f"'{edge.table.name}'", edge.bodies) for edge in edges]
    asked += [(f"spring '{spring.name}'", spring.between) for spring in table.point_springs]
    for what, between in [*asked, ("[end]", [table.end.body])]:
        for name in between:
            if name not in bodies:
                raise ValueError(f"{what}: there is no body '{name}'{did_you_mean(name, bodies)}")
    for edge in edges:
        if edge.bodies[0] == edge.bodies[1]:
            raise ValueError(f"'{edge.table.name}' is between '{edge.bodies[0]}' and itself: name two bodies")


def _spanning(edges: list[_Edge], bodies: list[str]) -> set[int]:
    """Which edges make a tree of the bodies (Kruskal 1956): loops are cut where a closure has the least to hold."""
    of = {name: name for name in bodies}

    def root(name: str) -> str:
        while of[name] != name:
            name = of[name]
        return name

    kept: set[int] = set()
    for i in sorted(range(len(edges)), key=lambda i: _CUT_LAST.index(edges[i].kind)):
        first, second = map(root, edges[i].bodies)
        if first != second:
            of[first] = second
            kept.add(i)
    return kept


def _string(tree: _BodyTree, body: str, kept: set[int]) -> None:
    """String the parts behind a body."""
    for i, edge in enumerate(tree.edges):
        if i not in kept or body not in edge.bodies:
            continue
        (other,) = set(edge.bodies) - {body}
        if other in tree.origin:
            continue
        last = _edge_parts(tree, edge, body)
        tree.origin[other], tree.behind[other] = edge.places[edge.bodies.index(other)], other
        mass = tree.masses[other]
        own = _link(other, np.zeros(3)) | {"after": last}
        if mass.mass_kg:
            if mass.centre_of_mass_mm is None:
                raise ValueError(f"body '{other}' has mass_kg but no centre_of_mass_mm: add it, where it is drawn")
            centre = np.array(mass.centre_of_mass_mm) - tree.origin[other]
            own |= {"mass_kg": mass.mass_kg, "centre_of_mass_mm": centre.tolist()}
        tree.parts.append(own)
        _string(tree, other, kept)


def _edge_parts(tree: _BodyTree, edge: _Edge, start: str) -> str:
    """String the parts of a joint or beam behind one of its bodies; the name of the last one."""
    table, first = edge.table, edge.bodies[0] == start
    sided = _sided(tree, table)
    if sided and not first:
        raise ValueError(
            f"'{table.name}': {sided} is told from the first body, and the way from the ground comes from "
            f"the second: exchange them, between = ['{edge.bodies[1]}', '{edge.bodies[0]}']"
        )
    if not isinstance(table, BodyBeamTable) and (table.model_extra or {}).get("rides_on") is not None:
        return _riding_part(tree, table)
    here, there = edge.places if first else edge.places[::-1]
    last, shift = tree.behind[start], here - tree.origin[start]
    if np.any(shift):
        tree.parts.append(_link(f"{table.name}-root", shift) | {"after": last})
        last = f"{table.name}-root"
    if isinstance(table, BodyBeamTable):
        own = table.model_dump(exclude={"between", "from_mm", "to_mm", "y_axis"}, exclude_none=True)
        along = there - here
        length, turns = float(np.linalg.norm(along)), _turns(_section_axes(table, along))
        parts = [own | {"kind": "beam", "length_mm": length, "own_axes": turns}]
    else:
        sign = 1 if first else -1
        parts = joint_parts(table, sign)
        parts += [_drawn_at_zero(table, sign)] if table.drawn else []
    for part in parts:
        tree.parts.append(part | {"after": last})
        last = part["name"]
    return last


def _sided(tree: _BodyTree, table: BodyJointTable | BodyBeamTable) -> str:
    """What is told from the first body of a joint or beam; empty where nothing is."""
    if isinstance(table, BodyBeamTable):
        riding = any((edge.table.model_extra or {}).get("rides_on") == table.name for edge in tree.edges)
        return "bow_mm" if table.bow_mm is not None else "where joints ride on it" if riding else ""
    return min({"compliance", "lateral_rad_per_Nmm", "rides_on"} & set(table.model_extra or {}), default="")


def _riding_part(tree: _BodyTree, table: BodyJointTable) -> str:
    """Add the part of a joint that rides on a beam, which begins where the beam does; its name.

    Raises:
        ValueError: there is no such beam of the joint's first body, or the joint is drawn beside it.
    """
    own = dict(table.model_extra or {})
    beams = {edge.table.name: edge for edge in tree.edges if edge.kind == "beam"}
    name = own["rides_on"]
    where = f"'{table.name}': rides_on = '{name}'"
    if name not in beams:
        raise ValueError(f"{where} is no beam{did_you_mean(str(name), beams)}")
    beam = beams[name]
    if beam.bodies[0] != table.between[0]:
        raise ValueError(f"{where}, whose first body is '{beam.bodies[0]}': begin between with that body")
    along = beam.places[1] - beam.places[0]
    drawn = beam.places[0] + table.drawn * along / np.linalg.norm(along)
    if np.abs(drawn - table.at_mm).max() > DRAWN_BESIDE * np.linalg.norm(along):
        printed = ", ".join(f"{value:.6g}" for value in drawn)
        raise ValueError(f"{where}: drawn = {table.drawn:g} puts it at [{printed}], and at_mm is another place")
    if table.kind not in ("actuated", "coupled"):
        raise ValueError(f"{where}: what rides on a beam is of kind 'actuated' or 'coupled'")
    tree.parts.append(own | {"kind": table.kind, "name": table.name, "axis": np.array(table.axis).tolist()})
    return table.name


def _drawn_at_zero(table: BodyJointTable, sign: int) -> Content:
    """The link behind a joint that stands at another coordinate where it is drawn."""
    axis = sign * table.axis
    if (table.model_extra or {}).get("motion") == "slides":
        return _link(f"{table.name}-drawn", -table.drawn * axis)
    back = [{"turn_about": axis.tolist(), "angle_deg": float(-np.rad2deg(table.drawn))}]
    return _link(f"{table.name}-drawn", np.zeros(3), back)


def _close(tree: _BodyTree, edge: _Edge) -> None:
    """String a joint or beam behind its first body, and hold its end to the second."""
    first, second = edge.bodies
    closure: Content = {"name": f"{edge.table.name}-loop"}
    if edge.kind in JOINT_KINDS and JOINT_KINDS[edge.kind].place_only:
        parts, closure["holds"] = [tree.behind[first], tree.behind[second]], "ball"
        frames = [edge.places[0] - tree.origin[first], edge.places[1] - tree.origin[second]]
    else:
        parts = [_edge_parts(tree, edge, first), tree.behind[second]]
        frames = [np.zeros(3), edge.places[1] - tree.origin[second]]
    closure |= {"between": parts, "frames": [{"position_mm": place.tolist()} for place in frames]}
    tree.closures.append(closure)


def _spring(tree: _BodyTree, spring: SpringTable) -> Content:
    points = [
        (np.array(point) - tree.origin[body]).tolist()
        for point, body in zip(spring.points_mm, spring.between, strict=True)
    ]
    own: Content = spring.model_dump(exclude_unset=True)
    return own | {"between": [tree.behind[body] for body in spring.between], "points_mm": points}


def _link(name: str, shift: Array, turns: list[Content] | None = None) -> Content:
    return {"kind": "link", "name": name, "translation_mm": shift.tolist(), "turns": turns or []}


def _section_axes(table: BodyBeamTable, along: Array) -> Array:
    """Rotation ``(3, 3)`` to the axes of a section, x along the beam.

    Raises:
        ValueError: the section's y would be along the beam.
    """
    x = along / np.linalg.norm(along)
    wanted = table.y_axis
    if wanted is None:
        # of equals the first of y, z, x
        wanted = min(np.eye(3)[[1, 2, 0]], key=lambda axis: abs(float(axis @ x)))
    y = wanted - (wanted @ x) * x
    if np.linalg.norm(y) < 1e-6:
        raise ValueError(f"beam '{table.name}': y_axis is along the beam: give a direction across it")
    y /= np.linalg.norm(y)
    result: Array = np.array([x, y, np.cross(x, y)]).T
    return result


def _turns(R: Array) -> list[Content]:
    vector = rotation_vector(R)
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return []
    return [{"turn_about": (vector / angle).tolist(), "angle_deg": float(np.rad2deg(angle))}]
