"""A model document of a robot's rigid description: parts, couplings, masses, and a compliance to be filled in."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vjm.io.checks import PlacedPiece, far_steps
from vjm.io.errors import ModelFileError, printed
from vjm.io.fields import LONGEST_MM
from vjm.io.files import toml_text
from vjm.io.joint_tables import HEAVIEST
from vjm.io.robot import Mimic, Notes, Robot, RobotJoint, axis_key, new_name, unit_axis
from vjm.rotations import Array

PLACEHOLDER = {"turns": 1e-8, "slides": 1e-4}
"""rad/(N mm) and mm/N, of the size of an industrial arm's gear (1e-5 rad/(N m)) and of a ball screw."""
COMPLIANCE = {"turns": "compliance_rad_per_Nmm", "slides": "compliance_mm_per_N"}
STIFFNESS = {"turns": "stiffness_Nmm_per_rad", "slides": "stiffness_N_per_mm"}
SPRUNG = set(STIFFNESS.values())
REST = {"turns": "rest_rad", "slides": "rest_mm"}
LIMITS = {"turns": "limits_rad", "slides": "limits_mm"}
ROTOR = {"turns": "rotor_kg_mm2", "slides": "rotor_kg"}
HOME = "home"
"""The posture of the document."""
HEAVY = 1e4
"""kg, above which a link's mass is doubted."""
OFFSET = {"turns": "offset_rad", "slides": "offset_mm"}


@dataclass
class Imported:
    """A model document and what is to be said of it.

    Attributes:
        document: as TOML would give it, see `vjm.io.model_file.build_chain`.
        notes: what the document does not have of the description, has otherwise, or what is doubtful in it.
        to_fill_in: joints whose compliance is a placeholder.
        ends: links at the ends of the tree, where it has several.
        joints: names of the moving joints in the document by those in the description.
        file: name of the description, for messages.
        impossible: moments of inertia that no body has and the nearest ones, see `Robot`, by part of the document.
    """

    document: dict[str, Any]
    notes: Notes = field(default_factory=Notes)
    to_fill_in: list[str] = field(default_factory=list)
    ends: list[str] = field(default_factory=list)
    joints: dict[str, str] = field(default_factory=dict)
    file: str = ""
    impossible: dict[str, tuple[Array, Array]] = field(default_factory=dict)

    @property
    def left_out(self) -> list[str]:
        """What the document does not have of the description."""
        return self.notes.left_out

    @property
    def unfilled(self) -> str:
        """Of the document's source, where compliances are placeholders."""
        return "; compliances are placeholders, to be filled in" if self.to_fill_in else ""

    def text(self) -> str:
        """The model file, with what is to be said of it as comments at its head."""
        head = "".join(f"# {line}\n" for line in self.notes.lines())
        return f"{head}\n{toml_text(self.document)}" if head else toml_text(self.document)


def robot_document(robot: Robot, tip: str | None = None) -> Imported:
    """The model document of a robot: its whole tree, or the way to a link to which it was restricted.

    Raises:
        ModelFileError: no joint of it moves, or it is larger or heavier than any machine.
    """
    if all(joint.kind == "fixed" for joint in robot.joints):
        where = f" on the way to '{tip}'" if tip is not None else ""
        raise ModelFileError(f"{robot.file}: no joint moves{where}: there is nothing that deflects")
    _refuse_implausible(robot)
    return _Writer(robot, tip).imported()


