"""What URDF and SDF files have in common.

Here are numbers in metres and radians, what is read, omitted and not understood, rotors behind gears, links and
joints by name and how they hang on one another.
"""

from __future__ import annotations

import math
import re
import reprlib
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

from vjm.io.bounded_xml import XmlElement
from vjm.io.errors import ModelFileError, did_you_mean, printed
from vjm.io.inertia import NO_BODYS, inertia_matrix, inertia_values, is_of_a_body, nearest_of_a_body, said_repair
from vjm.io.robot import (
    HUGE,
    ON_ITS_BASE,
    Body,
    Kind,
    Mimic,
    Notes,
    Placing,
    Reading,
    RobotJoint,
    Turns,
    turned,
)
from vjm.rotations import Array

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
_ODD = re.compile(r"[+-]?(?:inf|infinity|nan)", re.IGNORECASE)
UNEXPANDED = re.compile(r"\$[{(]")
WHOLE_TURN = 2.0 * math.pi
ONE, METRE = Decimal(1), Decimal(1000)
"""Units: of what has none, and of lengths in mm."""
XACRO = "it holds unexpanded xacro; expand it by --xacro, or with ROS' own command"


@dataclass(frozen=True)
class FilePlace:
    """Where in a file something stands, for messages.

    Attributes:
        file: its name.
        owner: as people call what it belongs to, such as "joint 'elbow'".
        line: of the element; zero where it is not known.
    """

    file: str
    owner: str
    line: int = 0

    def error(self, what: str) -> ModelFileError:
        """To be raised: ``what`` ends a sentence that begins with the owner."""
        line = f"line {self.line}: " if self.line else ""
        return ModelFileError(f"{self.file}: {line}{self.owner} {what}")

    def inside(self, element: XmlElement) -> FilePlace:
        """The same owner, at an element of its own."""
        return FilePlace(self.file, self.owner, element.line)


def number(
    place: FilePlace, element: XmlElement, key: str, default: str | None = None, unit: Decimal = ONE
) -> float:
    """An attribute's number times a unit, rounded once; infinite where it says so.

    Raises:
        ModelFileError: it is missing without a default, no number, or NaN.
    """
    text = _written(element, key)
    if (text := default if text is None else text) is None:
        raise place.error(f"has <{element.tag}> without {key or 'a number'}: give a number")
    return _value(place, element, key, text, unit)


def finite(
    place: FilePlace, element: XmlElement, key: str, default: str | None = None, unit: Decimal = ONE
) -> float:
    """As `number`, where infinity makes no sense either."""
    value = number(place, element, key, default, unit)
    if math.isinf(value):
        raise place.error(f"has {shown(element, key)}, which is not finite: give a number")
    return value


def vector(place: FilePlace, element: XmlElement, key: str, length: int = 3, unit: Decimal = ONE) -> list[float]:
    """An attribute's numbers times a unit; zeros where it is not there.

    Raises:
        ModelFileError: there are more or less of them, or one is no finite number.
    """
    text = _written(element, key)
    if text is None:
        return [0.0] * length
    words = text.split()
    if len(words) != length:
        hint = XACRO if UNEXPANDED.search(text) else f"give {length} numbers with blanks between them"
        raise place.error(f"has {shown(element, key)}: {hint}")
    values = [_value(place, element, key, word, unit) for word in words]
    if not all(map(math.isfinite, values)):
        raise place.error(f"has {shown(element, key)}, which is not finite: give numbers")
    return values


def _value(place: FilePlace, element: XmlElement, key: str, text: str, unit: Decimal) -> float:
    word = text.strip()
    if _NUMBER.fullmatch(word):
        return float(Decimal(word) * unit) if unit != ONE else float(word)
    if not _ODD.fullmatch(word):
        hint = XACRO if UNEXPANDED.search(word) else "give a number"
        raise place.error(f"has {shown(element, key)}, which is no number: {hint}")
    if "nan" in word.lower():
        raise place.error(f"has {shown(element, key)}: give a number")
    return float(word)


def _written(element: XmlElement, key: str) -> str | None:
    """An attribute, or for the empty key what stands between an element's tags; None where there is none."""
    return element.attributes.get(key) if key else element.text or None


def shown(element: XmlElement, key: str = "") -> str:
    """An attribute of an element as it is written, or for the empty key the element itself."""
    if key:
        return f"<{element.tag} {key}={quoted(element, key)}>"
    return f"<{element.tag}>{reprlib.repr(element.text)[1:-1]}</{element.tag}>"


