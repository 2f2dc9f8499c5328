"""Files of bodies and joints: a machine as its drawing shows it.

Its loops are found from what connects the bodies.

Each kind of joint is one row of a table, which says all that such a file asks of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, WithJsonSchema

from vjm.io.errors import did_you_mean, naming, validated
from vjm.io.fields import Axis, Label, Table, VectorMM
from vjm.io.joint_tables import CouplingTable, Mass, PointSpringTable, Poses
from vjm.io.schema import ModelFile, known_keys
from vjm.machine.rigid_mechanism import LoopClosure
from vjm.rotations import Array, rotation_vector

Content = dict[str, Any]
Pair = Annotated[list[Label], Field(min_length=2, max_length=2)]


class Motion(NamedTuple):
    """One elementary joint of a joint between bodies.

    Attributes:
        suffix: of its name behind that of the joint; empty where it has the joint's own name.
        axis: unit vector ``(3,)``, world axes as drawn.
        slides: along the axis; else it turns about it.
    """

    suffix: str
    axis: Array
    slides: bool = False


@dataclass(frozen=True)
class BodyJointKind:
    """A kind of joint between bodies, passive unless it says otherwise.

    Attributes:
        says: what it is, for the page on model files.
        motions: from a joint's table, its elementary joints from the first body to the second.
        keys: that it needs beside ``name``, ``between`` and ``at_mm``; it takes no others of `OWN_KEYS`. A new
            one is also a field of `BodyJointTable` and a name in `OWN_KEYS`.
        part: kind of the parts of a chain file that it becomes.
        given: whether it has coordinates that stand in a posture. Those of a passive joint do so in a machine
            without loops and couplings; in others a posture that names them is refused, for they follow.
        place_only: whether all that it holds is the place of a point: a loop is cut there without any joint.

    Example:
        >>> sorted(JOINT_KINDS)
        ['actuated', 'ball', 'coupled', 'cylindrical', 'joint', 'planar', 'screw', 'universal', 'weld']
        >>> [motion.suffix for motion in JOINT_KINDS["ball"].motions(None)]
        ['-x', '-y', '-z']
    """

    says: str
    motions: Callable[[BodyJointTable], list[Motion]]
    keys: tuple[str, ...] = ("axis",)
    part: str = "joint"
    given: bool = True
    place_only: bool = False


def _single(table: BodyJointTable) -> list[Motion]:
    """One elementary joint, which the keys of the part describe."""
    return [Motion("", table.axis, (table.model_extra or {}).get("motion") == "slides")]


def _slide_and_turn(table: BodyJointTable) -> list[Motion]:
    return [Motion("-slide", table.axis, slides=True), Motion("-turn", table.axis)]


def _in_a_plane(table: BodyJointTable) -> list[Motion]:
    axis = table.axis
    first = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    first /= np.linalg.norm(first)
    return [Motion("-1", first, True), Motion("-2", np.cross(axis, first), True), Motion("-turn", axis)]


JOINT_KINDS: Mapping[str, BodyJointKind] = {
    "actuated": BodyJointKind("driven", _single, part="actuated"),
    "coupled": BodyJointKind("follows others by its ratios `to`", _single, part="coupled", given=False),
    "weld": BodyJointKind("holds all", lambda _: [], keys=(), given=False),
    "joint": BodyJointKind("passive, the default", _single),
    "screw": BodyJointKind(
        "passive: turns about `axis` and moves along it by `pitch_mm` in a turn (left-hand: negative)",
        _slide_and_turn, keys=("axis", "pitch_mm"),
    ),
    "cylindrical": BodyJointKind("passive: turns about `axis` and slides along it", _slide_and_turn),
    "universal": BodyJointKind(
        "passive: two hinges about the two `axes`",
        lambda table: [Motion(f"-{i}", axis) for i, axis in enumerate(table.axes or [], 1)], keys=("axes",),
    ),
    "planar": BodyJointKind("passive: slides in the plane across `axis`, and turns about it", _in_a_plane),
    "ball": BodyJointKind(
        "passive: three hinges through one point",
        lambda _: [Motion(f"-{name}", axis) for name, axis in zip("xyz", np.eye(3), strict=True)],
        keys=(), place_only=True,
    ),
}  # fmt: skip
"""By name. Loops are cut at a joint of the last kind, where a closure has the least to hold."""
OWN_KEYS = ("axis", "axes", "pitch_mm")
"""Keys of a joint's table that some kinds need and others do not take."""


