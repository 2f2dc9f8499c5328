"""URDF files of robots.

A URDF knows links with masses and joints with axes, metres and radians. It knows no elasticity: the document that
comes of it has compliances to be filled in. What no model needs is not looked at, and what is omitted is said.
Written after the format's description and the reader of the ROS project, urdfdom.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from decimal import Decimal

from vjm.io.bounded_xml import XmlElement, XmlFile
from vjm.io.errors import ModelFileError, did_you_mean, printed
from vjm.io.robot import (
    LEAST_STIFFNESS,
    USUAL,
    Kind,
    Mimic,
    Notes,
    Placing,
    Reading,
    Robot,
    RobotJoint,
    masters_of,
    triple,
)
from vjm.io.robot_xml import (
    ONE,
    WHOLE_TURN,
    DescribedTree,
    FilePlace,
    Limits,
    RawJoint,
    finite,
    given_quaternion,
    quoted,
    reflected,
    rpy_turns,
    survey,
    taken_limits,
    vector,
)
from vjm.io.robot_xml import XACRO_PREFIX as XACRO

# --- What a URDF says of drives: rotors behind gears in transmissions, and position gains for ros2_control --------
#
# Written after ROS' ``transmission_interface`` of both generations, the PR2's transmissions, Drake's additions, and
# Pinocchio's ``<rotor_params>``. A ratio without a rotor says nothing that a machine has.

INERTIAS = ("rotorInertia", "motorInertia", "rotor_inertia", "motor_inertia", "drake:rotor_inertia")
RATIOS = ("mechanicalReduction", "mechanical_reduction", "drake:gear_ratio")
GAINS = ("p", "kp", "pos_kp")
"""Parameters that are a position gain, N m/rad or N/m."""
INTEGRAL = ("i", "ki", "pos_ki")


class UrdfDrives:
    """What a URDF says of the drives of joints; what cannot be used of it is said and stops no import.

    Attributes:
        rotors: inertia reflected to its joint, kg mm², or kg where it slides.
        stiffness: by position gains, N mm/rad or N/mm.
        read: elements that were read, by their ``id``.
    """

    def __init__(
        self, root: XmlElement, joints: Iterable[RobotJoint], known: Collection[str], file: str, notes: Notes
    ) -> None:
        """Of a file's root, the joints that are taken and the names of all; notes are added to."""
        self.rotors: dict[str, float] = {}
        self.stiffness: dict[str, float] = {}
        self.read: set[int] = set()
        self._joints = {joint.name: joint for joint in joints if joint.kind != "fixed"}
        self._known, self._file, self._notes = known, file, notes
        self._gains: list[str] = []
        controls = root.all("ros2_control")
        inner = [one for control in controls for one in control.all("transmission")]
        for one in (*root.all("transmission"), *inner):
            self._doubting(one, "transmission", self._transmission)
        for params in root.all("rotor_params"):
            for joint in params.all("joint"):
                self._doubting(joint, "rotor_params of joint", self._rotor_params)
        for control in controls:
            for joint in control.all("joint"):
                self._doubting(joint, "ros2_control of joint", self._control)
        if self._gains:
            self._notes.changed.append(
                f"the compliance of drives is that of their controllers' position gains: {', '.join(self._gains)}. "
                "It has nothing of gears"
            )

    def on(self, joint: RobotJoint) -> RobotJoint:
        """A joint with what is known of its drive."""
        rotor, stiffness = self.rotors.get(joint.name, 0.0), self.stiffness.get(joint.name, 0.0)
        return replace(joint, rotor=rotor, stiffness=stiffness) if rotor or stiffness else joint

    def _doubting(self, element: XmlElement, what: str, read: Callable[[FilePlace, XmlElement], None]) -> None:
        """Read an element; what is wrong with it is doubted, for a machine stands without it."""
        place = FilePlace(self._file, f"the {what} '{element.attributes.get('name', '')}'", element.line)
        try:
            read(place, element)
        except ModelFileError as error:
            self._notes.doubtful.append(f"left out: {error}")

    def _transmission(self, place: FilePlace, element: XmlElement) -> None:
        owners = [*element.all("actuator"), *element.all("joint"), element]
        inertias = _first_in(owners, INERTIAS)
        if not inertias:
            return
        joints = list(dict.fromkeys(joint.attributes.get("name", "") for joint in element.all("joint")))
        if len(joints) != 1 or len(inertias) > 1:
            what = f"{len(joints)} joints" if len(joints) != 1 else f"{len(inertias)} motors"
            raise place.error(f"has {what}: a rotor is read where one motor drives one joint")
        ratios = _first_in(owners, RATIOS)
        if not self._takes(place, joints[0]):
            return
        if not ratios:
            self._notes.doubtful.append(
                f"{place.owner} gives a rotor and no <{RATIOS[0]}>: the ratio is taken as 1"
            )
        inertia, ratio = self._number(place, inertias[0]), [self._number(place, one) for one in ratios]
        if len(set(ratio)) > 1:
            raise place.error(f"has the ratios {', '.join(map(printed, ratio))}: give one")
        self._add_rotor(place, joints[0], inertia, ratio[0] if ratio else 1.0)
        self.read |= {id(one) for one in (*inertias, *ratios)}

    def _rotor_params(self, place: FilePlace, element: XmlElement) -> None:
        name = element.attributes.get("name", "")
        if self._takes(place, name):
            inertia, ratio = (finite(place, element, key) for key in ("mass", "gear_ratio"))
            self._add_rotor(place, name, inertia, ratio)
            self.read.add(id(element))

    def _add_rotor(self, place: FilePlace, joint: str, inertia: float, ratio: float) -> None:
        value = reflected(inertia, ratio, place, self._joints[joint].kind, joint, self._notes)
        self.rotors[joint] = self.rotors.get(joint, 0.0) + value

    def _control(self, place: FilePlace, element: XmlElement) -> None:
        name = element.attributes.get("name", "")
        commands = element.all("command_interface")
        by_position = [one for one in commands if one.attributes.get("name", "").startswith(("position", "effort"))]
        given = {
            one.attributes.get("name", ""): one
            for owner in (element, *by_position)
            for one in owner.all("param")
        }  # fmt: skip
        gain = next((given[key] for key in GAINS if key in given), None)
        if gain is None or not self._takes(place, name):
            return
        if commands and not by_position:
            takes = commands[0].attributes.get("name", "")
            raise place.error(f"has a gain, but takes {takes}: no position is held by it")
        value = finite(place.inside(gain), gain, "")
        if not value:
            return
        if value < 0.0:
            raise place.error(f"has a position gain of {printed(value)}: it pushes away from where it is sent")
        # N m are 1e3 N mm, N/m are 1e-3 N/mm
        stiffness = value * (1e-3 if self._joints[name].kind == "slides" else 1e3)
        if self._joints[name].mimic is not None:
            raise place.error("has a position gain, but the joint follows another")
        if stiffness < LEAST_STIFFNESS:
            raise place.error("has a position gain that is softer than any spring of a model file")
        integral = next((given[key] for key in INTEGRAL if key in given), None)
        said = "" if integral is None or not integral.text else f", ki {integral.text}, which is not read"
        self._gains.append(f"{name} (kp {printed(value)}{said})")
        self.stiffness[name] = stiffness
        self.read.add(id(gain))

    def _takes(self, place: FilePlace, joint: str) -> bool:
        """Whether a joint moves and is taken."""
        if joint not in self._known:
            raise place.error(f"names the joint '{joint}', which is not there{did_you_mean(joint, self._known)}")
        return joint in self._joints

    def _number(self, place: FilePlace, element: XmlElement) -> float:
        """Between the tags, or Drake's and others' attribute ``value``."""
        return finite(place.inside(element), element, "value" if "value" in element.attributes else "")