def quoted(element: XmlElement, key: str) -> str:
    """An attribute's value as it is written."""
    return '"' + reprlib.repr(element.attributes[key])[1:-1] + '"'


def rpy_turns(angles: list[float]) -> Turns:
    """The turns of roll, pitch and yaw about fixed axes, rad."""
    axes = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    # within half a turn, whatever was written
    reduced = (
        math.atan2(math.sin(angle), math.cos(angle)) if abs(angle) > math.pi else angle for angle in angles[::-1]
    )
    return tuple((axis, angle) for axis, angle in zip(axes, reduced, strict=True) if angle)


def given_quaternion(place: FilePlace, numbers: list[float]) -> Turns:
    """The turn of a file's quaternion ``x, y, z, w``.

    Raises:
        ModelFileError: its length is zero.
    """
    if not any(numbers):
        raise place.error("has a quaternion of length zero: give one of length 1")
    return quaternion_turns(*numbers)


def quaternion_turns(x: float, y: float, z: float, w: float) -> Turns:
    """The turn of a quaternion of any length above zero: axis, and angle in rad."""
    sine = math.hypot(x, y, z)
    angle = 2.0 * math.atan2(sine, abs(w))
    if not sine:
        return ()
    sign = 1.0 if w >= 0.0 else -1.0
    return (((sign * x / sine, sign * y / sine, sign * z / sine), angle),)


Limits = tuple[tuple[float, float] | None, float]
"""Of a joint, mm or rad, and a coordinate inside of them."""


def taken_limits(
    limits: tuple[float, float], joint: str, place: FilePlace, reading: Reading, notes: Notes,
    absent: Sequence[str] = (), *, slides: bool,
) -> Limits:  # fmt: skip
    """Limits of a joint, mm or rad, as a model file takes them, and a coordinate inside: zero, else the middle.

    Those of a file may be infinite; ``absent`` are names of those that it does not give.

    Raises:
        ModelFileError: they are reversed, and that is to be refused, or one of them is not given.
    """
    low, high = limits
    unit = "mm" if slides else "rad"
    if low > high:
        problem = f"the limits {printed(low)} to {printed(high)} {unit}, reversed"
        lacking = f" ({absent[0]} is not given, and so 0)" if absent else ""
        if not notes.repaired(
            "refused" if absent else reading.repairs,
            place.error(f"has {problem}{lacking}: give lower below upper"),
            doubtful=f"{place.owner} has {problem}: taken as none",
            changed=f"{place.owner} has {problem}: they were exchanged",
        ):
            return None, 0.0
        low, high = high, low
    if len(absent) == 1:
        notes.doubtful.append(f"joint '{joint}' gives no {absent[0]} limit: 0, as the format has it")
    farthest = HUGE if slides else WHOLE_TURN
    if low == high or low >= HUGE or high <= -HUGE:
        how = f"equal ({printed(low)} {unit})" if low == high else f"beyond {printed(HUGE)} {unit}"
        notes.doubtful.append(f"joint '{joint}': its limits are {how}: taken as none")
        return None, low if low == high and abs(low) <= farthest else 0.0
    if low <= -HUGE and high >= HUGE:
        if not (math.isinf(low) and math.isinf(high)):
            notes.changed.append(f"joint '{joint}': its limits are beyond {printed(HUGE)} {unit}: none")
        return None, 0.0
    if max(-low, high) > HUGE:
        notes.changed.append(f"joint '{joint}': its limit beyond {printed(HUGE)} {unit} became that")
    low, high = max(low, -HUGE), min(high, HUGE)
    if not slides and HUGE > max(abs(low), abs(high)) > 2.0 * WHOLE_TURN:
        notes.doubtful.append(
            f"joint '{joint}': its limits {printed(low)} to {printed(high)} rad are more than two turns: "
            "are they in degrees?"
        )
    if low <= 0.0 <= high:
        return (low, high), 0.0
    middle = 0.5 * (low + high)
    return (low, high), middle if abs(middle) <= farthest else min(max(0.0, low), high)


