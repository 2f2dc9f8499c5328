"""Numbers and vectors in robots' files: metres and radians as people write them, to mm and rad.

A URDF has them in attributes; an SDF file has them between tags, which the empty key stands for.
"""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Sequence
from decimal import Decimal

from vjm.io.bounded_xml import XmlElement
from vjm.io.errors import ModelFileError, printed
from vjm.io.robot import HUGE, Notes, Placing, Reading, Turns

_NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
_ODD = re.compile(r"[+-]?(?:inf|infinity|nan)", re.IGNORECASE)
UNEXPANDED = re.compile(r"\$[{(]")
WHOLE_TURN = 2.0 * math.pi
ONE, METRE = Decimal(1), Decimal(1000)
"""Units: of what has none, and of lengths in mm."""
XACRO = "it holds unexpanded xacro; expand it by --xacro, or with ROS' own command"


class FilePlace:
    """Where in a file something stands, for messages.

    Attributes:
        file: its name.
        owner: as people call what it belongs to, such as "joint 'elbow'".
        line: of the element; zero where it is not known.
    """

    def __init__(self, file: str, owner: str, line: int = 0) -> None:
        self.file, self.owner, self.line = file, owner, line

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
        return f"<{element.tag} {key}={_quoted(element, key)}>"
    return f"<{element.tag}>{reprlib.repr(element.text)[1:-1]}</{element.tag}>"


def _quoted(element: XmlElement, key: str) -> str:
    return '"' + reprlib.repr(element.attributes[key])[1:-1] + '"'


def length_vector(
    place: FilePlace, element: XmlElement, key: str, unit: Decimal = METRE
) -> tuple[float, float, float]:
    """A shift in mm, from metres or another unit; how long it may be, `vjm.io.frame_places` says."""
    x, y, z = vector(place, element, key, unit=unit)
    return x, y, z


def placing(
    place: FilePlace,
    origin: XmlElement | None,
    doubts: list[str],
    *,
    quaternions: bool,
    turned: bool = True,
    unit: Decimal = METRE,
) -> Placing:
    """Where an origin lies, mm and rad: roll, pitch, yaw about fixed axes, or a quaternion.

    Args:
        place: for messages.
        origin: the element; None is the identity.
        doubts: what is likely a mistake is added.
        quaternions: whether the file's version knows ``quat_xyzw``.
        turned: whether its rotation matters.
        unit: of the file's lengths, in mm.

    Raises:
        ModelFileError: numbers are missing or malformed.
    """
    if origin is None:
        return Placing()
    place = place.inside(origin)
    shift = length_vector(place, origin, "xyz", unit)
    if not turned:
        return Placing(shift)
    if quaternions and "quat_xyzw" in origin.attributes:
        if "rpy" in origin.attributes:
            raise place.error("has <origin> with rpy and quat_xyzw, two rotations: give one")
        x, y, z, w = vector(place, origin, "quat_xyzw", 4)
        if not any((x, y, z, w)):
            raise place.error("has a quaternion of length zero: give one of length 1")
        return Placing(shift, quaternion_turns(x, y, z, w))
    angles = vector(place, origin, "rpy")
    if max(map(abs, angles)) > WHOLE_TURN:
        doubts.append(
            f"{place.owner} (line {origin.line}): rpy {_quoted(origin, 'rpy')} is beyond a whole turn: "
            "is it in degrees? A URDF has rad"
        )
    return Placing(shift, rpy_turns(angles))


def rpy_turns(angles: list[float]) -> Turns:
    """The turns of roll, pitch and yaw about fixed axes, rad."""
    axes = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
    # within half a turn, whatever was written
    reduced = (
        math.atan2(math.sin(angle), math.cos(angle)) if abs(angle) > math.pi else angle for angle in angles[::-1]
    )
    return tuple((axis, angle) for axis, angle in zip(axes, reduced, strict=True) if angle)


def quaternion_turns(x: float, y: float, z: float, w: float) -> Turns:
    """The turn of a quaternion of any length above zero: axis, and angle in rad."""
    sine = math.hypot(x, y, z)
    angle = 2.0 * math.atan2(sine, abs(w))
    if not sine:
        return ()
    sign = 1.0 if w >= 0.0 else -1.0
    return (((sign * x / sine, sign * y / sine, sign * z / sine), angle),)


def in_order(
    limits: tuple[float, float], place: FilePlace, reading: Reading, notes: Notes, absent: Sequence[str] = (), *,
    slides: bool,
) -> tuple[float, float] | None:  # fmt: skip
    """Limits, mm or rad, the lower one first; None, and said, where they are reversed and so left out.

    Args:
        limits: as the file has them.
        place: of the joint.
        reading: whether what is reversed is repaired.
        notes: are added to.
        absent: names of those that the file does not give.
        slides: whether they are mm.

    Raises:
        ModelFileError: they are reversed, and that is to be refused, or one of them is not given.
    """
    low, high = limits
    if low <= high:
        return limits
    found = f"the limits {printed(low)} to {printed(high)} {'mm' if slides else 'rad'}, reversed"
    lacking = f" ({absent[0]} is not given, and so 0)" if absent else ""
    exchanged = notes.repaired(
        "refused" if absent else reading.repairs,
        place.error(f"has {found}{lacking}: give lower below upper"),
        doubtful=f"{place.owner} has {found}: taken as none",
        changed=f"{place.owner} has {found}: they were exchanged",
    )
    return (high, low) if exchanged else None


def usable_limits(
    low: float, high: float, name: str, *, slides: bool, doubts: list[str], changed: list[str]
) -> tuple[tuple[float, float] | None, float]:
    """Limits of a joint, mm or rad, as a model file takes them, and a coordinate inside: zero, else the middle.

    Args:
        low: lower limit, perhaps infinite.
        high: upper limit, not below it.
        name: of the joint, for what is said.
        slides: whether they are mm.
        doubts: what is likely a mistake is added.
        changed: what is changed is added.
    """
    unit = "mm" if slides else "rad"
    farthest = HUGE if slides else WHOLE_TURN
    if low == high or low >= HUGE or high <= -HUGE:
        how = f"equal ({printed(low)} {unit})" if low == high else f"beyond {printed(HUGE)} {unit}"
        doubts.append(f"joint '{name}': its limits are {how}: taken as none")
        return None, low if low == high and abs(low) <= farthest else 0.0
    if low <= -HUGE and high >= HUGE:
        if not (math.isinf(low) and math.isinf(high)):
            changed.append(f"joint '{name}': its limits are beyond {printed(HUGE)} {unit}: none")
        return None, 0.0
    if max(-low, high) > HUGE:
        changed.append(f"joint '{name}': its limit beyond {printed(HUGE)} {unit} became that")
    low, high = max(low, -HUGE), min(high, HUGE)
    if not slides and HUGE > max(abs(low), abs(high)) > 2.0 * WHOLE_TURN:
        doubts.append(
            f"joint '{name}': its limits {printed(low)} to {printed(high)} rad are more than two turns: "
            "are they in degrees?"
        )
    if low <= 0.0 <= high:
        return (low, high), 0.0
    middle = 0.5 * (low + high)
    return (low, high), middle if abs(middle) <= farthest else min(max(0.0, low), high)