def _first_in(owners: Sequence[XmlElement], tags: Collection[str]) -> list[XmlElement]:
    """What elements have of some names."""
    return [child for owner in owners for child in owner.children if child.tag in tags]


MOVING: dict[str, Kind] = {"revolute": "turns", "continuous": "turns", "prismatic": "slides"}
FLOATING = ("floating", "planar")
WORLD = "world"
"""Drake's name of what a robot stands on; its files have no such link."""
TYPES = (*MOVING, "fixed", *FLOATING)
_VERSION = re.compile(r"1\.[0-2]")


def urdf_robot(xml: XmlFile, file: str, tip: str | None = None, reading: Reading = USUAL) -> Robot:
    """The robot of a URDF's elements: the whole tree, or what leads from the root to one link.

    Masses of links on fixed joints are kept. With a tip, nothing but the way to it is looked at.

    Raises:
        ModelFileError: no URDF or no such link, or what is to be read of it makes no machine.
    """
    if xml.root.tag != "robot":
        other = {"sdf": "an SDF file", "mujoco": "an MJCF file; give it the suffix .xml", "COLLADA": "a mesh"}
        what = other.get(xml.root.tag, f"its outermost element is <{xml.root.tag}>")
        raise ModelFileError(f"{file}: line {xml.root.line}: is no URDF, which begins with <robot>: {what}")
    return _UrdfReader(xml, file, reading).robot(tip)