def _refuse_implausible(robot: Robot) -> None:
    """Refuse what no machine weighs or how far apart no joints are; doubt masses that lie as far away."""
    for body in robot.bodies.values():
        said = f"link '{body.name}' has a mass of {printed(body.mass)} kg, above"
        if body.mass > HEAVIEST:
            raise ModelFileError(f"{robot.file}: {said} {printed(HEAVIEST)} kg: is it in g?")
        if body.mass > HEAVY:
            robot.notes.doubtful.append(f"{said} {printed(HEAVY)} kg: is it in g?")
    # a robot's links have other names than its joints: those are told from them by a sign that no name begins with
    steps, places = list[PlacedPiece](), {robot.root: np.eye(4)}
    for joint in robot.joints:
        T = joint.placing.frame
        axis = unit_axis(np.array(joint.axis)) if joint.kind == "turns" else None
        before = f"\0{joint.parent}" if joint.parent != robot.root else ""
        steps.append(PlacedPiece(joint.name, before, T))
        steps.append(PlacedPiece(f"\0{joint.child}", joint.name, np.eye(4), joint.kind != "fixed", axis))
        places[joint.child] = places[joint.parent] @ T
    beyond = f"beyond {printed(LONGEST_MM / 1e3)} m: is it in mm? Give metres"
    for name, length in far_steps(steps):
        raise ModelFileError(
            f"{robot.file}: the origin of joint '{name}' is {printed(length / 1e3)} m away, {beyond}"
        )
    for body in (body for body in robot.bodies.values() if body.mass):
        if np.abs(body.centre).max() > LONGEST_MM:
            away = printed(float(np.linalg.norm(body.centre)) / 1e3)
            raise ModelFileError(
                f"{robot.file}: the centre of mass of link '{body.name}' is {away} m away, {beyond}"
            )
        far = float(np.linalg.norm((places[body.name] @ [*body.centre, 1.0])[:3]))
        if far > LONGEST_MM:
            robot.notes.doubtful.append(
                f"the centre of mass of link '{body.name}' lies {printed(far / 1e3, 4)} m from the base: do the "
                "offsets lead back?"
            )


class Labels:
    """Names as model files have them: ASCII letters, digits, '_' and '-', each once."""

    def __init__(self, notes: Notes) -> None:
        self._notes = notes
        self._taken: set[str] = set()

    def new(self, wanted: str, what: str = "") -> str:
        """A name not yet taken; where ``what`` says whose it is, a change is noted."""
        plain = "".join(c for c in unicodedata.normalize("NFKD", wanted) if not unicodedata.combining(c))
        name = "".join(_letter(c) for c in plain) or "part"
        name = new_name(name if name[0].isalpha() else f"p-{name}", self._taken)
        if what and name != wanted:
            self._notes.changed.append(f"{what} '{wanted}' is called '{name}'")
        return name


def _letter(c: str) -> str:
    if c.isascii():
        return c if c.isalnum() or c in "_-" else "-"
    return f"u{ord(c):x}" if c.isalnum() else "-"