def repaired_moments(moments: tuple[Array, Array], place: FilePlace, reading: Reading, notes: Notes) -> bool:
    """Say that given moments of inertia, kg mm², became others, see `Notes.repaired`."""
    return notes.repaired(
        reading.repairs,
        place.error(f"has {NO_BODYS}: correct them, or say `validate import` without --strict"),
        doubtful=f"{place.owner} has {NO_BODYS}: left out",
        changed=f"{place.owner}: {said_repair(*moments)}",
    )


MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
SHAPES = "shapes and meshes, which no command reads"
CONTROL = "what controllers and simulators take"
DRIVES = "forces, speeds, damping and friction of joints"
FIXED = "what a fixed joint has no use for"
UNUSED_WHEN_FIXED = ("axis", "limit", "mimic")

XACRO_PREFIX = "xacro:"
MANY = 3
"""Lines that are named; of more it is said how many."""


@dataclass(frozen=True)
class FormatKeys:
    """What a format has.

    Attributes:
        root: names of the outermost element and of those in it that hold links and joints.
        children: elements by the one that they stand in. An empty text: it is read; else as what it is left out.
        attributes: the same of attributes by their element.
        once: elements of which the first is read.
    """

    root: Collection[str]
    children: Mapping[str, Mapping[str, str]]
    attributes: Mapping[str, Mapping[str, str]]
    once: Collection[str]


URDF = FormatKeys(
    root=("robot",),
    children={
        "robot": {
            "link": "", "joint": "", "material": SHAPES, "transmission": CONTROL, "gazebo": CONTROL,
            "sensor": CONTROL, "ros2_control": CONTROL,
            "rotor_params": CONTROL, "model_state": CONTROL, "group_state": CONTROL,
            "mujoco": CONTROL, "drake:joint": CONTROL,
        },
        "link": {
            "inertial": "", "visual": SHAPES, "collision": SHAPES, "sensor": CONTROL, "gazebo": CONTROL,
            "contact": CONTROL, "self_collision_checking": SHAPES,
        },
        "inertial": {"origin": "", "mass": "", "inertia": ""},
        "joint": {
            "origin": "", "parent": "", "child": "", "axis": "", "limit": "", "mimic": "",
            "dynamics": DRIVES, "calibration": CONTROL, "safety_controller": CONTROL, "gazebo": CONTROL,
            "hardwareInterface": CONTROL,
        },
    },
    attributes={
        "robot": {"name": "", "version": ""},
        "link": {"name": "", "type": CONTROL},
        "joint": {"name": "", "type": ""},
        "origin": {"xyz": "", "rpy": "", "quat_xyzw": ""},
        "inertia": dict.fromkeys(MOMENTS, ""),
        "mass": {"value": ""},
        "parent": {"link": ""},
        "child": {"link": ""},
        "axis": {"xyz": ""},
        "limit": {
            "lower": "", "upper": "", "effort": DRIVES, "velocity": DRIVES, "acceleration": DRIVES,
            "deceleration": DRIVES, "jerk": DRIVES,
        },
        "mimic": {"joint": "", "multiplier": "", "offset": ""},
    },
    once={"inertial", "origin", "mass", "inertia", "parent", "child", "axis", "limit", "mimic"},
)  # fmt: skip