class _UrdfReader(DescribedTree):
    """One file."""

    _moves, _types, _floating = MOVING, TYPES, FLOATING

    def __init__(self, xml: XmlFile, file: str, reading: Reading) -> None:
        super().__init__(file, reading, Notes(doubtful=list(xml.notes)))
        self._root = xml.root
        for link in xml.root.all("link"):
            self._links.setdefault(link.attributes.get("name", ""), []).append(link)
        for element in xml.root.all("joint"):
            parent, child = element.first("parent"), element.first("child")
            self._keep_joint(
                RawJoint(
                    element.attributes.get("name", ""),
                    element.attributes.get("type", ""),
                    parent.attributes.get("link", "") if parent else "",
                    child.attributes.get("link", "") if child else "",
                    element,
                )
            )
        if WORLD not in self._links and any(
            one.parent == WORLD for several in self._joints.values() for one in several
        ):
            self._links[WORLD] = [XmlElement("link", {"name": WORLD}, xml.root.line)]
            self._notes.changed.append(f"no link is called '{WORLD}', on which joints stand: it is the base")
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
        masters = masters_of(joints, self._master)
        drives = UrdfDrives(self._root, (*joints, *masters.values()), self._joints, self._file, self._notes)
        joints, masters = list(map(drives.on, joints)), {name: drives.on(one) for name, one in masters.items()}
        owners = [*(self._links[name][0] for name in names), *(joint.element for joint in taken)]
        survey(self._root, owners, self._notes, read=drives.read)
        if self._massless:
            self._notes.doubtful.append(f"links whose <inertial> gives no mass: {', '.join(self._massless)}")
        off = [name for name in self._links if name not in bodies]
        if off:
            self._notes.left_out.append(f"links that are not on the way to '{tip}': {', '.join(off)}")
        name = self._root.attributes.get("name", "").strip()
        if not name:
            name = self._file.split(".")[0]
            self._notes.changed.append(f"the robot has no name: called '{name}'")
        return Robot(name, root, bodies, joints, masters, self._file, self._notes, impossible=self._impossible)

    def _macros(self) -> str:
        hidden = any(child.tag.startswith(XACRO) for child in self._root.children)
        return "; it holds xacro macros, which --xacro expands" if hidden else ""

    def _mimic_element(self, raw: RawJoint) -> XmlElement | None:
        return raw.element.first("mimic")

    def _mimic_numbers(
        self, place: FilePlace, element: XmlElement, unit: Decimal, own: Decimal
    ) -> tuple[float, float]:
        return finite(place, element, "multiplier", "1", unit), finite(place, element, "offset", "0", own)

    # --- what they say ------------------------------------------------------------------------------------

    def _inertial_frame(self, place: FilePlace, inertial: XmlElement, doubts: list[str], *, axes: bool) -> Placing:
        return self._placing(place, inertial.first("origin"), doubts, axes=axes)

    def _placing(
        self, place: FilePlace, origin: XmlElement | None, doubts: list[str], *, axes: bool = True
    ) -> Placing:
        """Where an origin lies, mm and rad: roll, pitch, yaw about fixed axes, or a quaternion."""
        if origin is None:
            return Placing()
        place = place.inside(origin)
        shift = triple(vector(place, origin, "xyz", unit=self._units.length))
        if not axes:
            return Placing(shift)
        if self._quaternions and "quat_xyzw" in origin.attributes:
            if "rpy" in origin.attributes:
                raise place.error("has <origin> with rpy and quat_xyzw, two rotations: give one")
            return Placing(shift, given_quaternion(place, vector(place, origin, "quat_xyzw", 4)))
        angles = vector(place, origin, "rpy")
        if max(map(abs, angles)) > WHOLE_TURN:
            doubts.append(
                f"{place.owner} (line {origin.line}): rpy {quoted(origin, 'rpy')} is beyond a whole turn: "
                "is it in degrees? A URDF has rad"
            )
        return Placing(shift, rpy_turns(angles))

    def _joint(self, raw: RawJoint) -> RobotJoint:
        place = FilePlace(self._file, f"joint '{raw.name}'", raw.element.line)
        where = self._placing(place, raw.element.first("origin"), self._notes.doubtful)
        if raw.type in FLOATING:
            self._notes.changed.append(f"joint '{raw.name}' is {raw.type}: it holds '{raw.child}' where it is")
        if raw.type not in MOVING:
            return RobotJoint(raw.name, "fixed", raw.parent, raw.child, where)
        return self._following(self._moving(raw, where, self._mimic(raw)))

    def _master(self, name: str) -> RobotJoint:
        """A joint elsewhere that others mimic: its coordinate and its limits."""
        return self._moving(self._only(name), Placing(), None)

    def _moving(self, raw: RawJoint, where: Placing, mimic: Mimic | None) -> RobotJoint:
        place = FilePlace(self._file, f"joint '{raw.name}'", raw.element.line)
        axis = (1.0, 0.0, 0.0)
        if (element := raw.element.first("axis")) is None or "xyz" not in element.attributes:
            self._notes.doubtful.append(f"joint '{raw.name}' gives no axis: x, as the format has it")
        else:
            axis = triple(vector(place.inside(element), element, "xyz"))
            if not any(axis):
                raise place.inside(element).error("has an axis of length zero: give its direction")
        limits, home = self._limits(raw, place)
        return RobotJoint(raw.name, MOVING[raw.type], raw.parent, raw.child, where, axis, limits, home, mimic)

    def _limits(self, raw: RawJoint, place: FilePlace) -> Limits:
        element = raw.element.first("limit")
        if element is None:
            if raw.type != "continuous":
                self._notes.doubtful.append(f"joint '{raw.name}' is {raw.type} and has no <limit>: taken as none")
            return None, 0.0
        slides = MOVING[raw.type] == "slides"
        place = place.inside(element)
        unit = self._units.length if slides else ONE
        low, high = (self._number(place, element, key, "0", unit, infinite=True) for key in ("lower", "upper"))
        if raw.type == "continuous":
            if low or high:
                self._notes.left_out.append(f"limits of joint '{raw.name}': it is continuous, and has none")
            return None, 0.0
        absent = [key for key in ("lower", "upper") if key not in element.attributes]
        return taken_limits((low, high), raw.name, place, self._reading, self._notes, absent, slides=slides)
