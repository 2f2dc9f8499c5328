"""SDF files of robots, the format of Gazebo and Drake, read into a robot.

One model is read: its links, joints, frames and inertials, and those of models nested in it. A joint of several
axes becomes several joints of one axis. Written after the format's specification, http://sdformat.org/spec.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from functools import partial

import numpy as np

from vjm.io.bounded_xml import XmlElement, XmlFile
from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.robot import (
    LEAST_STIFFNESS,
    USUAL,
    Body,
    Kind,
    Notes,
    Placing,
    Reading,
    Robot,
    RobotJoint,
    masters_of,
    new_name,
    triple,
    turned,
)
from vjm.io.robot_xml import (
    CONTROL,
    DRIVES,
    METRE,
    MOMENTS,
    ONE,
    SHAPES,
    WHOLE_TURN,
    DescribedTree,
    FilePlace,
    FormatKeys,
    Limits,
    RawJoint,
    finite,
    given_quaternion,
    reflected,
    rpy_turns,
    shown,
    survey,
    taken_limits,
    vector,
)
from vjm.rotations import Array, inverse_frame, rotation_vector

# --- What of an SDF file is read and what is omitted, element by element ------------------------------------------

INCLUDED = "other files, which are not read: import them by themselves"
WORLDS = "what a simulator's world has"
_POSE = {"relative_to": "", "frame": "", "degrees": "", "rotation_format": ""}
_DENSE = "moments of inertia by density"
_SOLVED = "what a simulator's solver takes"
_AXIS = {
    "xyz": "",
    "limit": "",
    "dynamics": "",
    "mimic": "",
    "use_parent_model_frame": "",
    "initial_position": CONTROL,
}

SDF = FormatKeys(
    root=("sdf", "world", "model"),
    children={
        "sdf": {"world": "", "model": "", "light": WORLDS, "actor": WORLDS, "include": INCLUDED},
        "world": {
            "model": "", "include": INCLUDED, "plugin": CONTROL, "physics": WORLDS, "scene": WORLDS,
            "light": WORLDS, "gravity": WORLDS, "magnetic_field": WORLDS, "atmosphere": WORLDS, "wind": WORLDS,
            "audio": WORLDS, "gui": WORLDS, "road": WORLDS, "spherical_coordinates": WORLDS, "state": WORLDS,
            "population": WORLDS, "actor": WORLDS, "frame": WORLDS, "joint": WORLDS,
        },
        "model": {
            "model": "", "link": "", "joint": "", "frame": "", "pose": "", "static": "", "include": INCLUDED,
            "plugin": CONTROL, "gripper": CONTROL, "self_collide": SHAPES, "allow_auto_disable": _SOLVED,
            "enable_wind": WORLDS, "material": SHAPES,
        },
        "link": {
            "inertial": "", "pose": "", "visual": SHAPES, "collision": SHAPES, "sensor": CONTROL,
            "projector": CONTROL, "light": WORLDS, "particle_emitter": WORLDS, "audio_source": WORLDS,
            "audio_sink": WORLDS, "battery": CONTROL, "velocity_decay": DRIVES, "must_be_base_link": _SOLVED,
            "self_collide": SHAPES, "enable_wind": WORLDS, "gravity": WORLDS, "kinematic": _SOLVED,
            "plugin": CONTROL,
        },
        "frame": {"pose": ""},
        "inertial": {
            "mass": "", "pose": "", "inertia": "", "density": _DENSE, "fluid_added_mass": WORLDS,
            "auto_inertia_params": _DENSE, "frame": _SOLVED,
        },
        "inertia": dict.fromkeys(MOMENTS, ""),
        "joint": {
            "parent": "", "child": "", "pose": "", "axis": "", "axis2": "", "physics": _SOLVED, "sensor": CONTROL,
            "plugin": CONTROL, "gearbox_ratio": DRIVES, "gearbox_reference_body": DRIVES, "thread_pitch": DRIVES,
            "screw_thread_pitch": DRIVES,
            "drake:rotor_inertia": "", "drake:gear_ratio": "",
        },
        "axis": _AXIS, "axis2": _AXIS,
        "limit": {
            "lower": "", "upper": "", "effort": DRIVES, "velocity": DRIVES, "stiffness": _SOLVED,
            "dissipation": _SOLVED,
        },
        "dynamics": {"spring_stiffness": "", "spring_reference": "", "damping": DRIVES, "friction": DRIVES},
        "mimic": {"multiplier": "", "offset": "", "reference": ""},
    },
    attributes={
        "sdf": {"version": ""},
        "world": {"name": ""},
        "model": {"name": "", "canonical_link": "", "placement_frame": ""},
        "link": {"name": ""},
        "frame": {"name": "", "attached_to": ""},
        "joint": {"name": "", "type": ""},
        "inertial": {"auto": _DENSE},
        "pose": _POSE,
        "xyz": {"expressed_in": ""},
        "mimic": {"joint": "", "axis": ""},
    },
    once={
        "inertial", "pose", "mass", "inertia", "parent", "child", "axis", "axis2", "limit", "dynamics", "mimic",
        "xyz",
    },
)  # fmt: skip


# --- FrameGraph of an SDF file: each is placed in another one, by a pose, until the world is reached --------------

WORLD = "world"
MODEL = "__model__"
QUATERNION = "quat_xyzw"
FORMATS = ("euler_rpy", QUATERNION)


def _pose_of(place: FilePlace, element: XmlElement | None, doubts: list[str], unit: Decimal = METRE) -> Placing:
    """Where a pose places its frame, mm and rad; nowhere else where there is none.

    It has six numbers, the last three in degrees where it says so, or seven with a quaternion.
    """
    if element is None or not element.text:
        return Placing()
    place = place.inside(element)
    form = element.attributes.get("rotation_format", FORMATS[0])
    if form not in FORMATS:
        raise place.error(f"has a pose with rotation_format '{form}': give {' or '.join(FORMATS)}")
    length = 7 if form == QUATERNION else 6
    # to mm without a second rounding
    x, y, z = vector(place, element, "", length, unit=unit)[:3]
    rest = vector(place, element, "", length)[3:]
    if form == QUATERNION:
        return Placing((x, y, z), given_quaternion(place, rest))
    if element.attributes.get("degrees", "false").strip() in ("true", "1"):
        rest = [math.radians(angle) for angle in rest]
    elif max(map(abs, rest)) > WHOLE_TURN:
        doubts.append(
            f"{place.owner} (line {element.line}): {shown(element)} turns beyond a whole turn: is it in degrees? "
            'A pose has rad, or degrees="true"'
        )
    return Placing((x, y, z), rpy_turns(rest))


@dataclass(frozen=True)
class _Frame:
    """Where a frame is placed: by a pose in another, or so that a frame behind it is there.

    Attributes:
        base: name of the other.
        pose: ``(4, 4)``, mm.
        placed: name of the frame behind it that the pose places; itself where it is empty.
        place: for messages.
    """

    base: str
    pose: Array
    place: FilePlace
    placed: str = ""


@dataclass
class FrameGraph:
    """The frames of one file by name; those in nested models have the names of these before theirs."""

    _frames: dict[str, _Frame] = field(default_factory=dict)

    def add(self, name: str, base: str, pose: Placing, place: FilePlace, *, placed: str = "") -> None:
        """One more frame; the first one of a name is kept."""
        self._frames.setdefault(name, _Frame(base, pose.frame, place, placed))

    def __contains__(self, name: str) -> bool:
        return name == WORLD or name in self._frames

    def __iter__(self) -> Iterator[str]:
        """Names as files have them."""
        return (name for name in self._frames if name.isprintable())

    def between(self, base: str, name: str) -> Placing:
        """Where a frame lies in another.

        Raises:
            ModelFileError: a frame on the way is placed in one that is not there, or in itself.
        """
        back, forth = self._way(base), self._way(name)
        while back and forth and back[0] == forth[0]:
            del back[0], forth[0]
        back_T, forth_T = np.eye(4), np.eye(4)
        for one in back:
            back_T = back_T @ self._own(one)
        for one in forth:
            forth_T = forth_T @ self._own(one)
        T = forth_T if not back else inverse_frame(back_T) @ forth_T
        turn = rotation_vector(T[:3, :3])
        angle = float(np.linalg.norm(turn))
        return Placing(triple(T[:3, 3]), ((triple(turn / angle), angle),) if angle else ())

    def _own(self, name: str) -> Array:
        """A frame ``(4, 4)`` in that in which it is placed."""
        one = self._frames[name]
        if not one.placed:
            return one.pose
        return one.pose @ inverse_frame(self.between(name, one.placed).frame)

    def _way(self, name: str) -> list[str]:
        """Names of frames from the world, without it, to one of them."""
        way = list[str]()
        while name != WORLD:
            place = self._frames[way[0]].place if way else None
            if name not in self._frames:
                assert place is not None
                raise place.error(
                    f"is placed in the frame '{name}', which is not there{did_you_mean(name, list(self))}"
                )
            if name in way:
                raise self._frames[name].place.error(
                    "is placed in itself, by way of other frames: correct relative_to"
                )
            way.insert(0, name)
            name = self._frames[name].base
        return way


MOVING: dict[str, Kind] = {"revolute": "turns", "continuous": "turns", "prismatic": "slides"}
SEVERAL = {"universal": ("axis", "axis2"), "revolute2": ("axis", "axis2"), "ball": ("x", "y", "z")}
"""Of joints of several axes their axes, the first one in the parent."""
TYPES = (*MOVING, "fixed", *SEVERAL)
NESTED = "::"
NONE = 1e16
"""rad or m, the format's limit of a joint that has none."""
MODEL_AXES, CHOSEN_AXES, LAST = 4, 6, 12
"""Versions 1.4, 1.6 and 1.12: until the first one axes are those of the model, until the second one they are where
``use_parent_model_frame`` says so; the last one is the newest."""
_VERSION = re.compile(r"1\.([0-9]{1,2})")


