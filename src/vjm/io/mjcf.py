"""MJCF files, MuJoCo's format: a robot's kinematics, masses and limits, read by MuJoCo itself.

Needs the optional extra ``vjm-stiffness[mjcf]``. Written after MuJoCo's XML reference: a body stands in its parent,
each of its joints moves it about or along an axis through an anchor, one after the other.
"""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np

from vjm.child_process import ChildError
from vjm.io.errors import ModelFileError, printed
from vjm.io.foreign_readers import CompiledMjcf, compiled_mjcf
from vjm.io.inertia import NO_BODYS, ROUNDED, inertia_values, is_of_a_body, said_repair
from vjm.io.mjcf_constraints import METRE, WORLD, Library
from vjm.io.mjcf_springs import LEAST_STIFFNESS, JointSpring, SprungModel
from vjm.io.mjcf_text import LEAST
from vjm.io.robot import USUAL, Body, Mimic, Placing, Reading, Robot, RobotClosure, RobotJoint, Turns, turned
from vjm.io.urdf_values import FilePlace, in_order, quaternion_turns, usable_limits
from vjm.rotations import Array


def mjcf_robot(path: Path, tip: str | None = None, reading: Reading = USUAL) -> Robot:
    """The robot of an MJCF file: all of it, or the way from the world to a body.

    Raises:
        ModelFileError: MuJoCo does not read it, or what is to be read of it makes no machine.
        ImportError: MuJoCo, an optional extra, is not installed.
    """
    try:
        found = compiled_mjcf(path)
    except ChildError as error:
        raise ModelFileError(str(error)) from error
    except ValueError as error:
        # shapes of missing files are left out where no mass follows from them
        remedy = ". Put it there, or give every body an <inertial>" if "opening file" in str(error) else ""
        raise ModelFileError(f"{path.name}: MuJoCo does not read it: {error}{remedy}") from error
    robot = _MjcfReader(importlib.import_module("mujoco"), found, path.name, reading).robot(tip)
    robot.notes.doubtful += [f"MuJoCo says: {warning.strip()}" for warning in found.warnings]
    return robot


