"""Calibrations of Universal Robots' arms: the kinematics of their ROS driver, and the controller's own files.

``calibration.yaml``, which ``ur_calibration`` writes, and ``default_kinematics.yaml`` of ur_description have the
frame of each joint in the one before it, in m and rad. ``calibration.conf`` of the controller has what is added to
the nominal table of Denavit and Hartenberg, distal convention. ``urcontrol.conf`` has that table itself.

The nominal tables are from Universal Robots, "DH parameters for calculations of kinematics and dynamics".
"""

from __future__ import annotations

import configparser
import hashlib
import math
import re
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np

from vjm.io.dh_table import (
    ROUNDING,
    DhRow,
    DhTable,
    SerialChain,
    dh_table,
    serial_robot,
    table_robot,
    table_text,
)
from vjm.io.errors import ModelFileError, did_you_mean, naming, printed
from vjm.io.robot import Notes, Placing, Reading, Robot, triple
from vjm.io.robot_text import written
from vjm.io.robot_xml import rpy_turns
from vjm.rotations import roll_pitch_yaw

LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
NUMBERS = ("x", "y", "z", "roll", "pitch", "yaw")
DELTAS = ("theta", "a", "d", "alpha")
NOMINAL: dict[str, tuple[float, float, float, float, float, float]] = {
    "ur3": (-0.24365, -0.21325, 0.1519, 0.11235, 0.08535, 0.0819),
    "ur5": (-0.425, -0.39225, 0.089159, 0.10915, 0.09465, 0.0823),
    "ur10": (-0.612, -0.5723, 0.1273, 0.163941, 0.1157, 0.0922),
    "ur3e": (-0.24355, -0.2132, 0.15185, 0.13105, 0.08535, 0.0921),
    "ur5e": (-0.425, -0.3922, 0.1625, 0.1333, 0.0997, 0.0996),
    "ur10e": (-0.6127, -0.57155, 0.1807, 0.17415, 0.11985, 0.11655),
    "ur16e": (-0.4784, -0.36, 0.1807, 0.17415, 0.11985, 0.11655),
    "ur20": (-0.862, -0.7287, 0.2363, 0.201, 0.1593, 0.1543),
    "ur30": (-0.637, -0.5037, 0.2363, 0.201, 0.1593, 0.1543),
}
"""Lengths in m by type: a2, a3, d1, d4, d5, d6. All others are zero."""
ALPHA = (0.5 * math.pi, 0.0, 0.0, 0.5 * math.pi, -0.5 * math.pi, 0.0)
_KEY = re.compile(r"( *)([\w/*.-]+)[ \t]*:(?:[ \t]+(.*))?$")


def nominal_table(kind: str) -> DhTable:
    """The nominal table of a type of arm, mm and rad.

    Raises:
        ValueError: there is no such type.

    Example:
        >>> [row.d for row in nominal_table("ur5e").rows]
        [162.5, 0.0, 0.0, 133.3, 99.7, 99.6]
    """
    if kind.lower() not in NOMINAL:
        hint = did_you_mean(kind.lower(), NOMINAL)
        raise ValueError(f"no type '{kind}' is known{hint}; there are {', '.join(NOMINAL)}")
    a2, a3, d1, d4, d5, d6 = NOMINAL[kind.lower()]
    return _table(kind.lower(), [0.0] * 6, [0.0, a2, a3, 0.0, 0.0, 0.0], [d1, 0.0, 0.0, d4, d5, d6], list(ALPHA))


def _table(name: str, theta: list[float], a: list[float], d: list[float], alpha: list[float]) -> DhTable:
    rows = (
        DhRow(f"{joint}_joint", theta=th, a=_mm(a_i), d=_mm(d_i), alpha=al)
        for joint, th, a_i, d_i, al in zip(JOINTS, theta, a, d, alpha, strict=True)
    )
    return DhTable(name, "dh", tuple(rows))


def _mm(metres: float) -> float:
    return float(Decimal(repr(metres)).scaleb(3))


# --- reading --------------------------------------------------------------------------------------------------


def kinematics_robot(path: Path, reading: Reading) -> Robot:
    """The robot of ``calibration.yaml`` or ``default_kinematics.yaml``.

    Raises:
        ModelFileError: it cannot be read, or a frame or a number is missing.
    """
    file, notes = path.name, Notes()
    content = read_nested(table_text(path), file)
    kinematics = content.get("kinematics")
    if not isinstance(kinematics, dict):
        raise ModelFileError(
            f"{file}: has no 'kinematics' with the frames {', '.join(LINKS)}: is it of another kind?"
        )
    steps = [_frame(kinematics, link, file) for link in LINKS]
    notes.left_out += [f"'{key}', which is not understood" for key in content if key != "kinematics"]
    for key, value in kinematics.items():
        if key == "hash":
            notes.left_out.append(f"the hash of the controller's calibration, {value}")
        elif key not in LINKS:
            notes.left_out.append(f"'{key}' in kinematics, which is not understood")
    notes.doubtful.append("the file has no limits of joints: none are taken")
    joints = [DhRow(f"{joint}_joint") for joint in JOINTS]
    return serial_robot(file.split(".")[0], joints, [*steps, Placing()], file, reading, notes)


