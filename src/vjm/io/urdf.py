"""URDF files of robots: read into a model document, and written from a chain.

A URDF knows links with masses and joints with axes, metres and radians. It knows no elasticity: the document that
comes of it has compliances to be filled in. Reading needs the optional extra ``vjm-stiffness[urdf]``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from vjm.io.errors import ModelFileError, did_you_mean
from vjm.rotations import Array, frame

Element = Any
"""Of a URDF, as the parser has it."""
METRE = 1000.0
TO_BE_FILLED_IN = 1e-8
"""rad/(N mm): a placeholder of the size of an industrial arm's gear; 1e-5 rad/(N m)."""
MOVING = ("revolute", "continuous", "prismatic")
ROUNDED = 9
"""Digits behind the point of mm and of unit vectors that are kept: URDFs print π/2 with few digits."""


@dataclass
class Imported:
    """A model document and what is to be said of it.

    Attributes:
        document: as TOML would give it, see `vjm.io.model_file.build_chain`.
        left_out: what the document does not have of the URDF.
        to_fill_in: joints whose compliance is a placeholder.
    """

    document: dict[str, Any]
    left_out: list[str] = field(default_factory=list)
    to_fill_in: list[str] = field(default_factory=list)


def import_urdf(path: str | Path, tip: str | None = None) -> Imported:
    """The model document of a URDF: the whole tree, or what leads from the root to one link.

    Masses of links on fixed joints are kept. Weights of links that are not on the way to the tip are left out.

    Args:
        path: of the file.
        tip: name of the link at the end.

    Raises:
        ModelFileError: no such file or link, no URDF, a loop, a link with two parents, or a floating joint.
        ImportError: the parser, an optional extra, is not installed.
    """
    file = Path(path)
    robot = _parsed(file)
    parent = _parents(robot, file.name)
    roots = [link.name for link in robot.links if link.name not in parent]
    if len(roots) != 1:
        raise ModelFileError(f"{file.name}: has {len(roots)} links without a parent; a robot has one, its base")
    links = [link.name for link in robot.links]
    if tip is not None and tip not in links:
        raise ModelFileError(
            f"{file.name}: no link '{tip}'{did_you_mean(tip, links) or ' (there are ' + ', '.join(links) + ')'}"
        )
    _refuse_loops(parent, file.name)
    return _Import(robot, parent, roots[0], tip, file.name).result()


def _parsed(file: Path) -> Element:
    try:
        from urdf_parser_py import urdf, xml_reflection
    except ImportError:
        raise ImportError("reading URDFs needs the optional extra: pip install 'vjm-stiffness[urdf]'") from None
    try:
        raw = file.read_bytes()
    except OSError as error:
        raise ModelFileError(f"{file}: cannot be read: {error.strerror}") from error
    # the parser prints what it does not know, such as transmissions, to the terminal
    before, xml_reflection.core.on_error = xml_reflection.core.on_error, lambda message: None
    try:
        return urdf.URDF.from_xml_string(raw)
    except Exception as error:  # the parser raises whatever its XML reader and its own assertions do
        why = " ".join(str(error).split()) or type(error).__name__
        raise ModelFileError(f"{file.name}: is no URDF that can be read: {why}") from error
    finally:
        xml_reflection.core.on_error = before


def _parents(robot: Element, file: str) -> dict[str, Any]:
    """The joint before each link."""
    parent: dict[str, Any] = {}
    links = {link.name for link in robot.links}
    for joint in robot.joints:
        for name in (joint.parent, joint.child):
            if name not in links:
                raise ModelFileError(f"{file}: joint '{joint.name}' names the link '{name}', which is not there")
        if joint.child in parent:
            raise ModelFileError(
                f"{file}: link '{joint.child}' has two parents, the joints '{parent[joint.child].name}' and "
                f"'{joint.name}': a loop; describe it as a manipulator with legs, see docs/manipulators.md"
            )
        if joint.type in ("floating", "planar"):
            raise ModelFileError(
                f"{file}: joint '{joint.name}' is {joint.type}: a machine stands on its base; make it fixed"
            )
        parent[joint.child] = joint
    return parent