class _MjcfReader(SprungModel):
    """One compiled model, read body by body."""

    def __init__(self, mujoco: Library, found: CompiledMjcf, file: str, reading: Reading) -> None:
        super().__init__(mujoco, found.model, file)
        self._reading = reading
        self._repaired, self._exchanged = found.repaired, found.exchanged
        if found.bare:
            self._notes.left_out.append("meshes, of files that are not there: the masses follow from none of them")
        self._drops_moments = found.balanced and self._balanced()
        self._impossible: dict[str, tuple[Array, Array]] = {}
        self._driven: set[int] = set()
        self._held: dict[int, JointSpring] = {}
        self._sprung: set[int] = set()

    def robot(self, tip: str | None) -> Robot:
        taken = self._taken(tip)
        self._driven = self._driven_joints(taken)
        self._held = self._joint_springs(taken)
        self._sprung = self._sprung_joints(taken)
        bodies: dict[str, Body] = {WORLD: Body(WORLD)}
        joints: list[RobotJoint] = []
        for index in taken:
            self._add(index, bodies, joints)
        placed = {joint.name for joint in joints}
        masters = {
            joint.mimic.joint: self._master(joint.mimic.joint)
            for joint in joints
            if joint.mimic is not None and joint.mimic.joint not in placed
        }
        closures = self._closures()
        self._survey(tip, taken)
        self._say_driven(joints)
        name = self._file.split(".")[0]
        named = bytes(self._model.names).split(b"\0")[0].decode("utf-8", "replace")
        return Robot(
            named or name, WORLD, bodies, joints, masters, self._file, self._notes, closures, self._impossible
        )

    def _sprung_joints(self, taken: list[int]) -> set[int]:
        """Joints that a spring holds and no drive, and those that follow them."""
        leads = self._leads()
        alone = {
            joint
            for joint, held in self._held.items()
            if held.spring and joint not in self._driven and int(self._model.jnt_bodyid[joint]) in taken
        }
        return {joint for joint in range(self._model.njnt) if leads.get(joint, joint) in alone}

    def _say_driven(self, joints: list[RobotJoint]) -> None:
        """Say which joints are taken as driven though no actuator is theirs."""
        if sprung := [j.name for j in joints if j.passive and j.stiffness]:
            self._notes.changed.append(f"no actuator drives {', '.join(sprung)}: springs alone hold them")
        if not self._driven:
            if self._closes and not sprung:
                self._notes.doubtful.append(
                    "no actuator says which joints have drives: all of them stand as driven"
                )
            return
        driven = {name for joint in self._driven for name in self._names(joint)}
        driven |= {self._joint_name(joint) for joint in self._sprung}
        idle = [j.name for j in joints if j.kind != "fixed" and not j.passive and j.name not in driven]
        if idle:
            self._notes.changed.append(f"no actuator drives {', '.join(idle)}: they stand as driven")

    def _add(self, index: int, bodies: dict[str, Body], joints: list[RobotJoint]) -> None:
        """A body, and its joints one after the other with bodies of no mass between."""
        model, name = self._model, self._bodies[index]
        parent = self._bodies[int(model.body_parentid[index])]
        w, x, y, z = (float(v) for v in model.body_quat[index])
        shift, turns = METRE * np.array(model.body_pos[index]), quaternion_turns(x, y, z, w)
        first = int(model.body_jntadr[index])
        moving = [joint for joint in range(first, first + int(model.body_jntnum[index])) if not self._stands(joint)]
        anchor = np.zeros(3)
        for k, joint in enumerate(moving):
            here = METRE * np.array(model.jnt_pos[joint])
            last = joint == moving[-1] and not here.any()
            child = name if last else f"{name}-{k + 1}"
            bodies.setdefault(child, Body(child, between=True))
            place = _placing(shift, turns, here - anchor)
            if not self._name("JOINT", joint):
                self._notes.changed.append(f"a joint of body '{name}' has no name: '{self._joint_name(joint)}'")
            if self._is_ball(joint):
                joints += self._ball(joint, parent, child, place, bodies)
            else:
                joints.append(self._joint(joint, parent, child, place, self._mimics.get(joint)))
            # a joint's own reference: the angle at which the file shows the machine
            shift, turns, anchor, parent = np.zeros(3), (), here, child
        if parent != name:
            joints.append(RobotJoint(f"{name}-fixed", "fixed", parent, name, _placing(shift, turns, -anchor)))
        centre = METRE * np.array(model.body_ipos[index])
        bodies[name] = Body(
            name, float(model.body_mass[index]), (float(centre[0]), float(centre[1]), float(centre[2])),
            inertia=self._inertia(index),
        )  # fmt: skip

    def _is_ball(self, joint: int) -> bool:
        return int(self._model.jnt_type[joint]) == int(self._mujoco.mjtJoint.mjJNT_BALL)

    def _names(self, joint: int) -> list[str]:
        """Of a joint, or of the three that stand for a ball."""
        name = self._joint_name(joint)
        return [f"{name}-{axis}" for axis in "xyz"] if self._is_ball(joint) else [name]

    def _ball(
        self, joint: int, parent: str, child: str, place: Placing, bodies: dict[str, Body]
    ) -> list[RobotJoint]:
        """A ball joint as three revolute ones about perpendicular axes, one after the other."""
        model, name, found = self._model, self._joint_name(joint), list[RobotJoint]()
        driven = joint in self._driven
        # about each axis, to the first order around where it is free of stress; N m are 1e3 N mm
        stiffness = 1e3 * float(model.jnt_stiffness[joint])
        if not self._is_linear("jnt", joint, f"the spring of joint '{name}'") or stiffness < LEAST_STIFFNESS:
            stiffness = 0.0
        passive = not driven and (stiffness > 0.0 or (self._closes and bool(self._driven | self._sprung)))
        home = (0.0, 0.0, 0.0)
        if self._closes and model.nkey:
            at = int(model.jnt_qposadr[joint])
            w, x, y, z = (float(v) for v in model.key_qpos[0][at : at + 4])
            R = turned(quaternion_turns(x, y, z, w))
            home = (
                float(np.arctan2(-R[1, 2], R[2, 2])), float(np.arcsin(np.clip(R[0, 2], -1.0, 1.0))),
                float(np.arctan2(-R[0, 1], R[0, 0])),
            )  # fmt: skip
        rotor = 1e6 * float(model.dof_armature[int(model.jnt_dofadr[joint])])
        for k, own in enumerate(self._names(joint)):
            behind = child if k == 2 else f"{own}-body"
            bodies.setdefault(behind, Body(behind, between=True))
            x, y, z = (float(v) for v in np.eye(3)[k])
            found.append(RobotJoint(
                own, "turns", parent, behind, place, (x, y, z), home=home[k], rotor=rotor, passive=passive,
                stiffness=stiffness,
            ))  # fmt: skip
            parent, place = behind, Placing()
        self._notes.changed.append(
            f"joint '{name}' is a ball: the joints {', '.join(self._names(joint))} stand in its place, "
            "one after the other"
        )
        if model.jnt_limited[joint]:
            self._notes.left_out.append(f"the limit of joint '{name}', a ball: three joints have none together")
        return found

    def _stands(self, joint: int) -> bool:
        """Whether a joint is free, and is to hold its body where the file shows it."""
        free = int(self._model.jnt_type[joint]) == int(self._mujoco.mjtJoint.mjJNT_FREE)
        if free and self._reading.fix_base:
            body = self._bodies[int(self._model.jnt_bodyid[joint])]
            self._notes.changed.append(f"the body '{body}' is free: it stands where the file shows it")
            return True
        return False

    def _inertia(self, index: int) -> tuple[float, ...]:
        """Moments of inertia of a body in its axes, kg mm²; empty where it has none of its own."""
        if index in self._repaired and self._repair(index):
            return ()
        moments = np.array(self._model.body_inertia[index], dtype=float)
        # what a file of ours has where the model gives none; other small moments are those of small bodies
        if self._drops_moments or np.all(np.abs(moments / float(LEAST) - 1.0) < ROUNDED):
            return ()
        turned = np.zeros(9)
        self._mujoco.mju_quat2Mat(turned, self._model.body_iquat[index])
        R = turned.reshape(3, 3)
        return tuple(inertia_values(METRE**2 * R @ np.diag(moments) @ R.T))

    def _balanced(self) -> bool:
        """Say that MuJoCo changed moments of inertia, of shapes; whether all are left out in place of that.

        Raises:
            ModelFileError: they are neither.
        """
        found = f"a body's shapes have {NO_BODYS}"
        remedy = "give it an <inertial>, or say `validate import` without --strict"
        return not self._notes.repaired(
            self._reading.repairs,
            ModelFileError(f"{self._file}: {found}: {remedy}"),
            doubtful=f"{found}, and MuJoCo does not name it: those of all bodies are left out",
            changed=f"{found}: they became their mean, and MuJoCo does not name it",
        )

    def _repair(self, index: int) -> bool:
        """Say that the file's moments of inertia were repaired; whether they are left out in place of that.

        Raises:
            ModelFileError: they are neither.
        """
        name = self._bodies[index]
        where, (given, new) = f"body '{name}'", self._repaired[index]
        if is_of_a_body(inertia_values(given)):
            # within the rounding of the file's numbers
            return False
        self._impossible[name] = METRE**2 * given, METRE**2 * new
        remedy = "correct them, or say `validate import` without --strict"
        return not self._notes.repaired(
            self._reading.repairs,
            ModelFileError(f"{self._file}: {where} has {NO_BODYS}: {remedy}"),
            doubtful=f"{where} has {NO_BODYS}: left out",
            changed=f"{where}: {said_repair(METRE**2 * given, METRE**2 * new)}",
        )

    def _joint(self, joint: int, parent: str, child: str, place: Placing, mimic: Mimic | None) -> RobotJoint:
        slides, model = self._slides(joint), self._model
        unit = METRE if slides else 1.0
        x, y, z = (float(v) for v in model.jnt_axis[joint])
        reference = unit * float(model.qpos0[int(model.jnt_qposadr[joint])])
        if reference:
            place = _referred(place, np.array([x, y, z]), reference, slides=slides)
        name = self._joint_name(joint)
        if (stands := self._standing.get(joint)) is not None:
            unit_name = "mm" if slides else "rad"
            self._notes.changed.append(
                f"an equality holds joint '{name}': it stands at {printed(stands)} {unit_name}"
            )
            return RobotJoint(name, "slides" if slides else "turns", parent, child, place, (x, y, z)).standing(
                stands
            )
        limits, home = None, 0.0
        if model.jnt_limited[joint]:
            low, high = (unit * float(v) for v in model.jnt_range[joint])
            given = (high, low) if joint in self._exchanged else (low, high)
            where = FilePlace(self._file, f"joint '{name}'")
            found = in_order(given, where, self._reading, self._notes, slides=slides)
            if found is not None:
                limits, home = usable_limits(
                    *found, name, slides=slides, doubts=self._notes.doubtful, changed=self._notes.changed
                )
        told = self._driven | self._sprung
        passive = joint not in told and self._closes and bool(told)
        if joint in self._sprung:
            # what follows a joint on a spring follows it as it does a driven one
            passive = mimic is None
        held = self._held.get(joint, JointSpring())
        if held.spring and not held.servo:
            # a servo holds the joint where it is sent, a spring where it is free of stress
            home = held.rest if limits is None else min(max(held.rest, limits[0]), limits[1])
        if self._closes:
            # where the file shows the machine, or its first keyframe has it, its loops are closed
            at = int(model.jnt_qposadr[joint])
            home = unit * float(model.key_qpos[0][at]) if model.nkey else reference
        # kg m² are 1e6 kg mm²; of a joint that slides it is a mass
        rotor = float(model.dof_armature[int(model.jnt_dofadr[joint])]) * (1.0 if slides else 1e6)
        return RobotJoint(
            name, "slides" if slides else "turns", parent, child, place, (x, y, z), limits, home, mimic, rotor,
            passive, held.spring + (0.0 if passive else held.servo), held.rest,
        )  # fmt: skip

    def _master(self, name: str) -> RobotJoint:
        joint = next(i for i in range(self._model.njnt) if self._joint_name(i) == name)
        return self._joint(joint, WORLD, name, Placing(), None)

    def _closures(self) -> list[RobotClosure]:
        """What holds two bodies that are taken together: equalities ``connect`` and ``weld``."""
        model, found = self._model, []
        for k in self._closures_kept:
            ball = self._closing[int(model.eq_type[k])]
            names = [self._bodies[i] for i in self._closed_bodies(k)]
            if int(model.eq_objtype[k]) == int(self._mujoco.mjtObj.mjOBJ_SITE):
                sites = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
                places = [self._place(model.site_pos[i], model.site_quat[i]) for i in sites]
            else:
                data, plain = model.eq_data[k], np.array([1.0, 0.0, 0.0, 0.0])
                first, second = (data[:3], data[3:6]) if ball else (data[3:6], data[:3])
                places = [self._place(first, plain if ball else data[6:10]), self._place(second, plain)]
            found.append(
                RobotClosure(self._closure_name(k), (names[0], names[1]), (places[0], places[1]), turns=ball)
            )
        return found

    def _place(self, position: Array, quaternion: Array) -> Placing:
        w, x, y, z = (float(v) for v in quaternion)
        return _placing(METRE * np.array(position), quaternion_turns(x, y, z, w), np.zeros(3))

    def _survey(self, tip: str | None, taken: list[int]) -> None:
        model, left = self._model, self._notes.left_out
        counts = {
            "shapes": model.ngeom, "meshes": model.nmesh, "cameras": model.ncam, "lights": model.nlight,
            "tendons": model.ntendon - self._tendons_read, "sensors": model.nsensor,
            "excluded contacts": model.nexclude, "deformable bodies": model.nflex,
            # of a machine with closed loops these say where it stands, what holds it, and what is driven
            "sites": 0 if self._closes else model.nsite,
            "actuators": 0 if self._closes else model.nu - self._gains_read,
            "keyframes": max(0, model.nkey - 1) if self._closes else model.nkey,
        }  # fmt: skip
        if found := [f"{what} ({count})" for what, count in counts.items() if count]:
            left.append(f"what no model file has: {', '.join(found)}")
        for key, what in (("dof_damping", "damping"), ("dof_frictionloss", "friction")):
            if np.any(getattr(model, key)):
                left.append(f"{what} of joints ({key})")
        if np.any(model.body_gravcomp):
            left.append("compensation of weight (gravcomp)")
        off = [i for i in range(1, model.nbody) if i not in taken]
        if off:
            named, mass = ", ".join(self._bodies[i] for i in off), float(model.body_mass[off].sum())
            left.append(f"bodies that are not on the way to '{tip}': {named}, {printed(mass)} kg together")


def _placing(shift: Array, turns: Turns, then: Array) -> Placing:
    """Shifted, turned, and shifted again in the turned axes."""
    moved = shift + turned(turns) @ then
    return Placing((float(moved[0]), float(moved[1]), float(moved[2])), turns)


def _referred(place: Placing, axis: Array, reference: float, *, slides: bool) -> Placing:
    """So that the coordinate is ``reference`` where the file shows the machine."""
    if slides:
        return _placing(np.array(place.shift), place.turns, -reference * axis)
    x, y, z = axis
    return Placing(place.shift, (*place.turns, ((float(x), float(y), float(z)), -reference)))