def _known_kind(kind: str) -> str:
    if kind not in JOINT_KINDS:
        raise ValueError(f"is '{kind}', which is no kind of joint{did_you_mean(kind, JOINT_KINDS)}")
    return kind


class BodyJointTable(Table):
    """A joint; its coordinate is that of the second body against the first.

    All keys that are not here are those of the part of a chain file, which checks them.
    """

    model_config = ConfigDict(extra="allow")

    name: Label
    between: Pair
    kind: Annotated[str, AfterValidator(_known_kind), WithJsonSchema({"enum": list(JOINT_KINDS)})] = "joint"
    at_mm: VectorMM
    axis: Axis = None
    axes: Annotated[list[Axis], Field(min_length=2, max_length=2)] | None = Field(
        None, description="of a universal joint: that of the first body, then that of the second"
    )
    pitch_mm: float | None = Field(
        None, description="of a screw: way along its axis in one turn; negative for a left-hand thread"
    )
    drawn: float = Field(0.0, description="coordinate where it is drawn, rad or mm")


def _coordinates(table: BodyJointTable) -> list[str]:
    """Names of the coordinates that a posture gives of a joint."""
    kind = JOINT_KINDS[table.kind]
    return [table.name + motion.suffix for motion in kind.motions(table)] if kind.given else []


def _check_keys(table: BodyJointTable) -> None:
    """Refuse keys that a kind does not take, or has not got."""
    kind = JOINT_KINDS[table.kind]
    for key in OWN_KEYS:
        given = getattr(table, key) is not None
        if given != (key in kind.keys):
            what = f"takes no {key}: leave it out" if given else f"needs {key}"
            raise ValueError(f"joint '{table.name}': a joint of kind '{table.kind}' {what}")
    several = len(kind.motions(table)) != 1
    if several and table.drawn:
        raise ValueError(
            f"joint '{table.name}': a joint of kind '{table.kind}' takes no drawn: it is drawn at zero"
        )


def _thread(table: BodyJointTable) -> Content:
    """The coupling between the two elementary joints of a screw, as a chain file has it."""
    lead = (table.pitch_mm or 0.0) / (2.0 * np.pi)
    terms = [{"joint": f"{table.name}-slide", "weight": 1.0}, {"joint": f"{table.name}-turn", "weight": -lead}]
    return {"name": f"{table.name}-thread", "terms": terms}


def _joint_parts(table: BodyJointTable, sign: int) -> list[Content]:
    """The parts of a joint, in the order from one body to the other; ``sign`` −1: from the second on."""
    kind, own = JOINT_KINDS[table.kind], dict(table.model_extra or {})
    return [
        own
        | {"kind": kind.part, "name": table.name + motion.suffix, "axis": (sign * motion.axis).tolist()}
        | ({"motion": "slides"} if motion.slides else {})
        for motion in kind.motions(table)[::sign]
    ]


class BodyTable(Table):
    """A rigid body."""

    name: Label
    source: str = ""
    mass_kg: Mass = 0.0
    centre_of_mass_mm: VectorMM | None = Field(None, description="where it is drawn")


class BodyBeamTable(Table):
    """An elastic link; its two ends are fixed to the bodies. What is said of its section a chain file checks."""

    name: Label
    between: Pair
    from_mm: VectorMM
    to_mm: VectorMM
    y_axis: Axis = Field(
        None, description="direction of the section's y; else the world's axis that is most across"
    )
    source: str = ""
    section: dict[str, Any]
    count: int = 1
    segments: int | None = None
    mass_kg: float | None = None
    bow_mm: list[float] | None = None


class SpringTable(PointSpringTable):
    """A spring between points of two bodies, which are given where they are drawn."""


class EndTable(Table):
    """The end-effector's frame."""

    body: Label
    at_mm: VectorMM
    turns: list[dict[str, Any]] = Field([])