def sdf_robot(xml: XmlFile, file: str, tip: str | None = None, reading: Reading = USUAL) -> Robot:
    """The robot of an SDF file's elements: the whole tree, or what leads from the world to one link.

    Raises:
        ModelFileError: it has no model or several, or what is to be read of it makes no machine.

    Example:
        >>> robot = sdf_robot(read_xml(Path("arm.sdf")), "arm.sdf", "tool")  # doctest: +SKIP
    """
    return _SdfReader(xml, file, reading).robot(tip)


def _model(root: XmlElement, file: str, notes: Notes) -> XmlElement:
    """The one model of a file that moves."""
    world = root.first("world")
    if len(root.all("world")) > 1:
        raise ModelFileError(f"{file}: has {len(root.all('world'))} worlds: keep one")
    models = [*root.all("model"), *(world.all("model") if world else [])]
    static = [one for one in models if _says(one, "static")]
    if len(models) > 1 and len(static) < len(models):
        models = [one for one in models if one not in static]
        if static:
            notes.left_out.append(f"models that are static: {', '.join(map(_name, static))}")
    if len(models) == 1:
        return models[0]
    if models:
        raise ModelFileError(
            f"{file}: has {len(models)} models ({', '.join(map(_name, models))}): write a file with one"
        )
    includes = [*root.all("include"), *(world.all("include") if world else [])]
    if includes:
        named = [uri.text for one in includes if (uri := one.first("uri")) is not None]
        raise ModelFileError(
            f"{file}: has no <model> of its own, but includes {', '.join(named)}: give the file of that model"
        )
    raise ModelFileError(f"{file}: has no <model>: give a file with one")