class _Writer:
    """One document, joint by joint."""

    def __init__(self, robot: Robot, tip: str | None) -> None:
        self._robot, self._tip, self._notes = robot, tip, robot.notes
        self._parts: list[dict[str, Any]] = []
        self._posture: dict[str, float] = {}
        self._ends_with: dict[str, str] = {robot.root: ""}
        self._carried_by: dict[str, str] = {robot.root: ""}
        self._names = Labels(robot.notes)
        self._title = Labels(robot.notes).new(robot.name, "the robot")
        # joints and ends keep their names, whatever else wants them
        moving = [joint for joint in robot.joints if joint.kind != "fixed"]
        self._label = {
            joint.name: self._names.new(joint.name, "joint") for joint in (*robot.masters.values(), *moving)
        }
        parents = {joint.parent for joint in robot.joints}
        restricted = tip is not None and not robot.closures
        tips = [] if restricted else [joint.child for joint in robot.joints if joint.child not in parents]
        self._tips = {name: self._names.new(name, "link") for name in tips} if len(tips) > 1 else {}
        self._leads: set[str] = set()
        self._couplings: list[dict[str, Any]] = []
        self._fill: list[str] = []
        self._impossible: dict[str, tuple[Array, Array]] = {}

    def imported(self) -> Imported:
        pending = list(self._robot.joints)
        while pending:
            reached = [joint for joint in pending if joint.parent in self._ends_with]
            leads = {None, *self._leads}
            ready = next((j for j in reached if j.passive or (j.mimic and j.mimic.joint) in leads), None)
            if ready is None:
                self._lead(reached[0])
                continue
            pending.remove(ready)
            self._add(ready)
        self._say_massless()
        base = self._robot.bodies[self._robot.root]
        if base.mass:
            self._notes.left_out.append(
                f"the mass of '{base.name}', {printed(base.mass)} kg: the base moves nothing"
            )
        return self._with_ends()

    def _lead(self, joint: RobotJoint) -> None:
        """Put the joint that another follows at the base, where it moves nothing itself."""
        assert joint.mimic is not None
        name = joint.mimic.joint
        label = self._label[name]
        master = self._robot.masters.get(name)
        if master is not None:
            how = f"is not on the way to '{self._tip}': it stands at the base and moves nothing else"
        else:
            master = next(one for one in self._robot.joints if one.name == name)
            how = f"comes behind it: it stands at the base, and '{label}-follows' in its place"
        self._notes.changed.append(f"joint '{name}', which joint '{joint.name}' mimics, {how}")
        self._parts.append({"kind": "", "name": label, **self._after(""), **self._held(master, label)})
        self._leads.add(name)

    def _after(self, behind: str) -> dict[str, str]:
        last = self._parts[-1]["name"] if self._parts else ""
        return {} if behind == last else {"after": behind}

    def _add(self, joint: RobotJoint) -> None:
        behind = self._ends_with[joint.parent]
        if joint.kind == "fixed" or not joint.placing.is_identity:
            name = self._names.new(joint.name if joint.kind == "fixed" else f"{joint.name}-origin")
            self._parts.append({"kind": "link", "name": name, **self._after(behind), **joint.placing.keys()})
            behind = name
        if joint.kind == "fixed":
            self._carried_by[joint.child] = self._carried_by[joint.parent]
        else:
            behind = self._add_moving(joint, behind)
            self._carried_by[joint.child] = joint.child
        self._ends_with[joint.child] = behind
        self._weigh(joint.child)

    def _add_moving(self, joint: RobotJoint, behind: str) -> str:
        name, mimic = self._label[joint.name], joint.mimic
        if joint.passive and not joint.stiffness:
            self._posture[name] = joint.home
            free = {"kind": "joint", "name": name, **self._after(behind), **self._moves(joint)}
            self._parts.append(free | self._limits(joint) | self._rotor(joint))
            if mimic is not None:
                # neither has a drive: what holds both is a transmission, whichever comes first
                terms = {name: 1.0, self._label[mimic.joint]: -mimic.ratio}
                self._couplings.append(
                    {
                        "name": self._names.new(f"{name}-coupling"),
                        "terms": [{"joint": one, "weight": weight} for one, weight in terms.items()],
                        "total": mimic.offset,
                    }
                )
            return name
        if joint.name in self._leads:
            # it stands at the base already with its rotor, for those before it that follow it
            name, mimic = self._names.new(f"{name}-follows"), Mimic(joint.name, 1.0, 0.0)
            joint = replace(joint, rotor=0.0)
        table: dict[str, Any] = {"kind": "", "name": name, **self._after(behind)}
        if mimic is None:
            table |= self._held(joint, name)
            self._leads.add(joint.name)
        else:
            table |= {"kind": "coupled", **self._moves(joint)}
            table |= {"to": {self._label[mimic.joint]: mimic.ratio}, "coupling": "as deflected"}
            self._notes.changed.append(
                f"joint '{joint.name}' follows '{mimic.joint}' with what its spring adds, as by a belt; "
                'write coupling = "as commanded" where a controller leads it'
            )
            if mimic.offset:
                table[OFFSET[joint.kind]] = mimic.offset
            table |= self._limits(joint) | self._rotor(joint)
        self._parts.append(table)
        return name

    def _held(self, joint: RobotJoint, label: str) -> dict[str, Any]:
        """Keys of a joint with a drive or a spring; its posture and what is to be filled in are kept."""
        self._posture[label] = joint.home
        own = {COMPLIANCE[joint.kind]: 1.0 / joint.stiffness if joint.stiffness else PLACEHOLDER[joint.kind]}
        if joint.passive:
            own = {STIFFNESS[joint.kind]: joint.stiffness, REST[joint.kind]: joint.rest}
        elif not joint.stiffness:
            self._fill.append(label)
        kind = "joint" if joint.passive else "actuated"
        return {"kind": kind, **self._moves(joint), **own, **self._limits(joint), **self._rotor(joint)}

    def _rotor(self, joint: RobotJoint) -> dict[str, float]:
        return {ROTOR[joint.kind]: joint.rotor} if joint.rotor else {}

    def _moves(self, joint: RobotJoint) -> dict[str, Any]:
        table: dict[str, Any] = {"axis": axis_key(np.array(joint.axis))}
        return {**table, "motion": "slides"} if joint.kind == "slides" else table

    def _limits(self, joint: RobotJoint) -> dict[str, Any]:
        return {} if joint.limits is None else {LIMITS[joint.kind]: list(joint.limits)}

    def _weigh(self, name: str) -> None:
        body = self._robot.bodies[name]
        if not body.mass:
            if any(body.inertia):
                self._notes.left_out.append(f"the moments of inertia of link '{name}', which has no mass")
            return
        table: dict[str, Any] = {
            "kind": "payload",
            "name": self._names.new(f"{name}-mass"),
            **self._after(self._ends_with[name]),
        }
        table |= {"mass_kg": body.mass, "centre_of_mass_mm": list(body.centre)}
        if body.inertia:
            table["inertia_kg_mm2"] = list(body.inertia)
        if name in self._robot.impossible:
            self._impossible[table["name"]] = self._robot.impossible[name]
        self._parts.append(table)
        self._ends_with[name] = table["name"]

    def _say_massless(self) -> None:
        heavy = {self._carried_by[name] for name, body in self._robot.bodies.items() if body.mass}
        light = [name for name in self._robot.bodies if name not in heavy and self._carried_by[name] == name]
        light = [name for name in light if name != self._robot.root and not self._robot.bodies[name].between]
        if light:
            self._notes.doubtful.append(f"moving links without mass: {', '.join(light)}; they weigh nothing")

    def _home(self) -> dict[str, float]:
        """The posture nearest zero in which each joint, and each that follows it, is within its limits."""
        held = [table for table in self._parts if table["kind"] in ("actuated", "coupled") or set(table) & SPRUNG]
        tables = {table["name"]: table for table in held}
        # each joint's coordinate is a share of a driven one, and an offset
        lead = {name: (name, 1.0, 0.0) for name in self._posture}
        room = dict.fromkeys(self._posture, (-np.inf, np.inf))
        for name, table in tables.items():
            if name not in lead:
                ((master, ratio),) = table["to"].items()
                first, share, offset = lead[master]
                own = table.get(OFFSET["turns"], 0.0) + table.get(OFFSET["slides"], 0.0)
                lead[name] = (first, ratio * share, ratio * offset + own)
            first, share, offset = lead[name]
            limits = table.get(LIMITS["turns"]) or table.get(LIMITS["slides"])
            if limits is None or share == 0.0:
                continue
            ends = sorted((limit - offset) / share for limit in limits)
            room[first] = (max(room[first][0], ends[0]), min(room[first][1], ends[1]))
        for name, (low, high) in room.items():
            if low > high:
                raise ModelFileError(
                    f"{self._robot.file}: joint '{name}': its limits and those of the joints that follow it leave "
                    "no posture: correct them"
                )
        return {name: float(np.clip(self._posture[name], *room[name])) for name in self._posture}

    def _end_at_tip(self) -> None:
        """Put the end-effector behind the last part: the tip, or the one end of the tree that no closure holds."""
        held = {body for closure in self._robot.closures for body in closure.bodies}
        free = [name for name in self._tips if name not in held]
        tip = self._tip or (free[0] if len(free) == 1 else None)
        if tip is None:
            if len(self._tips) > 1:
                self._notes.doubtful.append(
                    f"which link is the end-effector: '{list(self._tips)[-1]}' is taken; name another by --tip "
                    f"({', '.join(self._tips)})"
                )
            return
        behind = self._ends_with[tip]
        if self._parts[-1]["name"] != behind:
            label = self._tips.get(tip) or self._names.new(tip, "link")
            self._parts.append({"kind": "link", "name": label, "after": behind, "translation_mm": [0.0, 0.0, 0.0]})

    def _with_ends(self) -> Imported:
        document: dict[str, Any] = {
            "format": 1,
            "name": self._title,
            "title": f"{self._robot.name}, imported from {self._robot.file}",
            "source": self._robot.file,
            "units": {"length": "mm", "force": "N", "angle": "rad"},
            "parts": self._parts,
            "postures": {HOME: self._home()},
        }
        if self._robot.closures:
            self._end_at_tip()
            document["closures"] = [
                {
                    "name": self._names.new(one.name),
                    "between": [self._ends_with[body] for body in one.bodies],
                    "frames": [place.keys("position_mm") for place in one.placings],
                    **({"holds": "ball"} if one.turns else {}),
                }
                for one in self._robot.closures
            ]
        imported = Imported(
            document, self._notes, self._fill, joints=self._label, file=self._robot.file,
            impossible=self._impossible,
        )  # fmt: skip
        document["source"] += imported.unfilled
        if self._couplings:
            document["couplings"] = self._couplings
        if self._tips and not self._robot.closures:
            document["ends"] = {label: self._ends_with[name] for name, label in self._tips.items()}
            imported.ends = list(self._tips)
        return imported