def _refuse_loops(parent: dict[str, Any], file: str) -> None:
    for link in parent:
        at, steps = link, 0
        while at in parent:
            at, steps = parent[at].parent, steps + 1
            if steps > len(parent):
                raise ModelFileError(f"{file}: link '{link}' is its own ancestor: a loop without closure")


class _Import:
    """One import, link by link."""

    def __init__(self, robot: Element, parent: dict[str, Any], root: str, tip: str | None, file: str) -> None:
        self._robot, self._parent, self._root, self._tip, self._file = robot, parent, root, tip, file
        self._parts: list[dict[str, Any]] = []
        self._posture: dict[str, float] = {}
        self._names: set[str] = set()
        self._ends_with: dict[str, str] = {root: ""}
        self._labels: dict[str, str] = {}
        self._lost: list[str] = []
        self._fill: list[str] = []

    def result(self) -> Imported:
        wanted = self._way() if self._tip is not None else None
        children: dict[str, list[Any]] = {}
        for joint in self._robot.joints:
            children.setdefault(joint.parent, []).append(joint)
        self._weigh(self._root)
        todo = [self._root]
        while todo:
            link = todo.pop(0)
            for joint in children.get(link, []):
                if wanted is None or joint.child in wanted:
                    self._add(joint)
                    todo.insert(0, joint.child)
        if wanted is not None:
            off = [link.name for link in self._robot.links if link.name not in wanted and self._mass(link) > 0.0]
            if off:
                self._lost.append(
                    f"links that are not on the way to '{self._tip}', with their masses: {', '.join(off)}"
                )
        if any(link.visuals or link.collisions for link in self._robot.links):
            self._lost.append("shapes and meshes, which no command reads")
        return Imported(self._document(children), self._lost, self._fill)

    def _way(self) -> set[str]:
        links, at = set[str](), str(self._tip)
        while True:
            links.add(at)
            if at not in self._parent:
                return links
            at = self._parent[at].parent

    def _name(self, wanted: str) -> str:
        """A name as model files have it, not yet taken."""
        name = "".join(c if c.isalnum() or c in "_-" else "-" for c in wanted) or "part"
        name = name if name[0].isalpha() else f"p-{name}"
        while name in self._names:
            name += "-"
        self._names.add(name)
        return name

    def _after(self, link: str) -> dict[str, str]:
        behind = self._ends_with[link]
        last = self._parts[-1]["name"] if self._parts else ""
        return {} if behind == last else {"after": behind}

    def _add(self, joint: Element) -> None:
        T = _origin(joint.origin)
        behind = joint.parent
        fixed = joint.type not in MOVING
        if not np.allclose(T, np.eye(4), atol=1e-12) or fixed:
            table = {"kind": "link", "name": self._name(joint.name if fixed else f"{joint.name}-origin")}
            self._parts.append({**table, **self._after(behind), **_placed(T)})
            self._ends_with[joint.child] = table["name"]
        else:
            self._ends_with[joint.child] = self._ends_with[behind]
        if not fixed:
            self._add_moving(joint)
        self._weigh(joint.child)

    def _add_moving(self, joint: Element) -> None:
        name = self._name(joint.name)
        self._labels[joint.name] = name
        axis = np.array(joint.axis if joint.axis is not None else [1.0, 0.0, 0.0], dtype=float)
        length = float(np.linalg.norm(axis))
        if not length > 0.0:
            raise ModelFileError(
                f"{self._file}: joint '{joint.name}' has an axis of length zero: give its direction"
            )
        slides = joint.type == "prismatic"
        table: dict[str, Any] = {
            "kind": "actuated", "name": name, **self._after(joint.child), "axis": _axis(axis / length),
        }  # fmt: skip
        if slides:
            table["motion"] = "slides"
        if joint.mimic is not None:
            scale, unit = (
                1.0 if joint.mimic.multiplier is None else joint.mimic.multiplier,
                METRE if slides else 1.0,
            )
            if joint.mimic.joint == joint.name:
                raise ModelFileError(f"{self._file}: joint '{joint.name}' mimics itself: name another joint")
            other = next((j for j in self._robot.joints if j.name == joint.mimic.joint), None)
            if other is None or joint.mimic.joint not in self._labels:
                raise ModelFileError(
                    f"{self._file}: joint '{joint.name}' mimics '{joint.mimic.joint}', no moving joint before it"
                )
            ratio = scale * unit / (METRE if other.type == "prismatic" else 1.0)
            table |= {"kind": "coupled", "to": {self._labels[joint.mimic.joint]: ratio}, "coupling": "as bent"}
            if joint.mimic.offset:
                table["offset_mm" if slides else "offset_rad"] = joint.mimic.offset * unit
        else:
            table["compliance_mm_per_N" if slides else "compliance_rad_per_Nmm"] = (
                1e-4 if slides else TO_BE_FILLED_IN
            )
            self._fill.append(name)
            self._limit(joint, table, slides)
        self._parts.append(table)
        self._ends_with[joint.child] = name

    def _limit(self, joint: Element, table: dict[str, Any], slides: bool) -> None:
        low = high = 0.0
        if joint.limit is not None and joint.type != "continuous":
            unit = METRE if slides else 1.0
            low, high = float(joint.limit.lower or 0.0) * unit, float(joint.limit.upper or 0.0) * unit
            if low < high:
                table["limits_mm" if slides else "limits_rad"] = [low, high]
        inside = low >= high or low <= 0.0 <= high
        self._posture[table["name"]] = 0.0 if inside else 0.5 * (low + high)

    def _weigh(self, link: str) -> None:
        found = next(one for one in self._robot.links if one.name == link)
        if not self._mass(found) > 0.0:
            return
        if self._ends_with[link] == "":
            return  # what stands on the base moves nothing
        centre = _origin(found.inertial.origin)[:3, 3]
        table: dict[str, Any] = {"kind": "payload", "name": self._name(f"{link}-mass"), **self._after(link)}
        table |= {"mass_kg": self._mass(found), "centre_of_mass_mm": _numbers(centre)}
        self._parts.append(table)
        self._ends_with[link] = table["name"]

    @staticmethod
    def _mass(link: Element) -> float:
        return 0.0 if link.inertial is None else float(link.inertial.mass or 0.0)

    def _document(self, children: dict[str, list[Any]]) -> dict[str, Any]:
        name = self._name(self._robot.name or "robot")
        document: dict[str, Any] = {
            "format": 1,
            "name": name,
            "title": f"{self._robot.name}, imported from {self._file}",
            "source": f"{self._file}; compliances are placeholders, to be filled in",
            "units": {"length": "mm", "force": "N", "angle": "rad"},
            "parts": self._parts,
            "postures": {"home": self._posture},
        }
        if self._tip is None:
            tips = [link.name for link in self._robot.links if not children.get(link.name)]
            ends = {self._name(tip): self._ends_with[tip] for tip in tips if self._ends_with.get(tip)}
            if len(ends) > 1:
                document["ends"] = ends
        return document


