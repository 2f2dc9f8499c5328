"""What of a robot's file is read, what is omitted, and what is not understood, element by element."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

from vjm.io.bounded_xml import XmlElement
from vjm.io.robot import Notes
from vjm.io.urdf_values import UNEXPANDED

SHAPES = "shapes and meshes, which no command reads"
CONTROL = "what controllers and simulators take"
DRIVES = "forces, speeds, damping and friction of joints"
FIXED = "what a fixed joint has no use for"

XACRO = "xacro:"
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
        unused_when_fixed: what a fixed joint has no use for.
    """

    root: Collection[str]
    children: Mapping[str, Mapping[str, str]]
    attributes: Mapping[str, Mapping[str, str]]
    once: Collection[str]
    unused_when_fixed: Collection[str] = ("axis", "limit", "mimic")


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
        "inertia": dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), ""),
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
    """Say what of a file's root and of some of its links and joints is not read.

    Args:
        root: the robot.
        owners: its links and joints that are taken.
        notes: are added to.
        keys: the file's format.
        read: ``id`` of elements that were read, though what they stand in is not.
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
                if child.tag.startswith(XACRO):
                    macros.append(child.line)
            elif known:
                leave(known, f"<{child.tag}>", child.line)
                for inner in (one for one in _below(child) if id(one) not in read):
                    leave(known, f"<{inner.tag}>", inner.line)
            elif child.tag in keys.once and child.tag in seen:
                notes.doubtful.append(
                    f"line {child.line}: <{element.tag}> has another <{child.tag}>: the first one is read"
                )
            elif fixed and child.tag in keys.unused_when_fixed:
                leave(FIXED, f"<{child.tag}>", child.line)
            elif element.tag not in keys.root:
                inside = f"{element.tag}/{child.tag}"
                yield child, inside if inside in keys.attributes else child.tag
            seen.add(child.tag)

    todo = [(element, element.tag) for element in (root, *owners)]
    while todo:
        todo += look(*todo.pop())
    for why, things in left.items():
        notes.left_out.append(f"{why}: {', '.join(_counted(what, len(lines)) for what, lines in things.items())}")
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


def _counted(what: str, count: int) -> str:
    return f"{what} ({count})" if count > 1 else what


def _lines(lines: list[int]) -> str:
    lines = sorted(lines)
    more = f" and {len(lines) - MANY} more" if len(lines) > MANY else ""
    return f"line {', '.join(map(str, lines[:MANY]))}{more}"
