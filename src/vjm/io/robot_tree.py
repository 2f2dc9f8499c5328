"""What URDF and SDF files have in common: links and joints by name, and how they hang on one another."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal

from vjm.io.bounded_xml import XmlElement
from vjm.io.errors import ModelFileError, did_you_mean, printed
from vjm.io.inertia import NO_BODYS, inertia_matrix, inertia_values, is_of_a_body, nearest_of_a_body, said_repair
from vjm.io.robot import ON_ITS_BASE, Kind, Mimic, Notes, Reading, RobotJoint
from vjm.io.urdf_values import ONE, WHOLE_TURN, FilePlace
from vjm.rotations import Array

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
    """

    _moves: Mapping[str, Kind]
    _types: Sequence[str]
    _floating: Sequence[str] = ()
    _one_base = "connect them"

    def __init__(self, file: str, reading: Reading, notes: Notes) -> None:
        self._file, self._reading, self._notes = file, reading, notes
        self._units = reading.units
        self._links: dict[str, list[XmlElement]] = {}
        self._joints: dict[str, list[RawJoint]] = {}
        self._into: dict[str, list[RawJoint]] = {}
        self._impossible: dict[str, tuple[Array, Array]] = {}

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
        """Ratio and offset of a joint that follows another.

        Args:
            place: for messages.
            element: that says so.
            unit: of the ratio, in mm and rad.
            own: the same for the offset.
        """

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
        found: list[RawJoint] = []
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

    def _moments(self, name: str, place: FilePlace, values: Sequence[float], R: Array) -> tuple[float, ...]:
        """Moments of inertia in the axes of a link, kg mm²; empty, and said, where no body has them.

        Args:
            name: of the link.
            place: of them.
            values: ``ixx, iyy, izz, ixy, ixz, iyz`` in axes of their own, kg mm².
            R: ``(3, 3)``, these axes in those of the link.

        Raises:
            ModelFileError: no body has them, and that is to be refused.
        """
        if not any(values):
            return ()
        own = inertia_matrix(values)
        if not is_of_a_body(values):
            nearest = nearest_of_a_body(own)
            self._impossible[name] = R @ own @ R.T, R @ nearest @ R.T
            if not self._notes.repaired(
                self._reading.repairs,
                place.error(f"has {NO_BODYS}: correct them, or say `validate import` without --strict"),
                doubtful=f"{place.owner} has {NO_BODYS}: left out",
                changed=f"{place.owner}: {said_repair(own, nearest)}",
            ):
                return ()
            own = nearest
        return tuple(inertia_values(R @ own @ R.T))

    def _mimic(self, raw: RawJoint) -> Mimic | None:
        """What a joint follows in the end, through all joints between, in mm and rad."""
        ratio, offset, at, way = 1.0, 0.0, raw, [raw.name]
        place = FilePlace(self._file, f"joint '{raw.name}'", raw.element.line)
        while (element := self._mimic_element(at)) is not None:
            name = element.attributes.get("joint", "")
            here = place.inside(element)
            if name in way:
                how = "itself" if len(way) == 1 else f"itself by way of {', '.join(way[1:])}"
                raise here.error(f"mimics {how}: name another joint")
            if name not in self._joints or not name:
                raise here.error(f"mimics '{name}', which is no joint{did_you_mean(name, self._joints)}")
            master = self._only(name)
            if master.type not in (*self._moves, "fixed"):
                raise here.error(
                    f"mimics '{name}', which is {master.type or 'of no type'}: name a joint that moves"
                )
            own = self._units.length if self._moves[at.type] == "slides" else ONE
            unit = own / (self._units.length if self._moves.get(master.type) == "slides" else ONE)
            step, shift = self._mimic_numbers(here, element, unit, own)
            ratio, offset, at = ratio * step, offset + ratio * shift, master
            way.append(name)
            if master.type == "fixed":
                break
        if at is raw:
            return None
        if self._moves[raw.type] == "turns" and abs(offset) > WHOLE_TURN:
            self._notes.doubtful.append(
                f"joint '{raw.name}': the offset of its mimic, {printed(offset)} rad, is beyond a whole turn: "
                "is it in degrees?"
            )
        return Mimic(at.name, ratio, offset)

    def _following(self, joint: RobotJoint) -> RobotJoint:
        """A joint; one that follows a fixed joint stands at the offset, and that is said."""
        if joint.mimic is None or self._only(joint.mimic.joint).type in self._moves:
            return joint
        at = f"{printed(joint.mimic.offset)} {'mm' if joint.kind == 'slides' else 'rad'}"
        self._notes.changed.append(
            f"joint '{joint.name}' mimics '{joint.mimic.joint}', which is fixed: it stands at {at}"
        )
        return joint.standing(joint.mimic.offset)