def _origin(origin: Element) -> Array:
    """Frame ``(4, 4)`` of a URDF's origin, mm: roll, pitch, yaw about fixed axes."""
    if origin is None:
        return np.eye(4)
    roll, pitch, yaw = (float(v) for v in (origin.rpy or (0.0, 0.0, 0.0)))
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    R = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return frame(R, METRE * np.array([float(v) for v in (origin.xyz or (0.0, 0.0, 0.0))]))


def _placed(T: Array) -> dict[str, Any]:
    """Keys of a link's translation and turns."""
    table: dict[str, Any] = {"translation_mm": _numbers(T[:3, 3])}
    # by a quaternion: exact near a half turn too, which URDFs have as π of few digits
    vector = Rotation.from_matrix(T[:3, :3]).as_rotvec()
    angle = float(np.linalg.norm(vector))
    if angle > 1e-12:
        table["turns"] = [{"turn_about": _axis(vector / angle), "angle_deg": math.degrees(angle)}]
    return table


def _axis(axis: Array) -> str | list[float]:
    for name, unit in zip("xyz", np.eye(3), strict=True):
        if np.array_equal(axis, unit):
            return name
    return [float(v) for v in axis / np.linalg.norm(axis)]


def _numbers(vector: Array) -> list[float]:
    return [round(float(v), ROUNDED) + 0.0 for v in vector]
