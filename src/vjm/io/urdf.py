"""URDF files of robots, read into a model document.

A URDF knows links with masses and joints with axes, metres and radians. It knows no elasticity: the document that
comes of it has compliances to be filled in. What no model needs is not looked at, and what is omitted is said.
Written after the format's description and the reader of the ROS project, urdfdom.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from vjm.io.bounded_xml import XmlElement, XmlFile, read_xml
from vjm.io.errors import ModelFileError, did_you_mean, printed
from vjm.io.inertia import NO_BODYS, inertia_matrix, inertia_values, is_of_a_body, nearest_of_a_body, said_repair
from vjm.io.robot import ON_ITS_BASE, USUAL, Body, Kind, Mimic, Notes, Placing, Reading, Robot, RobotJoint, turned
from vjm.io.robot_document import Imported, robot_document
from vjm.io.urdf_content import XACRO, survey
from vjm.io.urdf_values import WHOLE_TURN, FilePlace, finite, length_vector, number, placing, usable_limits, vector

METRE = 1000.0
MOVING: dict[str, Kind] = {"revolute": "turns", "continuous": "turns", "prismatic": "slides"}
FLOATING = ("floating", "planar")
TYPES = (*MOVING, "fixed", *FLOATING)
PROPOSED = 8
"""Ends that a refusal names."""
_VERSION = re.compile(r"1\.[0-2]")


def import_urdf(path: str | Path, tip: str | None = None, reading: Reading = USUAL) -> Imported:
    """The model document of a URDF: the whole tree, or what leads from the root to one link.

    Masses of links on fixed joints are kept. With a tip, nothing but the way to it is looked at.

    Args:
        path: of the file.
        tip: name of the link at the end.
        reading: how it is read.

    Raises:
        ModelFileError: no such file or link, no URDF, or what is to be read of it makes no machine.

    Example:
        >>> found = import_urdf("arm.urdf", "tool0")  # doctest: +SKIP
        >>> chain = build_chain(found.document, "arm.urdf")  # doctest: +SKIP
    """
    file = Path(path)
    xml = read_xml(file)
    return robot_document(urdf_robot(xml, file.name, tip, reading), tip)


def urdf_robot(xml: XmlFile, file: str, tip: str | None = None, reading: Reading = USUAL) -> Robot:
    """The robot of a URDF's elements, see `import_urdf`.

    Raises:
        ModelFileError: as `import_urdf`.
    """
    if xml.root.tag != "robot":
        other = {"sdf": "an SDF file", "mujoco": "an MJCF file; give it the suffix .xml", "COLLADA": "a mesh"}
        what = other.get(xml.root.tag, f"its outermost element is <{xml.root.tag}>")
        raise ModelFileError(f"{file}: line {xml.root.line}: is no URDF, which begins with <robot>: {what}")
    return _UrdfReader(xml, file, reading).robot(tip)


@dataclass(frozen=True)
class _RawJoint:
    """A joint as written: its names and its element."""

    name: str
    type: str
    parent: str
    child: str
    element: XmlElement


class _UrdfReader:
    """One file."""

    def __init__(self, xml: XmlFile, file: str, reading: Reading) -> None:
        self._root, self._file, self._reading = xml.root, file, reading
        self._notes = Notes(doubtful=list(xml.notes))
        self._weightless: list[str] = []
        self._links: dict[str, list[XmlElement]] = {}
        for link in xml.root.all("link"):
            self._links.setdefault(link.attributes.get("name", ""), []).append(link)
        self._joints: dict[str, list[_RawJoint]] = {}
        self._into: dict[str, list[_RawJoint]] = {}
        for element in xml.root.all("joint"):
            parent, child = element.first("parent"), element.first("child")
            joint = _RawJoint(
                element.attributes.get("name", ""),
                element.attributes.get("type", ""),
                parent.attributes.get("link", "") if parent else "",
                child.attributes.get("link", "") if child else "",
                element,
            )
            self._joints.setdefault(joint.name, []).append(joint)
            self._into.setdefault(joint.child, []).append(joint)
        version = xml.root.attributes.get("version", "1.0").strip()
        self._quaternions = version in ("1.1", "1.2")
        if not _VERSION.fullmatch(version):
            self._notes.doubtful.append(f"the file's version {version!r} is not known: read as 1.0")

    def robot(self, tip: str | None) -> Robot:
        taken = self._all() if tip is None else self._way(tip)
        root = taken[0].parent if taken else tip or next(iter(self._links))
        names = [root, *(joint.child for joint in taken)]
        bodies = {name: self._body(name) for name in names}
        joints = [self._joint(joint) for joint in taken]
        wanted = {joint.name for joint in taken}
        masters = {
            joint.mimic.joint: self._master(joint.mimic.joint)
            for joint in joints
            if joint.mimic is not None and joint.mimic.joint not in wanted
        }
        survey(self._root, [*(self._links[name][0] for name in names), *(j.element for j in taken)], self._notes)
        if self._weightless:
            self._notes.doubtful.append(f"links whose <inertial> gives no mass: {', '.join(self._weightless)}")
        off = [name for name in self._links if name not in bodies]
        if off:
            self._notes.left_out.append(f"links that are not on the way to '{tip}': {', '.join(off)}")
        name = self._root.attributes.get("name", "").strip()
        if not name:
            name = self._file.split(".")[0]
            self._notes.changed.append(f"the robot has no name: called '{name}'")
        return Robot(name, root, bodies, joints, masters, self._file, self._notes)

    # --- which links and joints ---------------------------------------------------------------------------

    def _all(self) -> list[_RawJoint]:
        """Every joint, parents before children."""
        for name in self._links:
            self._link(name)
        if not self._links:
            raise ModelFileError(f"{self._file}: has no <link>: a robot has one, its base{self._macros()}")
        after: dict[str, list[_RawJoint]] = {}
        for name, several in self._joints.items():
            for joint in several:
                self._check(joint)
            self._only(name)
            for joint in several:
                after.setdefault(joint.parent, []).append(joint)
        for name, joints in self._into.items():
            self._refuse_parents(name, joints)
        roots = [name for name in self._links if name not in self._into]
        if len(roots) != 1:
            if not roots:
                raise ModelFileError(f"{self._file}: every link hangs on another: a loop without closure")
            raise ModelFileError(
                f"{self._file}: has {len(roots)} links without a parent ({', '.join(roots)}); a robot has one, its "
                f"base: connect them{self._proposed()}"
            )
        found: list[_RawJoint] = []
        todo = [roots[0]]
        while todo:
            name = todo.pop()
            if found_here := self._into.get(name):
                found += found_here
            todo += [joint.child for joint in reversed(after.get(name, []))]
        if len(found) < sum(map(len, self._joints.values())):
            reached = {roots[0], *(joint.child for joint in found)}
            lost = next(name for name in self._links if name not in reached)
            raise ModelFileError(f"{self._file}: link '{lost}' is its own ancestor: a loop without closure")
        return found

    def _macros(self) -> str:
        """A hint where links may be hidden in macros."""
        hidden = any(child.tag.startswith(XACRO) for child in self._root.children)
        return "; it holds xacro macros, which --xacro expands" if hidden else ""

    def _proposed(self) -> str:
        """The ends to which a way leads that nothing is wrong with."""
        parents = {joint.parent for joints in self._joints.values() for joint in joints}
        ends = []
        for name in self._links:
            if name and name not in parents and name in self._into:
                try:
                    self._way(name, propose=False)
                except ModelFileError:
                    continue
                ends.append(name)
        return f"; or take the way to one link, --tip {' or '.join(ends[:PROPOSED])}" if ends else ""

    def _way(self, tip: str, *, propose: bool = True) -> list[_RawJoint]:
        """The joints from the root to a link; refusals propose other paths unless they are tried just now."""
        if tip not in self._links:
            known = [name for name in self._links if name]
            hint = did_you_mean(tip, known) or f" (there are {', '.join(known) or 'none'})"
            hint += self._macros()
            raise ModelFileError(f"{self._file}: no link '{tip}'{hint}")
        way: list[_RawJoint] = []
        names, passed, at = set[str](), {tip}, tip
        self._link(at)
        while joints := self._into.get(at, []):
            self._refuse_parents(at, joints, propose=propose)
            self._check(joints[0], propose=propose)
            if joints[0].parent in passed:
                raise ModelFileError(f"{self._file}: link '{at}' is its own ancestor: a loop without closure")
            if joints[0].name in names:
                self._only(joints[0].name)
            names.add(joints[0].name)
            way.append(joints[0])
            at = joints[0].parent
            passed.add(at)
        return way[::-1]

    def _refuse_parents(self, name: str, joints: list[_RawJoint], *, propose: bool = True) -> None:
        if len(joints) > 1:
            raise ModelFileError(
                f"{self._file}: line {joints[1].element.line}: link '{name}' has two parents, the joints "
                f"'{joints[0].name}' and '{joints[1].name}': a loop; describe it as a manipulator with legs, see "
                f"docs/manipulators.md{self._proposed() if propose else ''}"
            )

    def _link(self, name: str) -> XmlElement:
        several = self._links[name]
        if not name:
            raise FilePlace(self._file, "a link", several[0].line).error("has no name: give one")
        if len(several) > 1:
            lines = ", ".join(str(link.line) for link in several)
            raise ModelFileError(f"{self._file}: {len(several)} links are called '{name}' (lines {lines}): rename")
        return several[0]

    def _check(self, joint: _RawJoint, *, propose: bool = True) -> None:
        """Refuse a joint that connects nothing, has another's name, or moves as no model's does."""
        place = FilePlace(self._file, f"joint '{joint.name}'", joint.element.line)
        if not joint.name:
            raise FilePlace(self._file, "a joint", joint.element.line).error("has no name: give one")
        for what, name in (("parent", joint.parent), ("child", joint.child)):
            if not name:
                raise place.error(f"names no {what}: add <{what} link=...>")
            if name not in self._links:
                raise place.error(f"names the link '{name}', which is not there{did_you_mean(name, self._links)}")
            self._link(name)
        if joint.type in FLOATING and not self._reading.fix_base:
            raise place.error(f"is {joint.type}, {ON_ITS_BASE}{self._proposed() if propose else ''}")
        if joint.type not in TYPES:
            raise place.error(
                f"has the type '{joint.type}': give one of {', '.join(TYPES)}{did_you_mean(joint.type, TYPES)}"
            )

    def _only(self, name: str) -> _RawJoint:
        several = self._joints[name]
        if len(several) > 1:
            lines = ", ".join(str(joint.element.line) for joint in several)
            raise ModelFileError(f"{self._file}: {len(several)} joints are called '{name}' (lines {lines}): rename")
        return several[0]

    # --- what they say ------------------------------------------------------------------------------------

    def _body(self, name: str) -> Body:
        link = self._link(name)
        inertial = link.first("inertial")
        if inertial is None:
            return Body(name)
        if (mass := inertial.first("mass")) is None:
            self._weightless.append(name)
            return Body(name, inertia=self._inertia(name, inertial))
        place = FilePlace(self._file, f"link '{name}'", mass.line)
        value = finite(place, mass, "value")
        if value < 0.0:
            raise place.error(f"has a mass of {printed(value)} kg: it must not be below zero")
        if not value:
            self._weightless.append(name)
        origin = inertial.first("origin")
        centre = (0.0, 0.0, 0.0) if origin is None else length_vector(place.inside(origin), origin, "xyz")
        return Body(name, value, centre, inertia=self._inertia(name, inertial))

    def _inertia(self, name: str, inertial: XmlElement) -> tuple[float, ...]:
        """Moments of inertia in the axes of the link, kg mm²; empty, and said, where no body has them."""
        element = inertial.first("inertia")
        if element is None:
            return ()
        place = FilePlace(self._file, f"link '{name}'", element.line)
        try:
            # statics needs none of it: what is wrong with it stops no import
            values = [finite(place, element, key, "0", 6) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")]
            turns = placing(
                place, inertial.first("origin"), self._notes.doubtful, quaternions=self._quaternions
            ).turns
        except ModelFileError as error:
            self._notes.doubtful.append(f"moments of inertia, left out: {error}")
            return ()
        if not any(values):
            return ()
        R, own = turned(turns), inertia_matrix(values)
        if not is_of_a_body(values):
            if self._reading.repairs == "refused":
                raise place.error(f"has {NO_BODYS}: correct them, or say `validate import` without --strict")
            if self._reading.repairs == "left out":
                self._notes.doubtful.append(f"link '{name}' has {NO_BODYS}: left out")
                return ()
            given, own = own, nearest_of_a_body(own)
            self._notes.changed.append(f"link '{name}': {said_repair(given, own)}")
        return tuple(inertia_values(R @ own @ R.T))

    def _joint(self, raw: _RawJoint) -> RobotJoint:
        place = FilePlace(self._file, f"joint '{raw.name}'", raw.element.line)
        where = placing(
            place, raw.element.first("origin"), self._notes.doubtful, quaternions=self._quaternions
        )  # fmt: skip
        if raw.type in FLOATING:
            self._notes.changed.append(f"joint '{raw.name}' is {raw.type}: it holds '{raw.child}' where it is")
        if raw.type not in MOVING:
            return RobotJoint(raw.name, "fixed", raw.parent, raw.child, where)
        return self._moving(raw, where, self._mimic(raw))

    def _master(self, name: str) -> RobotJoint:
        """A joint elsewhere that others mimic: its coordinate and its limits."""
        return self._moving(self._only(name), Placing(), None)

    def _moving(self, raw: _RawJoint, where: Placing, mimic: Mimic | None) -> RobotJoint:
        place = FilePlace(self._file, f"joint '{raw.name}'", raw.element.line)
        axis = (1.0, 0.0, 0.0)
        if (element := raw.element.first("axis")) is None or "xyz" not in element.attributes:
            self._notes.doubtful.append(f"joint '{raw.name}' gives no axis: x, as the format has it")
        else:
            x, y, z = vector(place.inside(element), element, "xyz")
            if not any((x, y, z)):
                raise place.inside(element).error("has an axis of length zero: give its direction")
            axis = (x, y, z)
        limits, home = self._limits(raw, place)
        return RobotJoint(raw.name, MOVING[raw.type], raw.parent, raw.child, where, axis, limits, home, mimic)

    def _limits(self, raw: _RawJoint, place: FilePlace) -> tuple[tuple[float, float] | None, float]:
        element = raw.element.first("limit")
        if element is None:
            if raw.type != "continuous":
                self._notes.doubtful.append(f"joint '{raw.name}' is {raw.type} and has no <limit>: taken as none")
            return None, 0.0
        slides = MOVING[raw.type] == "slides"
        place = place.inside(element)
        low, high = (number(place, element, key, "0", 3 if slides else 0) for key in ("lower", "upper"))
        if raw.type == "continuous":
            if low or high:
                self._notes.left_out.append(f"limits of joint '{raw.name}': it is continuous, and has none")
            return None, 0.0
        absent = [key for key in ("lower", "upper") if key not in element.attributes]
        if low > high:
            found = f"the limits {printed(low)} to {printed(high)} {'mm' if slides else 'rad'}, reversed"
            if absent or self._reading.repairs == "refused":
                lacking = f" ({absent[0]} is not given, and so 0)" if absent else ""
                raise place.error(f"has {found}{lacking}: give lower below upper")
            if self._reading.repairs == "left out":
                self._notes.doubtful.append(f"joint '{raw.name}' has {found}: taken as none")
                return None, 0.0
            self._notes.changed.append(f"joint '{raw.name}' has {found}: they were exchanged")
            low, high = high, low
        if len(absent) == 1:
            self._notes.doubtful.append(f"joint '{raw.name}' gives no {absent[0]} limit: 0, as the format has it")
        return usable_limits(
            low, high, raw.name, slides=slides, doubts=self._notes.doubtful, changed=self._notes.changed
        )

    def _mimic(self, raw: _RawJoint) -> Mimic | None:
        """What a joint follows in the end, through all joints between, in mm and rad."""
        ratio, offset, at, way = 1.0, 0.0, raw, [raw.name]
        place = FilePlace(self._file, f"joint '{raw.name}'", raw.element.line)
        while (element := at.element.first("mimic")) is not None:
            name = element.attributes.get("joint", "")
            here = place.inside(element)
            if name in way:
                how = "itself" if len(way) == 1 else f"itself by way of {', '.join(way[1:])}"
                raise here.error(f"mimics {how}: name another joint")
            if name not in self._joints or not name:
                raise here.error(f"mimics '{name}', which is no joint{did_you_mean(name, self._joints)}")
            master = self._only(name)
            if master.type not in MOVING:
                raise here.error(
                    f"mimics '{name}', which is {master.type or 'of no type'}: name a joint that moves"
                )
            power = 3 * ((MOVING[at.type] == "slides") - (MOVING[master.type] == "slides"))
            own = 3 * (MOVING[at.type] == "slides")
            step = finite(here, element, "multiplier", "1", power)
            shift = finite(here, element, "offset", "0", own)
            ratio, offset, at = ratio * step, offset + ratio * shift, master
            way.append(name)
        if at is raw:
            return None
        if MOVING[raw.type] == "turns" and abs(offset) > WHOLE_TURN:
            self._notes.doubtful.append(
                f"joint '{raw.name}': the offset of its mimic, {printed(offset)} rad, is beyond a whole turn: "
                "is it in degrees?"
            )
        return Mimic(at.name, ratio, offset)