def survey(
    root: XmlElement,
    owners: Iterable[XmlElement],
    notes: Notes,
    keys: FormatKeys = URDF,
    read: Collection[int] = (),
) -> None:
    """Say what of a file's root and of its links and joints that are taken is not read.

    ``read`` has the ``id`` of elements that were read, though what they stand in is not.
    """
    left: dict[str, dict[str, list[int]]] = {}
    odd: dict[str, list[int]] = {}
    macros: list[int] = []

    def leave(why: str, what: str, line: int) -> None:
        target = left.setdefault(why, {}) if why else odd
        target.setdefault(what, []).append(line)

    def look(element: XmlElement, name: str) -> Iterator[tuple[XmlElement, str]]:
        for key, value in element.attributes.items():
            if UNEXPANDED.search(value):
                macros.append(element.line)
            known = keys.attributes.get(name, {}).get(key)
            if known is None and not key.startswith("xmlns"):
                leave("", f'{key}="…" in <{element.tag}>', element.line)
            elif known:
                leave(known, key, element.line)
        seen: set[str] = set()
        fixed = element.tag == "joint" and element.attributes.get("type") == "fixed"
        for child in element.children:
            known = keys.children.get(element.tag, {}).get(child.tag)
            if known is None:
                leave("", f"<{child.tag}> in <{element.tag}>", child.line)
                if child.tag.startswith(XACRO_PREFIX):
                    macros.append(child.line)
            elif known:
                leave(known, f"<{child.tag}>", child.line)
                for inner in (one for one in _below(child) if id(one) not in read):
                    leave(known, f"<{inner.tag}>", inner.line)
            elif child.tag in keys.once and child.tag in seen:
                notes.doubtful.append(
                    f"line {child.line}: <{element.tag}> has another <{child.tag}>: the first one is read"
                )
            elif fixed and child.tag in UNUSED_WHEN_FIXED:
                leave(FIXED, f"<{child.tag}>", child.line)
            elif element.tag not in keys.root:
                inside = f"{element.tag}/{child.tag}"
                yield child, inside if inside in keys.attributes else child.tag
            seen.add(child.tag)

    todo = [(element, element.tag) for element in (root, *owners)]
    while todo:
        todo += look(*todo.pop())
    for why, things in left.items():
        counted = (f"{what} ({len(lines)})" if len(lines) > 1 else what for what, lines in things.items())
        notes.left_out.append(f"{why}: {', '.join(counted)}")
    for what, lines in odd.items():
        notes.left_out.append(f"not understood: {what} ({_lines(lines)})")
    if macros:
        notes.doubtful.append(f"the file holds xacro that is not expanded ({_lines(macros)}): --xacro expands it")


def _below(element: XmlElement) -> Iterator[XmlElement]:
    todo = list(element.children)
    while todo:
        one = todo.pop()
        yield one
        todo += one.children


def _lines(lines: list[int]) -> str:
    lines = sorted(lines)
    more = f" and {len(lines) - MANY} more" if len(lines) > MANY else ""
    return f"line {', '.join(map(str, lines[:MANY]))}{more}"


def reflected(inertia: float, ratio: float, place: FilePlace, kind: Kind, joint: str, notes: Notes) -> float:
    """Inertia of a rotor in kg m² that its joint feels: times the squared gear ratio.

    The ratio is turns of the motor per turn of the joint, or rad per metre where it slides.

    Returns:
        kg mm², or kg where the joint slides.

    Raises:
        ModelFileError: one of them is negative, or the ratio is zero.
    """
    if inertia < 0.0:
        raise place.error(f"has a rotor of {printed(inertia)} kg m²: it must not be below zero")
    if not ratio:
        raise place.error("has a gear ratio of zero: give turns of the motor per turn of the joint")
    # kg m² are 1e6 kg mm²; rad per metre, squared, make kg of kg m²
    value = inertia * ratio**2 * (1.0 if kind == "slides" else 1e6)
    unit = "kg" if kind == "slides" else "kg m²"
    notes.changed.append(
        f"joint '{joint}' has the inertia of its rotor, {printed(inertia)} kg m² times the squared gear ratio "
        f"{printed(abs(ratio))}, {printed(inertia * ratio**2)} {unit}"
    )
    return value


PROPOSED = 8
"""Ends that a refusal names."""


@dataclass(frozen=True)
class RawJoint:
    """A joint as written: its names and its element."""

    name: str
    type: str
    parent: str
    child: str
    element: XmlElement


