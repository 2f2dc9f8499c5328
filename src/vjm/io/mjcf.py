"""MJCF files, MuJoCo's format: a robot's kinematics, masses and limits, read by MuJoCo itself.

Needs the optional extra ``vjm-stiffness[mjcf]``. Written after MuJoCo's XML reference: a body stands in its parent,
each of its joints moves it about or along an axis through an anchor, one after the other.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.inertia import ROUNDED, inertia_values
from vjm.io.mjcf_text import LEAST
from vjm.io.robot import Body, Mimic, Notes, Placing, Robot, RobotClosure, RobotJoint, Turns, turned
from vjm.io.urdf_values import quaternion_turns, usable_limits
from vjm.rotations import Array

METRE = 1000.0
Library = Any
"""MuJoCo, or a model of its; neither has types where it is not installed."""
WORLD = "world"


def mjcf_robot(path: Path, tip: str | None = None) -> Robot:
    """The robot of an MJCF file: all of it, or the way from the world to a body.

    Raises:
        ModelFileError: MuJoCo does not read it, or what is to be read of it makes no machine.
        ImportError: MuJoCo, an optional extra, is not installed.
    """
    mujoco: Library = importlib.import_module("mujoco")
    warnings: list[str] = []
    # else it writes them into a file where the user stands
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(warnings.append)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        balanced = False
        try:
            model = spec.compile()
        except ValueError:
            # a file whose moments of inertia no body has is read without them
            spec = mujoco.MjSpec.from_file(str(path))
            spec.compiler.balanceinertia = balanced = True
            model = spec.compile()
    except ValueError as error:
        raise ModelFileError(f"{path.name}: MuJoCo does not read it: {error}") from error
    finally:
        mujoco.set_mju_user_warning(before)
    robot = _MjcfReader(mujoco, model, path.name, balanced=balanced).robot(tip)
    robot.notes.doubtful += [f"MuJoCo says: {warning.strip()}" for warning in warnings]
    return robot


class _MjcfReader:
    """One compiled model."""

    def __init__(self, mujoco: Library, model: Library, file: str, *, balanced: bool) -> None:
        self._mujoco, self._model, self._file, self._balanced = mujoco, model, file, balanced
        self._notes = Notes()
        self._bodies = [self._name("BODY", i) or f"body-{i}" for i in range(model.nbody)]
        self._bodies[0] = WORLD
        kinds = mujoco.mjtEq
        self._closing = {int(kinds.mjEQ_CONNECT): True, int(kinds.mjEQ_WELD): False}
        self._closes = any(
            int(kind) in self._closing and active
            for kind, active in zip(model.eq_type, model.eq_active0, strict=True)
        )
        by_joint = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
        self._driven = {
            int(model.actuator_trnid[k][0]) for k in range(model.nu) if int(model.actuator_trntype[k]) in by_joint
        }

    def robot(self, tip: str | None) -> Robot:
        taken = self._taken(tip)
        bodies: dict[str, Body] = {WORLD: Body(WORLD)}
        joints: list[RobotJoint] = []
        mimics = self._mimics()
        for index in taken:
            self._add(index, mimics, bodies, joints)
        placed = {joint.name for joint in joints}
        masters = {
            joint.mimic.joint: self._master(joint.mimic.joint)
            for joint in joints
            if joint.mimic is not None and joint.mimic.joint not in placed
        }
        closures = self._closures(bodies)
        self._survey(tip, taken)
        if closures and not self._driven:
            self._notes.doubtful.append("no actuator says which joints have drives: all of them stand as driven")
        name = self._file.split(".")[0]
        named = bytes(self._model.names).split(b"\0")[0].decode("utf-8", "replace")
        return Robot(named or name, WORLD, bodies, joints, masters, self._file, self._notes, closures)

    def _name(self, kind: str, index: int) -> str:
        name = self._mujoco.mj_id2name(self._model, getattr(self._mujoco.mjtObj, f"mjOBJ_{kind}"), index)
        return str(name or "")

    def _taken(self, tip: str | None) -> list[int]:
        """Bodies in their order, parents first."""
        if tip is None or (self._closes and tip in self._bodies):
            # a machine with closed loops is taken whole: its end moves by all of it
            return list(range(1, self._model.nbody))
        if tip not in self._bodies:
            hint = did_you_mean(tip, self._bodies) or f" (there are {', '.join(self._bodies)})"
            raise ModelFileError(f"{self._file}: no body '{tip}'{hint}")
        way, at = list[int](), self._bodies.index(tip)
        while at:
            way.insert(0, at)
            at = int(self._model.body_parentid[at])
        return way

    def _add(self, index: int, mimics: dict[int, Mimic], bodies: dict[str, Body], joints: list[RobotJoint]) -> None:
        """A body, and its joints one after the other with bodies of no mass between."""
        model, name = self._model, self._bodies[index]
        parent = self._bodies[int(model.body_parentid[index])]
        w, x, y, z = (float(v) for v in model.body_quat[index])
        shift, turns = METRE * np.array(model.body_pos[index]), quaternion_turns(x, y, z, w)
        first = int(model.body_jntadr[index])
        moving = list(range(first, first + int(model.body_jntnum[index])))
        anchor = np.zeros(3)
        for k, joint in enumerate(moving):
            here = METRE * np.array(model.jnt_pos[joint])
            last = joint == moving[-1] and not here.any()
            child = name if last else f"{name}-{k + 1}"
            bodies.setdefault(child, Body(child, between=True))
            place = _placing(shift, turns, here - anchor)
            if not self._name("JOINT", joint):
                self._notes.changed.append(f"a joint of body '{name}' has no name: '{self._joint_name(joint)}'")
            joints.append(self._joint(joint, parent, child, place, mimics.get(joint)))
            # a joint's own reference: the angle at which the file shows the machine
            shift, turns, anchor, parent = np.zeros(3), (), here, child
        if parent != name:
            joints.append(RobotJoint(f"{name}-fixed", "fixed", parent, name, _placing(shift, turns, -anchor)))
        centre = METRE * np.array(model.body_ipos[index])
        bodies[name] = Body(
            name, float(model.body_mass[index]), (float(centre[0]), float(centre[1]), float(centre[2])),
            inertia=self._inertia(index),
        )  # fmt: skip

    def _inertia(self, index: int) -> tuple[float, ...]:
        """Moments of inertia of a body in its axes, kg mm²; empty where it has none of its own."""
        moments = np.array(self._model.body_inertia[index], dtype=float)
        if self._balanced or np.all(moments <= float(LEAST) * (1.0 + ROUNDED)):
            return ()
        turned = np.zeros(9)
        self._mujoco.mju_quat2Mat(turned, self._model.body_iquat[index])
        R = turned.reshape(3, 3)
        return tuple(inertia_values(METRE**2 * R @ np.diag(moments) @ R.T))

    def _joint_name(self, joint: int) -> str:
        return self._name("JOINT", joint) or f"{self._bodies[int(self._model.jnt_bodyid[joint])]}-joint-{joint}"

    def _slides(self, joint: int) -> bool:
        """Whether a joint slides.

        Raises:
            ModelFileError: it neither slides nor turns about one axis.
        """
        kind = int(self._model.jnt_type[joint])
        types = self._mujoco.mjtJoint
        if kind in (int(types.mjJNT_FREE), int(types.mjJNT_BALL)):
            what = (
                "free, and a machine stands on its base: take it out" if kind == int(types.mjJNT_FREE) else "a ball"
            )
            remedy = "" if kind == int(types.mjJNT_FREE) else ": write three hinges"
            raise ModelFileError(f"{self._file}: joint '{self._joint_name(joint)}' is {what}{remedy}")
        return kind == int(types.mjJNT_SLIDE)

    def _joint(self, joint: int, parent: str, child: str, place: Placing, mimic: Mimic | None) -> RobotJoint:
        slides, model = self._slides(joint), self._model
        unit = METRE if slides else 1.0
        x, y, z = (float(v) for v in model.jnt_axis[joint])
        reference = unit * float(model.qpos0[int(model.jnt_qposadr[joint])])
        if reference:
            place = _referred(place, np.array([x, y, z]), reference, slides=slides)
        name = self._joint_name(joint)
        limits, home = None, 0.0
        if model.jnt_limited[joint]:
            low, high = (unit * float(v) for v in model.jnt_range[joint])
            limits, home = usable_limits(
                low, high, name, slides=slides, doubts=self._notes.doubtful, changed=self._notes.changed
            )
        passive = self._closes and bool(self._driven) and joint not in self._driven
        if self._closes:
            # where the file shows the machine, or its first keyframe has it, its loops are closed
            at = int(model.jnt_qposadr[joint])
            home = unit * float(model.key_qpos[0][at]) if model.nkey else reference
        # kg m² are 1e6 kg mm²; of a joint that slides it is a mass
        rotor = float(model.dof_armature[int(model.jnt_dofadr[joint])]) * (1.0 if slides else 1e6)
        return RobotJoint(
            name, "slides" if slides else "turns", parent, child, place, (x, y, z), limits, home, mimic, rotor,
            passive,
        )  # fmt: skip

    def _master(self, name: str) -> RobotJoint:
        joint = next(i for i in range(self._model.njnt) if self._joint_name(i) == name)
        return self._joint(joint, WORLD, name, Placing(), None)

    def _mimics(self) -> dict[int, Mimic]:
        """What joints follow others in the end, by equalities that are straight lines."""
        model, steps = self._model, dict[int, tuple[int, float, float]]()
        joint_type = int(self._mujoco.mjtEq.mjEQ_JOINT)
        for k in range(model.neq):
            a, b = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
            kind = str(self._mujoco.mjtEq(int(model.eq_type[k])).name).removeprefix("mjEQ_").lower()
            if int(model.eq_type[k]) in self._closing and model.eq_active0[k]:
                continue
            if (
                int(model.eq_type[k]) != joint_type
                or b < 0
                or any(model.eq_data[k][2:5])
                or not model.eq_active0[k]
            ):
                self._notes.left_out.append(f"the equality '{self._name('EQUALITY', k) or kind}' ({kind})")
                continue
            ours, theirs = (METRE if self._slides(j) else 1.0 for j in (a, b))
            at = [float(model.qpos0[int(model.jnt_qposadr[j])]) for j in (a, b)]
            offset, ratio = (float(v) for v in model.eq_data[k][:2])
            steps[a] = b, ratio * ours / theirs, ours * (at[0] + offset - ratio * at[1])
        found = {}
        for joint in steps:
            ratio, offset, at_joint, seen = 1.0, 0.0, joint, {joint}
            while at_joint in steps:
                other, step, shift = steps[at_joint]
                ratio, offset, at_joint = ratio * step, offset + ratio * shift, other
                if at_joint in seen:
                    raise ModelFileError(f"{self._file}: joint '{self._joint_name(joint)}' follows itself")
                seen.add(at_joint)
            found[joint] = Mimic(self._joint_name(at_joint), ratio, offset)
        return found

    def _closures(self, bodies: dict[str, Body]) -> list[RobotClosure]:
        """What holds two bodies that are taken together: equalities ``connect`` and ``weld``."""
        model, found = self._model, []
        site = int(self._mujoco.mjtObj.mjOBJ_SITE)
        for k in range(model.neq):
            ball = self._closing.get(int(model.eq_type[k]))
            if ball is None or not model.eq_active0[k]:
                continue
            ids = int(model.eq_obj1id[k]), max(0, int(model.eq_obj2id[k]))
            if int(model.eq_objtype[k]) == site:
                names = [self._bodies[int(model.site_bodyid[i])] for i in ids]
                places = [self._place(model.site_pos[i], model.site_quat[i]) for i in ids]
            else:
                names = [self._bodies[i] for i in ids]
                data, plain = model.eq_data[k], np.array([1.0, 0.0, 0.0, 0.0])
                first, second = (data[:3], data[3:6]) if ball else (data[3:6], data[:3])
                places = [self._place(first, plain if ball else data[6:10]), self._place(second, plain)]
            name = self._name("EQUALITY", k) or f"{names[0]}-to-{names[1]}"
            if any(body not in bodies for body in names):
                self._notes.left_out.append(f"the closure '{name}': one of its bodies is left out")
                continue
            found.append(RobotClosure(name, (names[0], names[1]), (places[0], places[1]), turns=ball))
        return found

    def _place(self, position: Array, quaternion: Array) -> Placing:
        w, x, y, z = (float(v) for v in quaternion)
        return _placing(METRE * np.array(position), quaternion_turns(x, y, z, w), np.zeros(3))

    def _survey(self, tip: str | None, taken: list[int]) -> None:
        model, left = self._model, self._notes.left_out
        counts = {
            "shapes": model.ngeom, "meshes": model.nmesh, "cameras": model.ncam, "lights": model.nlight,
            "tendons": model.ntendon, "sensors": model.nsensor, "excluded contacts": model.nexclude,
            "deformable bodies": model.nflex,
            # of a machine with closed loops these say where it stands, what holds it, and what is driven
            "sites": 0 if self._closes else model.nsite,
            "actuators": 0 if self._closes else model.nu,
            "keyframes": max(0, model.nkey - 1) if self._closes else model.nkey,
        }  # fmt: skip
        if found := [f"{what} ({count})" for what, count in counts.items() if count]:
            left.append(f"what no model file has: {', '.join(found)}")
        if self._balanced:
            left.append("moments of inertia: a body has some that no body can have")
        for key, what in (
            ("jnt_stiffness", "springs"),
            ("dof_damping", "damping"),
            ("dof_frictionloss", "friction"),
        ):
            if np.any(getattr(model, key)):
                left.append(f"{what} of joints ({key})")
        if np.any(model.body_gravcomp):
            left.append("compensation of weight (gravcomp)")
        off = [name for i, name in enumerate(self._bodies) if i and i not in taken]
        if off:
            left.append(f"bodies that are not on the way to '{tip}': {', '.join(off)}")


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
