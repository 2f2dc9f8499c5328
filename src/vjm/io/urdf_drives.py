"""What a URDF says of drives: rotors behind gears in transmissions, and position gains for ros2_control.

Written after ROS' ``transmission_interface`` of both generations, the PR2's transmissions, Drake's additions, and
Pinocchio's ``<rotor_params>``. A ratio without a rotor says nothing that a machine has.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace

from vjm.io.bounded_xml import XmlElement
from vjm.io.errors import ModelFileError, did_you_mean, printed
from vjm.io.mjcf_springs import LEAST_STIFFNESS
from vjm.io.robot import Notes, RobotJoint
from vjm.io.rotors import reflected
from vjm.io.urdf_values import FilePlace, finite

INERTIAS = ("rotorInertia", "motorInertia", "rotor_inertia", "motor_inertia", "drake:rotor_inertia")
RATIOS = ("mechanicalReduction", "mechanical_reduction", "drake:gear_ratio")
GAINS = ("p", "kp", "pos_kp")
"""Parameters that are a position gain, N m/rad or N/m."""
INTEGRAL = ("i", "ki", "pos_ki")


@dataclass
class UrdfDrives:
    """Of the joints of one file.

    Attributes:
        rotors: inertia reflected to its joint, kg mm², or kg where it slides.
        stiffness: by position gains, N mm/rad or N/mm.
        read: elements that were read, by their ``id``.
    """

    rotors: dict[str, float] = field(default_factory=dict)
    stiffness: dict[str, float] = field(default_factory=dict)
    read: set[int] = field(default_factory=set)

    def on(self, joint: RobotJoint) -> RobotJoint:
        """A joint with what is known of its drive."""
        rotor, stiffness = self.rotors.get(joint.name, 0.0), self.stiffness.get(joint.name, 0.0)
        return replace(joint, rotor=rotor, stiffness=stiffness) if rotor or stiffness else joint


def urdf_drives(
    root: XmlElement, joints: Iterable[RobotJoint], known: Collection[str], file: str, notes: Notes
) -> UrdfDrives:
    """What a URDF says of the drives of joints; what cannot be used of it is said and stops no import.

    Args:
        root: of the file.
        joints: that are taken.
        known: names of all joints.
        file: its name, for messages.
        notes: are added to.

    Example:
        >>> found = urdf_drives(xml.root, robot.joints, names, "arm.urdf", robot.notes)  # doctest: +SKIP
        >>> found.rotors["shoulder"]  # doctest: +SKIP
        200000.0
    """
    return _DriveReader(joints, known, file, notes).drives(root)


class _DriveReader:
    """One file."""

    def __init__(self, joints: Iterable[RobotJoint], known: Collection[str], file: str, notes: Notes) -> None:
        self._joints = {joint.name: joint for joint in joints if joint.kind != "fixed"}
        self._known, self._file, self._notes = known, file, notes
        self._found = UrdfDrives()
        self._gains: list[str] = []

    def drives(self, root: XmlElement) -> UrdfDrives:
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
        return self._found

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
        self._found.read |= {id(one) for one in (*inertias, *ratios)}

    def _rotor_params(self, place: FilePlace, element: XmlElement) -> None:
        name = element.attributes.get("name", "")
        if self._takes(place, name):
            inertia, ratio = (finite(place, element, key) for key in ("mass", "gear_ratio"))
            self._add_rotor(place, name, inertia, ratio)
            self._found.read.add(id(element))

    def _add_rotor(self, place: FilePlace, joint: str, inertia: float, ratio: float) -> None:
        value = reflected(inertia, ratio, place, self._joints[joint].kind, joint, self._notes)
        self._found.rotors[joint] = self._found.rotors.get(joint, 0.0) + value

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
        self._found.stiffness[name] = stiffness
        self._found.read.add(id(gain))

    def _takes(self, place: FilePlace, joint: str) -> bool:
        """Whether a joint moves and is taken.

        Raises:
            ModelFileError: there is none of this name.
        """
        if joint not in self._known:
            raise place.error(f"names the joint '{joint}', which is not there{did_you_mean(joint, self._known)}")
        return joint in self._joints

    def _number(self, place: FilePlace, element: XmlElement) -> float:
        """Between the tags, or Drake's and others' attribute ``value``."""
        return finite(place.inside(element), element, "value" if "value" in element.attributes else "")


def _first_in(owners: Sequence[XmlElement], tags: Collection[str]) -> list[XmlElement]:
    """What elements have of some names."""
    return [child for owner in owners for child in owner.children if child.tag in tags]