class BodyFile(Table):
    """A file of bodies and joints."""

    format: Literal[1]
    kind: Literal["bodies"]
    name: Label
    title: str = Field(min_length=1)
    source: str = Field(min_length=1)
    units: dict[str, Any]
    springs: dict[str, Any] = Field({})
    bodies: list[BodyTable] = Field(min_length=1)
    joints: list[BodyJointTable] = Field([])
    beams: list[BodyBeamTable] = Field([])
    point_springs: list[SpringTable] = Field([])
    couplings: list[CouplingTable] = Field([])
    end: EndTable
    postures: dict[Label, dict[Label, float]] = Field(
        {}, description="coordinates of held joints; those that are not named stand as drawn"
    )
    poses: Poses = Field({})


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
    "": BodyFile, "body": BodyTable, "joint": BodyJointTable, "beam": BodyBeamTable,
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

    Returns:
        Its first posture is `DRAWN`; the file's own have all coordinates, as the loops close.

    Raises:
        ModelFileError: it describes no machine; one line that says how to correct it.
    """
    table = validated(BodyFile, content, file, lambda name: _TABLES.get(name, BodyFile).model_fields)
    with naming(file):
        result = _document(table)
    drawn = validated(ModelFile, result, file, known_keys)
    with naming(file):
        return result | {"postures": result["postures"] | _postures(table, drawn)}


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
    drawn = {name: joint.drawn for joint in table.joints for name in _coordinates(joint) if name in used}
    result: Content = {
        "format": 1, "name": table.name, "title": table.title, "source": table.source, "units": table.units,
        "parts": tree.parts, "closures": tree.closures,
        "point_springs": [_spring(tree, spring) for spring in table.point_springs],
        "couplings": [
            *(coupling.model_dump(exclude_unset=True) for coupling in table.couplings),
            *(_thread(joint) for joint in table.joints if joint.pitch_mm is not None),
        ],
        "postures": {DRAWN: drawn}, "poses": dict(table.poses),
    }  # fmt: skip
    return result | ({"springs": table.springs} if table.springs else {})


def _postures(table: BodyFile, drawn: ModelFile) -> dict[str, dict[str, float]]:
    """Coordinates of all joints in the file's own postures, of which it gives the held joints'."""
    machine, home = drawn.chain(), drawn.given(DRAWN)
    closing = LoopClosure(machine, DRAWN) if table.postures and machine.closes else None
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
    _check_keys(table)
    return _Edge(table, table.kind, (table.between[0], table.between[1]), (place, place))


def _refuse_names(bodies: list[str], edges: list[_Edge], table: BodyFile) -> None:
    """Refuse names that stand twice, and bodies that are none."""
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
    root_point, end_point = edge.places if first else edge.places[::-1]
    last, shift = tree.behind[start], root_point - tree.origin[start]
    if np.any(shift):
        tree.parts.append(_link(f"{table.name}-root", shift) | {"after": last})
        last = f"{table.name}-root"
    if isinstance(table, BodyBeamTable):
        own = table.model_dump(exclude={"between", "from_mm", "to_mm", "y_axis"}, exclude_none=True)
        along = end_point - root_point
        length, turns = float(np.linalg.norm(along)), _turns(_section_axes(table, along))
        parts = [own | {"kind": "beam", "length_mm": length, "own_axes": turns}]
    else:
        sign = 1 if first else -1
        parts = _joint_parts(table, sign)
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
    """Add the part of a joint that rides on a beam, which begins where the beam does; its name."""
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
    """Rotation ``(3, 3)`` to the axes of a section, x along the beam."""
    x = along / np.linalg.norm(along)
    wanted = table.y_axis
    if wanted is None:
        # of equals the first of y, z, x
        wanted = min(np.eye(3)[[1, 2, 0]], key=lambda axis: abs(float(axis @ x)))
    y = wanted - (wanted @ x) * x
    if np.linalg.norm(y) < 1e-6:
        raise ValueError(f"beam '{table.name}': y_axis is along the beam: give a direction across it")
    y /= np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)]).T


def _turns(R: Array) -> list[Content]:
    vector = rotation_vector(R)
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return []
    return [{"turn_about": (vector / angle).tolist(), "angle_deg": float(np.rad2deg(angle))}]