def _name(element: XmlElement) -> str:
    return element.attributes.get("name", "").strip()


def _says(element: XmlElement, tag: str) -> bool:
    """Whether an element in another is true."""
    return _text(element, tag).lower() in ("true", "1")


def _text(element: XmlElement, tag: str) -> str:
    child = element.first(tag)
    return child.text if child is not None else ""


class _SdfReader(DescribedTree):
    """One file."""

    _moves, _types, _by_elements = MOVING, TYPES, True
    _one_base = "connect them, or --fix-base holds all of them where the file shows them"

    def __init__(self, xml: XmlFile, file: str, reading: Reading) -> None:
        super().__init__(file, reading, Notes(doubtful=list(xml.notes)))
        self._root = xml.root
        self._frames = FrameGraph()
        self._links[WORLD] = [xml.root]
        self._scopes: dict[str, str] = {WORLD: ""}
        self._attached: dict[str, str] = {WORLD: WORLD}
        self._models = list[XmlElement]()
        self._sprung: list[str] = []
        self._taken_names = set[str]()
        match = _VERSION.fullmatch(xml.root.attributes.get("version", "").strip())
        self._version = int(match.group(1)) if match else LAST
        if not match or self._version > LAST:
            self._notes.doubtful.append(
                f"the file's version {xml.root.attributes.get('version', 'none')!r} is not known: read as 1.{LAST}"
            )
        model = _model(xml.root, file, self._notes)
        self._title = _name(model)
        self._read_model(model, "", WORLD, "")
        self._taken_names.update(self._links, self._joints)

    # --- links, joints and frames of a model --------------------------------------------------------------

    def _read_model(self, model: XmlElement, scope: str, base: str, outer: str) -> None:
        """Take the links, joints and frames of a model and of those in it."""
        self._models.append(model)
        own = scope + MODEL
        place = FilePlace(self._file, f"model '{scope.removesuffix(NESTED) or self._title}'", model.line)
        placed = model.attributes.get("placement_frame", "").strip()
        pose = _pose_of(place, model.first("pose"), self._notes.doubtful, self._units.length)
        behind = self._scoped(scope, placed) if placed else ""
        self._frames.add(own, self._based(model, base, outer), pose, place, placed=behind)
        links = model.all("link")
        canonical = model.attributes.get("canonical_link", "").strip() or (_name(links[0]) if links else "")
        self._attached[own] = scope + canonical
        for link in links:
            name = _name(link)
            if scope + name == WORLD:
                raise FilePlace(self._file, "a link", link.line).error(
                    "is called 'world', which is the world: rename"
                )
            self._links.setdefault(scope + name if name else "", []).append(link)
            self._scopes[scope + name] = scope
            self._attached[scope + name] = scope + name
            self._add_frame(link, scope, own, f"link '{scope}{name}'")
        for one in model.all("frame"):
            to = one.attributes.get("attached_to", "").strip()
            to = self._scoped(scope, to) if to else own
            self._attached.setdefault(scope + _name(one), to)
            self._add_frame(one, scope, to, f"frame '{scope}{_name(one)}'")
        for one in model.all("joint"):
            self._read_joint(one, scope)
        for one in model.all("model"):
            inner = f"{scope}{_name(one)}{NESTED}"
            self._attached.setdefault(scope + _name(one), inner + MODEL)
            self._frames.add(scope + _name(one), inner + MODEL, Placing(), place)
            self._read_model(one, inner, own, scope)

    def _read_joint(self, element: XmlElement, scope: str) -> None:
        name = scope + _name(element) if _name(element) else ""
        parent, child = (self._scoped(scope, _text(element, tag)) for tag in ("parent", "child"))
        place = FilePlace(self._file, f"joint '{name}'", element.line)
        if child == WORLD:
            raise place.error("has the world as its child: exchange parent and child")
        self._scopes[_joint_key(name)] = scope
        self._attached.setdefault(name, child)
        self._keep_joint(RawJoint(name, element.attributes.get("type", "").strip(), parent, child, element))
        pose = _pose_of(place, element.first("pose"), self._notes.doubtful, self._units.length)
        base = self._based(element, child, scope)
        self._frames.add(_joint_key(name), base, pose, place)
        self._frames.add(name, base, pose, place)

    def _add_frame(self, element: XmlElement, scope: str, base: str, what: str) -> None:
        place = FilePlace(self._file, what, element.line)
        pose = _pose_of(place, element.first("pose"), self._notes.doubtful, self._units.length)
        self._frames.add(scope + _name(element), self._based(element, base, scope), pose, place)

    def _based(self, element: XmlElement, usual: str, scope: str) -> str:
        """The frame in which an element's pose places it."""
        pose = element.first("pose")
        if pose is None:
            return usual
        # up to version 1.6 the attribute had another name
        named = pose.attributes.get("relative_to", pose.attributes.get("frame", "")).strip()
        return self._scoped(scope, named) if named else usual

    def _scoped(self, scope: str, name: str) -> str:
        """A name in a model as it is in the file."""
        name = name.strip()
        return name if name in ("", WORLD) else scope + name

    def _link_of(self, name: str) -> str:
        """The link that a frame is fixed to; the name itself where there is none."""
        passed = set[str]()
        frame_name = name
        while frame_name not in self._links or frame_name not in self._attached:
            if frame_name in passed or frame_name not in self._attached:
                return name
            passed.add(frame_name)
            frame_name = self._attached[frame_name]
        return frame_name

    # --- the robot ----------------------------------------------------------------------------------------

    def robot(self, tip: str | None) -> Robot:
        self._onto_links()
        self._stand(tip)
        taken = self._all() if tip is None else self._way(tip)
        bodies: dict[str, Body] = {WORLD: Body(WORLD)}
        joints: list[RobotJoint] = []
        names = [joint.child for joint in taken]
        for raw in taken:
            self._add(raw, bodies, joints)
            bodies[raw.child] = self._body(raw.child)
        masters = masters_of(joints, self._master)
        owners = [
            *(self._links[name][0] for name in names),
            *(raw.element for raw in taken if raw.element.tag == "joint"),
        ]
        survey(self._root, [*self._worlds(), *self._models, *owners], self._notes, SDF)
        if self._massless:
            self._notes.doubtful.append(
                f"links without <inertial>: {', '.join(self._massless)}; simulators take 1 kg, here they weigh "
                "nothing"
            )
        if self._sprung:
            self._notes.changed.append(f"springs alone hold {', '.join(self._sprung)}: an SDF file names no drives")
        off = [name for name in self._links if name not in bodies]
        if off:
            self._notes.left_out.append(f"links that are not on the way to '{tip}': {', '.join(off)}")
        return Robot(
            self._title or self._file.split(".")[0], WORLD, bodies, joints, masters, self._file, self._notes,
            impossible=self._impossible,
        )  # fmt: skip

    def _worlds(self) -> list[XmlElement]:
        return self._root.all("world")

    def _onto_links(self) -> None:
        """Lead joints from the frames that they name to the links with these."""
        joints = [joint for several in self._joints.values() for joint in several]
        self._joints, self._into = {}, {}
        for one in joints:
            parent, child = self._link_of(one.parent), self._link_of(one.child)
            self._keep_joint(RawJoint(one.name, one.type, parent, child, one.element))

    def _stand(self, tip: str | None) -> None:
        """Hold by the world what no joint holds, where that is plain, asked for, or on the way to the tip."""
        roots = [name for name in self._links if name and name not in self._into and name != WORLD]
        held = any(joint.parent == WORLD for several in self._joints.values() for joint in several)
        alone = len(roots) == 1 and not held
        if tip is None and not alone and not self._reading.fix_base:
            if roots and not held:
                # the world is none of those that a message should name
                raise ModelFileError(
                    f"{self._file}: has {len(roots)} links without a parent ({', '.join(roots)}); a robot has one, "
                    f"its base: {self._one_base}"
                )
            return
        for name in roots:
            self._keep_joint(RawJoint(f"{name}-stands", "fixed", WORLD, name, self._links[name][0]))

    def _macros(self) -> str:
        includes = [line for one in (*self._models, *self._worlds()) for line in one.all("include")]
        return f"; the <include> of line {includes[0].line} is not read" if includes else ""

    def _check(self, joint: RawJoint, *, propose: bool = True) -> None:
        if joint.type in ("gearbox", "screw"):
            place = FilePlace(self._file, f"joint '{joint.name}'", joint.element.line)
            raise place.error(f"is a {joint.type}: write a joint that turns or slides, with <mimic>")
        super()._check(joint, propose=propose)

    # --- what they say ------------------------------------------------------------------------------------

    def _add(self, raw: RawJoint, bodies: dict[str, Body], joints: list[RobotJoint]) -> None:
        """A joint as one or several, with bodies of no mass between."""
        if raw.element.tag != "joint":
            self._notes.changed.append(f"no joint holds '{raw.child}': it stands where the file shows it")
            placing = self._frames.between(raw.parent, raw.child)
            joints.append(RobotJoint(raw.name, "fixed", raw.parent, raw.child, placing))
            return
        if raw.type == "fixed":
            placing = self._frames.between(raw.parent, raw.child)
            joints.append(RobotJoint(raw.name, "fixed", raw.parent, raw.child, placing))
            return
        key = _joint_key(raw.name)
        place, behind = self._frames.between(raw.parent, key), self._frames.between(key, raw.child)
        axes = SEVERAL.get(raw.type, ("axis",))
        new = partial(new_name, taken=self._taken_names)
        last = raw.child if behind.is_identity else new(f"{raw.child}-joint")
        names = [raw.name] if len(axes) == 1 else [new(f"{raw.name}-{_label(axis)}") for axis in axes]
        parent = raw.parent
        for name, axis in zip(names, axes, strict=True):
            child = last if axis == axes[-1] else new(f"{name}-body")
            if child != raw.child:
                bodies[child] = Body(child, between=True)
            joints.append(self._following(self._moving(raw, name, axis, parent, child, place)))
            parent, place = child, Placing()
        if last != raw.child:
            joints.append(RobotJoint(new(f"{raw.child}-fixed"), "fixed", last, raw.child, behind))
        if len(axes) > 1:
            self._notes.changed.append(
                f"joint '{raw.name}' has the type {raw.type}: the joints {', '.join(names)} stand in its place, "
                "one after the other"
            )

    def _moving(self, raw: RawJoint, name: str, axis: str, parent: str, child: str, where: Placing) -> RobotJoint:
        """A joint of one axis: of the file, or one of several in its place."""
        place = FilePlace(self._file, f"joint '{raw.name}'", raw.element.line)
        if raw.type == "ball":
            # its own springs are none of the format's
            return RobotJoint(name, "turns", parent, child, where, triple(np.eye(3)["xyz".index(axis)]))
        kind: Kind = MOVING.get(raw.type, "turns")
        element = raw.element.first(axis)
        if element is None:
            self._notes.doubtful.append(f"joint '{name}' gives no <{axis}>: z, as the format has it")
            return RobotJoint(name, kind, parent, child, where, (0.0, 0.0, 1.0))
        limits, home = self._limits(raw, name, element, slides=kind == "slides")
        mimic = self._mimic(raw) if raw.type in MOVING else None
        if raw.type not in MOVING and element.first("mimic") is not None:
            self._notes.left_out.append(f"the <mimic> of joint '{name}', which is one of several axes")
        stiffness, rest = self._spring(name, element, slides=kind == "slides", follows=mimic is not None)
        if stiffness:
            home = rest if limits is None else min(max(rest, limits[0]), limits[1])
            self._sprung.append(name)
        return RobotJoint(
            name, kind, parent, child, where, self._axis(raw, place, element), limits, home, mimic,
            passive=stiffness > 0.0, stiffness=stiffness, rest=rest, rotor=self._rotor(raw, place, kind),
        )  # fmt: skip

    def _master(self, name: str) -> RobotJoint:
        raw = self._only(name)
        return self._moving(raw, name, "axis", WORLD, name, Placing())

    def _axis(self, raw: RawJoint, place: FilePlace, element: XmlElement) -> tuple[float, float, float]:
        """A joint's axis in the joint's frame."""
        xyz = element.first("xyz")
        if xyz is None or not xyz.text:
            self._notes.doubtful.append(f"joint '{raw.name}' gives no axis: z, as the format has it")
            return (0.0, 0.0, 1.0)
        given = np.array(vector(place.inside(xyz), xyz, ""))
        if not given.any():
            raise place.inside(xyz).error("has an axis of length zero: give its direction")
        key = _joint_key(raw.name)
        scope = self._scopes[key]
        named = self._scoped(scope, xyz.attributes.get("expressed_in", ""))
        if not named and (
            self._version <= MODEL_AXES
            or (self._version <= CHOSEN_AXES and _says(element, "use_parent_model_frame"))
        ):
            named = scope + MODEL
        if named:
            if named not in self._frames:
                raise place.inside(xyz).error(
                    f"has its axis expressed in '{named}', which is not there{did_you_mean(named, self._frames)}"
                )
            given = turned(self._frames.between(key, named).turns) @ given
        return triple(given)

    def _limits(self, raw: RawJoint, name: str, axis: XmlElement, *, slides: bool) -> Limits:
        element = axis.first("limit")
        if element is None or raw.type == "continuous":
            if element is not None and (element.first("lower") or element.first("upper")):
                self._notes.left_out.append(f"limits of joint '{name}': it is continuous, and has none")
            return None, 0.0
        place = FilePlace(self._file, f"joint '{name}'", element.line)
        unit = self._units.length if slides else ONE
        low, high = (
            self._number(place, element, key, none, unit, infinite=True) if element.first(key) else float(none)
            for key, none in (("lower", "-inf"), ("upper", "inf"))
        )
        # the format's own word for none, ±1e16, is said by nobody
        low, high = (math.copysign(math.inf, one) if abs(one) >= NONE else one for one in (low, high))
        return taken_limits((low, high), name, place, self._reading, self._notes, slides=slides)

    def _spring(self, name: str, axis: XmlElement, *, slides: bool, follows: bool) -> tuple[float, float]:
        """Stiffness of a joint's spring, N mm/rad or N/mm, and where it is free of stress; zeros without one."""
        dynamics = axis.first("dynamics")
        stiff = dynamics.first("spring_stiffness") if dynamics is not None else None
        if dynamics is None or stiff is None:
            return 0.0, 0.0
        place = FilePlace(self._file, f"joint '{name}'", stiff.line)
        # N m are 1e3 N mm, N/m are 1e-3 N/mm
        value = finite(place, stiff, "", "0", 1 / METRE if slides else METRE)
        if value < 0.0:
            raise place.error(f"has {shown(stiff)}: a stiffness is not below zero")
        if not value:
            return 0.0, 0.0
        if value < LEAST_STIFFNESS or follows:
            why = "which follows another" if follows else "which is softer than any spring of a model file"
            self._notes.left_out.append(f"the spring of joint '{name}', {why}")
            return 0.0, 0.0
        reference = dynamics.first("spring_reference")
        rest = (
            0.0
            if reference is None
            else finite(place.inside(reference), reference, "", "0", self._units.length if slides else ONE)
        )
        return value, rest

    def _rotor(self, raw: RawJoint, place: FilePlace, kind: Kind) -> float:
        """Inertia of a rotor reflected to its joint, kg mm² or kg: Drake's elements, inertia and ratio."""
        inertia = raw.element.first("drake:rotor_inertia")
        if inertia is None:
            return 0.0
        ratio = raw.element.first("drake:gear_ratio")
        return reflected(
            finite(place.inside(inertia), inertia, ""),
            1.0 if ratio is None else finite(place.inside(ratio), ratio, "", "1"),
            place, kind, raw.name, self._notes,
        )  # fmt: skip

    def _mimic_element(self, raw: RawJoint) -> XmlElement | None:
        axis = raw.element.first("axis")
        mimic = axis.first("mimic") if axis is not None else None
        if mimic is None:
            return None
        named = self._scoped(self._scopes[_joint_key(raw.name)], mimic.attributes.get("joint", ""))
        return XmlElement(mimic.tag, {**mimic.attributes, "joint": named}, mimic.line, mimic.children)

    def _mimic_numbers(
        self, place: FilePlace, element: XmlElement, unit: Decimal, own: Decimal
    ) -> tuple[float, float]:
        # the reference is a coordinate of the joint that is followed
        keys = (("multiplier", "1", unit), ("offset", "0", own), ("reference", "0", own / unit))
        ratio, offset, reference = (self._number(place, element, *key) for key in keys)
        return ratio, offset - ratio * reference

    def _inertial_frame(self, place: FilePlace, inertial: XmlElement, doubts: list[str], *, axes: bool) -> Placing:
        return _pose_of(place, inertial.first("pose"), doubts, self._units.length)


def _joint_key(name: str) -> str:
    """Of a joint's frame, which may have the name of a link."""
    return f"\0{name}"


def _label(axis: str) -> str:
    return {"axis": "1", "axis2": "2"}.get(axis, axis)