def _frame(kinematics: dict[str, Nested], link: str, file: str) -> Placing:
    table = kinematics.get(link)
    if not isinstance(table, dict):
        raise ModelFileError(f"{file}: kinematics has no '{link}': give its {', '.join(NUMBERS)}")
    if unknown := [key for key in table if key not in NUMBERS]:
        raise ModelFileError(f"{file}: {link} has the unknown key '{unknown[0]}'; known are {', '.join(NUMBERS)}")
    numbers = []
    for key in NUMBERS:
        text = table.get(key)
        if text is None or isinstance(text, dict):
            raise ModelFileError(f"{file}: {link} has no {key}: add it")
        numbers.append(_number(text, f"{file}: {link}: {key}", 0 if key in NUMBERS[3:] else 3))
    return Placing(triple(numbers[:3]), rpy_turns(numbers[3:]))


def _number(text: str, where: str, power: int = 0) -> float:
    try:
        value = Decimal(text.strip())
    except InvalidOperation:
        value = Decimal("nan")
    if not value.is_finite():
        raise ModelFileError(f"{where} is {text.strip()!r}, which is no number: write one with a decimal point")
    return float(value.scaleb(power))


Nested = str | dict[str, "Nested"]
"""What of YAML such files have: texts, and tables of them."""


def read_nested(text: str, file: str) -> dict[str, Nested]:
    r"""Tables of tables by their indentation, as these files have them: a small part of YAML.

    Raises:
        ModelFileError: there is more of YAML in it, with the line.

    Example:
        >>> read_nested("kinematics:\n  shoulder: {x: 0, y: 1e-3}\n  hash: calib_1\n", "a.yaml")
        {'kinematics': {'shoulder': {'x': '0', 'y': '1e-3'}, 'hash': 'calib_1'}}
    """
    root: dict[str, Nested] = {}
    # the tables that are open, with the indentation of the keys that opened them
    tables = [(-1, root)]
    for number, line in enumerate(text.splitlines(), start=1):
        where = f"{file}: line {number}"
        plain = re.sub(r"(^|\s)#.*", "", line).rstrip()
        if not plain.strip() or plain.strip() == "---":
            continue
        match = _KEY.fullmatch(plain)
        if match is None:
            said = repr(plain.strip()[:40])
            raise ModelFileError(f"{where}: {said} is not read: write 'key: value', indented by blanks")
        indent, key, value = len(match[1]), match[2], (match[3] or "").strip()
        while indent <= tables[-1][0]:
            tables.pop()
        table = tables[-1][1]
        if key in table:
            raise ModelFileError(f"{where}: '{key}' stands twice: take one out")
        if value and not value.startswith("{"):
            table[key] = value.strip("'\"")
            continue
        inner = _inline(value, where) if value else {}
        table[key] = inner
        tables.append((indent, inner))
    return root


def _inline(value: str, where: str) -> dict[str, Nested]:
    table: dict[str, Nested] = {}
    if not value.endswith("}"):
        raise ModelFileError(f"{where}: a table in braces ends on another line: write it on one")
    for piece in value[1:-1].split(","):
        key, colon, one = piece.partition(":")
        if not colon or not key.strip() or not one.strip():
            raise ModelFileError(f"{where}: {piece.strip()!r} is not read: write 'key: value'")
        table[key.strip()] = one.strip()
    return table