class DescribedTree(ABC):
    """The links and joints of one file.

    Attributes of a format, given by its class:
        _moves: how joints of one axis move, by type.
        _types: of joints that are read.
        _floating: those of joints that hold nothing.
        _one_base: what to do where a robot has several bases.
        _by_elements: whether numbers are elements of their own, and no attributes.
    """

    _moves: Mapping[str, Kind]
    _types: Sequence[str]
    _floating: Sequence[str] = ()
    _one_base = "connect them"
    _by_elements = False

    def __init__(self, file: str, reading: Reading, notes: Notes) -> None:
        self._file, self._reading, self._notes = file, reading, notes
        self._units = reading.units
        self._links: dict[str, list[XmlElement]] = {}
        self._joints: dict[str, list[RawJoint]] = {}
        self._into: dict[str, list[RawJoint]] = {}
        self._impossible: dict[str, tuple[Array, Array]] = {}
        self._massless: list[str] = []

    def _keep_joint(self, joint: RawJoint) -> None:
        self._joints.setdefault(joint.name, []).append(joint)
        self._into.setdefault(joint.child, []).append(joint)

    @abstractmethod
    def _mimic_element(self, raw: RawJoint) -> XmlElement | None:
        """What says that a joint follows another, which it names as ``joint``."""

    @abstractmethod
    def _mimic_numbers(
        self, place: FilePlace, element: XmlElement, unit: Decimal, own: Decimal
    ) -> tuple[float, float]:
        """Ratio and offset of a joint that follows another."""

    @abstractmethod
    def _inertial_frame(self, place: FilePlace, inertial: XmlElement, doubts: list[str], *, axes: bool) -> Placing:
        """Where an ``<inertial>`` has its centre of mass and, where these are asked for, its axes."""

    # --- which links and joints ---------------------------------------------------------------------------

    def _all(self) -> list[RawJoint]:
        """Every joint, parents before children."""
        for name in self._links:
            self._link(name)
        if not self._links:
            raise ModelFileError(f"{self._file}: has no <link>: a robot has one, its base{self._macros()}")
        after: dict[str, list[RawJoint]] = {}
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
                f"base: {self._one_base}{self._proposed()}"
            )
        ordered: list[RawJoint] = []
        todo = [roots[0]]
        while todo:
            name = todo.pop()
            if incoming := self._into.get(name):
                ordered += incoming
            todo += [joint.child for joint in reversed(after.get(name, []))]
        if len(ordered) < sum(map(len, self._joints.values())):
            reached = {roots[0], *(joint.child for joint in ordered)}
            lost = next(name for name in self._links if name not in reached)
            raise ModelFileError(f"{self._file}: link '{lost}' is its own ancestor: a loop without closure")
        return ordered

    def _macros(self) -> str:
        """A hint where links may be hidden in macros, or in other files."""
        return ""

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

    def _way(self, tip: str, *, propose: bool = True) -> list[RawJoint]:
        """The joints from the root to a link; refusals propose other paths unless they are tried just now."""
        if tip not in self._links:
            known = [name for name in self._links if name]
            hint = did_you_mean(tip, known) or f" (there are {', '.join(known) or 'none'})"
            hint += self._macros()
            raise ModelFileError(f"{self._file}: no link '{tip}'{hint}")
        way: list[RawJoint] = []
        names, passed, link = set[str](), {tip}, tip
        self._link(link)
        while joints := self._into.get(link, []):
            self._refuse_parents(link, joints, propose=propose)
            self._check(joints[0], propose=propose)
            if joints[0].parent in passed:
                raise ModelFileError(f"{self._file}: link '{link}' is its own ancestor: a loop without closure")
            if joints[0].name in names:
                self._only(joints[0].name)
            names.add(joints[0].name)
            way.append(joints[0])
            link = joints[0].parent
            passed.add(link)
        return way[::-1]

    def _refuse_parents(self, name: str, joints: list[RawJoint], *, propose: bool = True) -> None:
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

    def _check(self, joint: RawJoint, *, propose: bool = True) -> None:
        """Refuse a joint that connects nothing, has another's name, or moves as no model's does."""
        place = FilePlace(self._file, f"joint '{joint.name}'", joint.element.line)
        if not joint.name:
            raise FilePlace(self._file, "a joint", joint.element.line).error("has no name: give one")
        for what, name in (("parent", joint.parent), ("child", joint.child)):
            if not name:
                raise place.error(f"names no {what}: add <{what} link=...>")
            if name not in self._links:
                raise place.error(
                    f"names the link '{name}', which is not there{did_you_mean(name, self._links)}{self._macros()}"
                )
            self._link(name)
        if joint.type in self._floating and not self._reading.fix_base:
            raise place.error(f"is {joint.type}, {ON_ITS_BASE}{self._proposed() if propose else ''}")
        if joint.type not in self._types:
            hint = did_you_mean(joint.type, self._types)
            raise place.error(f"has the type '{joint.type}': give one of {', '.join(self._types)}{hint}")

    def _only(self, name: str) -> RawJoint:
        several = self._joints[name]
        if len(several) > 1:
            lines = ", ".join(str(joint.element.line) for joint in several)
            raise ModelFileError(f"{self._file}: {len(several)} joints are called '{name}' (lines {lines}): rename")
        return several[0]

    # --- what they say ------------------------------------------------------------------------------------

    def _number(
        self, place: FilePlace, element: XmlElement, key: str, default: str, unit: Decimal, *,
        infinite: bool = False,
    ) -> float:  # fmt: skip
        """A number of an element times a unit, in an attribute or in an element of its own."""
        read = number if infinite else finite
        if not self._by_elements:
            return read(place, element, key, default, unit)
        given = element.first(key) or XmlElement(key, {}, element.line)
        return read(place.inside(given), given, "", default, unit)

    def _body(self, name: str) -> Body:
        inertial = self._link(name).first("inertial")
        mass = inertial.first("mass") if inertial is not None else None
        if inertial is None or mass is None:
            if self._by_elements or inertial is not None:
                self._massless.append(name)
            return Body(name, inertia=() if inertial is None else self._inertia(name, inertial))
        place = FilePlace(self._file, f"link '{name}'", mass.line)
        value = finite(place, mass, "" if self._by_elements else "value", unit=self._units.mass)
        if value < 0.0:
            raise place.error(f"has a mass of {printed(value)} kg: it must not be below zero")
        if not value and not self._by_elements:
            self._massless.append(name)
        centre = self._inertial_frame(place, inertial, [], axes=False).shift
        return Body(name, value, centre, inertia=self._inertia(name, inertial))

    def _inertia(self, name: str, inertial: XmlElement) -> tuple[float, ...]:
        """Moments of inertia in the axes of a link, kg mm²; empty, and said, where no body has them."""
        element = inertial.first("inertia")
        if element is None:
            return ()
        place = FilePlace(self._file, f"link '{name}'", element.line)
        try:
            # statics needs none of it: what is wrong with it stops no import
            values = [self._number(place, element, key, "0", self._units.moments) for key in MOMENTS]
            R = turned(self._inertial_frame(place, inertial, self._notes.doubtful, axes=True).turns)
        except ModelFileError as error:
            self._notes.doubtful.append(f"moments of inertia, left out: {error}")
            return ()
        if not any(values):
            return ()
        own = inertia_matrix(values)
        if not is_of_a_body(values):
            nearest = nearest_of_a_body(own)
            self._impossible[name] = R @ own @ R.T, R @ nearest @ R.T
            if not repaired_moments((own, nearest), place, self._reading, self._notes):
                return ()
            own = nearest
        return tuple(inertia_values(R @ own @ R.T))

    def _mimic(self, raw: RawJoint) -> Mimic | None:
        """What a joint follows in the end, through all joints between, in mm and rad."""
        ratio, offset, joint, way = 1.0, 0.0, raw, [raw.name]
        place = FilePlace(self._file, f"joint '{raw.name}'", raw.element.line)
        while (element := self._mimic_element(joint)) is not None:
            name = element.attributes.get("joint", "")
            mimic_place = place.inside(element)
            if name in way:
                how = "itself" if len(way) == 1 else f"itself by way of {', '.join(way[1:])}"
                raise mimic_place.error(f"mimics {how}: name another joint")
            if name not in self._joints or not name:
                raise mimic_place.error(f"mimics '{name}', which is no joint{did_you_mean(name, self._joints)}")
            master = self._only(name)
            if master.type not in (*self._moves, "fixed"):
                raise mimic_place.error(
                    f"mimics '{name}', which is {master.type or 'of no type'}: name a joint that moves"
                )
            own = self._units.length if self._moves[joint.type] == "slides" else ONE
            unit = own / (self._units.length if self._moves.get(master.type) == "slides" else ONE)
            step, shift = self._mimic_numbers(mimic_place, element, unit, own)
            ratio, offset, joint = ratio * step, offset + ratio * shift, master
            way.append(name)
            if master.type == "fixed":
                break
        if joint is raw:
            return None
        if self._moves[raw.type] == "turns" and abs(offset) > WHOLE_TURN:
            self._notes.doubtful.append(
                f"joint '{raw.name}': the offset of its mimic, {printed(offset)} rad, is beyond a whole turn: "
                "is it in degrees?"
            )
        return Mimic(joint.name, ratio, offset)

    def _following(self, joint: RobotJoint) -> RobotJoint:
        """A joint; one that follows a fixed joint stands at the offset, and that is said."""
        if joint.mimic is None or self._only(joint.mimic.joint).type in self._moves:
            return joint
        position = f"{printed(joint.mimic.offset)} {'mm' if joint.kind == 'slides' else 'rad'}"
        self._notes.changed.append(
            f"joint '{joint.name}' mimics '{joint.mimic.joint}', which is fixed: it stands at {position}"
        )
        return joint.standing(joint.mimic.offset)