def controller_robot(path: Path, reading: Reading, kind: str = "") -> Robot:
    """The robot of a controller's ``calibration.conf``, of a type such as ``ur5e``, or ``urcontrol.conf``.

    Raises:
        ModelFileError: it cannot be read, has neither offsets nor a table, or its type is not known.
    """
    file, notes = path.name, Notes()
    parser = configparser.ConfigParser(interpolation=None, strict=False, inline_comment_prefixes=("#", ";"))
    try:
        parser.read_string(table_text(path))
    except configparser.Error as error:
        raise ModelFileError(f"{file}: {error.message}") from error
    has_table, has_deltas = parser.has_section("DH"), parser.has_section("mounting")
    has_deltas = has_deltas and any(parser.has_option("mounting", f"delta_{key}") for key in DELTAS)
    if not has_table and not has_deltas:
        raise ModelFileError(
            f"{file}: has neither [mounting] with delta_theta, delta_a, delta_d and delta_alpha, nor [DH] with a, "
            "d and alpha: give the controller's calibration.conf or urcontrol.conf"
        )
    if has_table and kind:
        raise ModelFileError(f"{file}: has a table of its own in [DH]: leave out --ur-type")
    if not has_table and not kind:
        raise ModelFileError(
            f"{file}: has offsets alone, which are added to the nominal table: name the arm's type, --ur-type ur5e"
        )
    if has_table:
        table = _table(file.split(".")[0], [0.0] * 6, *(_six(parser, "DH", key, file) for key in DELTAS[1:]))
    else:
        with naming(f"{file}: --ur-type"):
            table = nominal_table(kind)
    if has_deltas:
        deltas = np.array([_six(parser, "mounting", f"delta_{key}", file) for key in DELTAS])
        nominal = np.array([(row.theta, row.a / 1e3, row.d / 1e3, row.alpha) for row in table.rows]).T
        table = _table(table.name, *(nominal + deltas).tolist())
    else:
        notes.doubtful.append("the file has no [mounting]: this is the nominal arm")
    if parser.get("mounting", "calibration_status", fallback="").strip().startswith("0"):
        notes.doubtful.append("calibration_status = 0: the controller says that the arm is not calibrated")
    read = {("DH", key) for key in ("a", "d", "alpha")} | {("mounting", f"delta_{key}") for key in DELTAS}
    for section in parser.sections():
        # a controller's file has hundreds of keys of other things
        own = [key for key in parser.options(section) if (section, key) not in read]
        if own:
            notes.left_out.append(f"[{section}] {', '.join(own)}")
    notes.doubtful.append("limits of joints are not read: none are taken")
    return table_robot(table, file, reading, notes)


def _six(parser: configparser.ConfigParser, section: str, key: str, file: str) -> list[float]:
    where = f"{file}: [{section}] {key}"
    text = parser.get(section, key, fallback=None)
    if text is None:
        raise ModelFileError(f"{where} is missing: add it")
    text = text.strip()
    words = text[1:-1].split(",")
    if not (text.startswith("[") and text.endswith("]")) or len(words) != 6:
        raise ModelFileError(f"{where} must be a list of six numbers, [.., .., .., .., .., ..]")
    return [_number(word, where) for word in words]


# --- writing --------------------------------------------------------------------------------------------------


def kinematics_text(chain: SerialChain) -> str:
    """A chain of six joints that turn as ``calibration.yaml`` of Universal Robots' driver has it, m and rad.

    Frames stand where ``ur_calibration`` puts them: nearly parallel axes have no offset between them.

    Raises:
        ValueError: the chain has other joints.
    """
    odd = [joint.name for joint in chain.joints if joint.slides]
    if len(chain.joints) != len(LINKS) or odd:
        has = f"{len(chain.joints)} joints" + (f", of which {', '.join(odd)} slide" if odd else "")
        raise ValueError(f"kinematics of Universal Robots have six joints that turn, and this machine has {has}")
    table, lines = dh_table(chain, "mdh"), list[str]()
    before, size = table.base.frame, sum(abs(row.a) + abs(row.d) for row in table.rows)
    for link, row in zip(LINKS, table.rows, strict=True):
        to_axis, along = (step.frame for step in DhTable("", "mdh", (row,)).steps())
        T = before @ to_axis @ along
        place = [float(v) if abs(v) > ROUNDING * size else 0.0 for v in T[:3, 3]]
        angles = [angle if abs(angle) > ROUNDING else 0.0 for angle in roll_pitch_yaw(T[:3, :3])]
        texts = [*(written(v, -3) for v in place), *map(written, angles)]
        lines += [f"  {link}:", *(f"    {key}: {text}" for key, text in zip(NUMBERS, texts, strict=True))]
        before = np.eye(4)
    body = "\n".join(lines)
    digest = hashlib.sha256(body.encode()).hexdigest()[:16]
    return f"kinematics:\n{body}\n  hash: vjm_{digest}\n"


def not_held(chain: SerialChain) -> list[str]:
    """What the kinematics of Universal Robots' driver do not hold of a chain, a line for each kind."""
    lines = ["the controller's hash: the driver will say that the one written here is another"]
    tool = dh_table(chain, "mdh").tool
    if not tool.is_identity:
        where = ", ".join(printed(v) for v in tool.shift)
        angles = ", ".join(printed(v) for v in reversed(roll_pitch_yaw(tool.frame[:3, :3])))
        lines.append(f"the tool behind wrist_3, at {where} mm, turned by {angles} rad about z, y, x")
    if limited := [joint.name for joint in chain.joints if joint.limits is not None]:
        lines.append(f"the limits of {', '.join(limited)}")
    return lines
