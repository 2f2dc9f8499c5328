"""MJCF files, MuJoCo's format.

Here are a robot's kinematics, masses and limits, read by MuJoCo itself; what holds its joints, by closures,
followers, actuators and springs.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vjm.child_process import ChildError
from vjm.io.errors import ModelFileError, did_you_mean, printed
from vjm.io.foreign_readers import CompiledMjcf, compiled_mjcf
from vjm.io.inertia import NO_BODYS, ROUNDED, inertia_values, is_of_a_body
from vjm.io.robot import (
    LEAST_STIFFNESS,
    ON_ITS_BASE,
    USUAL,
    Body,
    Kind,
    Mimic,
    Notes,
    Placing,
    Reading,
    Robot,
    RobotClosure,
    RobotJoint,
    Turns,
    masters_of,
    triple,
    turned,
)
from vjm.io.robot_text import LEAST
from vjm.io.robot_xml import FilePlace, quaternion_turns, repaired_moments, taken_limits
from vjm.rotations import Array

METRE = 1000.0
Library = Any
"""MuJoCo, or a model of its; neither has types where it is not installed."""
WORLD = "world"
CLOSING = {"CONNECT": True, "WELD": False}
"""Equalities that close a loop, and whether they hold the place alone."""
BY_JOINT = ("JOINT", "JOINTINPARENT")
"""How an actuator drives a joint itself."""
KINDS: dict[bool, Kind] = {True: "slides", False: "turns"}


class JointSpring(NamedTuple):
    """What holds one coordinate.

    Attributes:
        spring: stiffness of all springs, N mm/rad or N/mm.
        servo: stiffness that position gains of actuators add, in the same unit.
        rest: coordinate at which the springs together are free of stress, rad or mm.
    """

    spring: float = 0.0
    servo: float = 0.0
    rest: float = 0.0


class _Elastic(NamedTuple):
    """A spring or a gain on a sum of joints: ``stiffness`` times ``Σ weight · coordinate − rest``, SI units."""

    name: str
    weights: dict[int, float]
    stiffness: float
    rest: float = 0.0
    servo: str = ""
    tendon: bool = False


def mjcf_robot(path: Path, tip: str | None = None, reading: Reading = USUAL) -> Robot:
    """The robot of an MJCF file: all of it, or the way from the world to a body.

    Raises:
        ModelFileError: MuJoCo does not read it, or what is to be read of it makes no machine.
        ImportError: MuJoCo, an optional extra, is not installed.
    """
    try:
        compiled = compiled_mjcf(path)
    except ChildError as error:
        raise ModelFileError(str(error)) from error
    except ValueError as error:
        # shapes of missing files are left out where no mass follows from them
        remedy = ". Put it there, or give every body an <inertial>" if "opening file" in str(error) else ""
        raise ModelFileError(f"{path.name}: MuJoCo does not read it: {error}{remedy}") from error
    robot = _MjcfReader(importlib.import_module("mujoco"), compiled, path.name, reading).robot(tip)
    robot.notes.doubtful += [f"MuJoCo says: {warning.strip()}" for warning in compiled.warnings]
    return robot


class _MjcfReader:
    """One compiled model, read body by body, with what its equalities, actuators and springs say of its joints."""

    def __init__(self, mujoco: Library, compiled: CompiledMjcf, file: str, reading: Reading) -> None:
        self._mujoco, self._model, self._file, self._reading = mujoco, compiled.model, file, reading
        self._notes = Notes()
        self._bodies = [self._name("BODY", i) or f"body-{i}" for i in range(self._model.nbody)]
        self._bodies[0] = WORLD
        self._joint_types = self._types("mjtJoint", self._model.jnt_type)
        self._equality_types = self._types("mjtEq", self._model.eq_type)
        self._transmissions = self._types("mjtTrn", self._model.actuator_trntype)
        self._wrap_types = self._types("mjtWrap", self._model.wrap_type)
        # the bodies that closures hold, or those with the sites that they hold
        self._on_sites = [name == "SITE" for name in self._types("mjtObj", self._model.eq_objtype)]
        self._standing: dict[int, float] = {}
        self._mimics = self._followers()
        self._closures_kept: list[int] = []
        self._gains_read = self._tendons_read = 0
        self._repaired, self._exchanged = compiled.repaired, compiled.exchanged
        if compiled.bare:
            self._notes.left_out.append("meshes, of files that are not there: the masses follow from none of them")
        self._drops_moments = compiled.balanced and self._balanced()
        self._impossible: dict[str, tuple[Array, Array]] = {}
        self._driven: set[int] = set()
        self._held: dict[int, JointSpring] = {}
        self._sprung: set[int] = set()

    def _types(self, enumeration: str, numbers: Array) -> list[str]:
        """MuJoCo's names of types, without its prefix."""
        kinds = getattr(self._mujoco, enumeration)
        return [str(kinds(int(number)).name).split("_", 1)[1] for number in numbers]

    def _name(self, kind: str, index: int) -> str:
        name = self._mujoco.mj_id2name(self._model, getattr(self._mujoco.mjtObj, f"mjOBJ_{kind}"), index)
        return str(name or "")

    def _joint_name(self, joint: int) -> str:
        return self._name("JOINT", joint) or f"{self._bodies[int(self._model.jnt_bodyid[joint])]}-joint-{joint}"

    def _slides(self, joint: int) -> bool:
        """Whether a joint slides."""
        kind = self._joint_types[joint]
        if kind in ("FREE", "BALL"):
            what = f"free, {ON_ITS_BASE}" if kind == "FREE" else "a ball: write three hinges"
            raise ModelFileError(f"{self._file}: joint '{self._joint_name(joint)}' is {what}")
        return kind == "SLIDE"

    @property
    def _closes(self) -> bool:
        return bool(self._closures_kept)

    def _way(self, body: int) -> list[int]:
        """The bodies from the world, without it, to one of them."""
        way = list[int]()
        while body:
            way.insert(0, body)
            body = int(self._model.body_parentid[body])
        return way

    def _taken(self, tip: str | None) -> list[int]:
        """Bodies in their order, parents first: all, or those that move the tip; which loops are kept is noted.

        Without loops that move it they are the way to it. With some they are all but what has joints of its own
        that do not move it.
        """
        model = self._model
        # the bodies whose joints move the two bodies of a closure against one another
        loops = {
            k: set(self._way(first)) ^ set(self._way(second))
            for k in range(model.neq)
            if self._is_closure(k)
            for first, second in [self._closed_bodies(k)]
        }
        if tip is None:
            self._closures_kept = list(loops)
            return list(range(1, model.nbody))
        if tip not in self._bodies:
            hint = did_you_mean(tip, self._bodies) or f" (there are {', '.join(self._bodies)})"
            raise ModelFileError(f"{self._file}: no body '{tip}'{hint}")
        way = self._way(self._bodies.index(tip))
        moving, kept = set(way), set[int]()
        jointed = {body for body in range(1, model.nbody) if model.body_jntnum[body]}
        while new_loops := {k for k, loop in loops.items() if k not in kept and loop & moving & jointed}:
            kept |= new_loops
            for body in set().union(*(loops[k] for k in new_loops)):
                moving.update(self._way(body))
            # what a joint follows moves the tip by its own loops
            masters = {m for j, m in self._leads().items() if int(model.jnt_bodyid[j]) in moving}
            looped = set().union(*loops.values())
            for body in {int(model.jnt_bodyid[m]) for m in masters} & looped:
                moving.update(self._way(body))
        self._closures_kept = sorted(kept)
        dropped = set(loops) - kept
        if dropped:
            named = ", ".join(self._closure_name(k) for k in sorted(dropped))
            self._notes.left_out.append(f"closed loops that do not move '{tip}': {named}")
        if not kept:
            return way
        idle = jointed - moving
        return [body for body in range(1, model.nbody) if not idle.intersection(self._way(body))]

    def _is_closure(self, k: int) -> bool:
        if self._equality_types[k] not in CLOSING or not self._model.eq_active0[k]:
            return False
        # what a simulation moves by hand holds nothing
        return all(self._model.body_mocapid[body] < 0 for body in self._closed_bodies(k))

    def _closed_bodies(self, k: int) -> tuple[int, int]:
        ids = int(self._model.eq_obj1id[k]), max(0, int(self._model.eq_obj2id[k]))
        if self._on_sites[k]:
            return int(self._model.site_bodyid[ids[0]]), int(self._model.site_bodyid[ids[1]])
        return ids

    def _closure_name(self, k: int) -> str:
        first, second = (self._bodies[i] for i in self._closed_bodies(k))
        return self._name("EQUALITY", k) or f"{first}-to-{second}"

    def _leads(self) -> dict[int, int]:
        """By follower, the joint that it follows in the end."""
        numbers = {self._joint_name(joint): joint for joint in range(self._model.njnt)}
        return {joint: numbers[mimic.joint] for joint, mimic in self._mimics.items()}

    def _driven_joints(self, taken: list[int]) -> set[int]:
        """Joints that an actuator holds: its own, those that follow or lead it, and what its tendon moves."""
        model, leads = self._model, self._leads()
        held, others = set[int](), list[int]()
        for k in range(model.nu):
            if self._transmissions[k] in BY_JOINT:
                joint = int(model.actuator_trnid[k][0])
                held.add(leads.get(joint, joint))
            else:
                others.append(k)
        for k in others:
            moved = {leads.get(joint, joint) for joint in self._pulled(k)} - held
            moved = {joint for joint in moved if int(model.jnt_bodyid[joint]) in taken}
            if len(moved) > 1 and self._closes:
                named = ", ".join(self._joint_name(joint) for joint in sorted(moved))
                raise ModelFileError(
                    f"{self._file}: one tendon drives the joints {named}, which move independently of one another: "
                    "no model has that. Couple them by an equality, or give each an actuator"
                )
            held |= moved
            if self._closes and not self._pulled(k):
                what = self._name("ACTUATOR", k) or f"number {k + 1}"
                self._notes.doubtful.append(f"the actuator '{what}' drives no joint: what it holds is not read")
        return {joint for joint in range(model.njnt) if leads.get(joint, joint) in held}

    def _pulled(self, actuator: int) -> list[int]:
        """Joints of the fixed tendon that an actuator drives; none where it drives something else."""
        if self._transmissions[actuator] != "TENDON":
            return []
        return [joint for _, joint in self._wrapped(int(self._model.actuator_trnid[actuator][0]))]

    def _wrapped(self, tendon: int) -> list[tuple[int, int]]:
        """Places in MuJoCo's list and joints of a fixed tendon; none of a tendon in space."""
        model = self._model
        first = int(model.tendon_adr[tendon])
        wraps = range(first, first + int(model.tendon_num[tendon]))
        return [(k, int(model.wrap_objid[k])) for k in wraps if self._wrap_types[k] == "JOINT"]

    def _followers(self) -> dict[int, Mimic]:
        """What joints follow others in the end, by equalities that are straight lines; which stand is noted."""
        model, steps = self._model, dict[int, tuple[int, float, float]]()
        for k in range(model.neq):
            if self._is_closure(k):
                continue
            relation = self._relation(k) if model.eq_active0[k] else None
            if relation is None or len(relation[0]) not in (1, 2):
                kind = self._equality_types[k].lower()
                self._notes.left_out.append(f"the equality '{self._name('EQUALITY', k) or kind}' ({kind})")
                continue
            weights, offset = relation
            # the last joint of a tendon follows the first one, but for one that follows already
            a = next((joint for joint in reversed(weights) if joint not in steps), next(iter(weights)))
            unit = {joint: METRE if self._slides(joint) else 1.0 for joint in weights}
            reference = {joint: float(model.qpos0[int(model.jnt_qposadr[joint])]) for joint in weights}
            shift = reference[a] + offset / weights[a]
            if len(weights) == 1:
                self._standing[a] = unit[a] * shift
                continue
            (b,) = (joint for joint in weights if joint != a)
            ratio = -weights[b] / weights[a]
            steps[a] = b, ratio * unit[a] / unit[b], unit[a] * (shift - ratio * reference[b])
        followers = {}
        for joint in steps:
            ratio, offset, at_joint, seen = 1.0, 0.0, joint, {joint}
            while at_joint in steps:
                other, step, shift = steps[at_joint]
                ratio, offset, at_joint = ratio * step, offset + ratio * shift, other
                if at_joint in seen:
                    raise ModelFileError(f"{self._file}: joint '{self._joint_name(joint)}' follows itself")
                seen.add(at_joint)
            if at_joint in self._standing:
                self._standing[joint] = ratio * self._standing[at_joint] + offset
            else:
                followers[joint] = Mimic(self._joint_name(at_joint), ratio, offset)
        return followers

    def _relation(self, k: int) -> tuple[dict[int, float], float] | None:
        """Weights of joints and a constant: the weighted sum of what they moved from where the file has them.

        None where an equality is no straight line, or holds something else than joints and fixed tendons. The
        joint that follows is the last one.
        """
        model, kind = self._model, self._equality_types[k]
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        offset, ratio, *higher = (float(v) for v in model.eq_data[k][:5])
        if second >= 0 and any(higher):
            return None
        weights: dict[int, float] = {}
        for held, factor in ((second, -ratio), (first, 1.0)):
            if held < 0:
                continue
            if kind == "JOINT":
                weights[held] = weights.get(held, 0.0) + factor
            elif kind == "TENDON" and len(self._wrapped(held)) == int(model.tendon_num[held]):
                for place, joint in self._wrapped(held):
                    weights[joint] = weights.get(joint, 0.0) + factor * float(model.wrap_prm[place])
            else:
                return None
        return {joint: weight for joint, weight in weights.items() if weight}, offset

    def _joint_springs(self, taken: list[int]) -> dict[int, JointSpring]:
        """By joint that follows none, all that holds it; what holds its followers is reflected to it.

        Of what moves no body that is taken nothing is said.
        """
        leads, springs, gains = self._leads(), dict[int, JointSpring](), list[str]()
        matter = {
            leads.get(joint, joint) for joint in self._single() if int(self._model.jnt_bodyid[joint]) in taken
        }
        for one in (*self._springs_of_joints(), *self._springs_of_tendons(), *self._gains()):
            weights, shift = self._on_leads(one.weights)
            if not matter.intersection(weights):
                continue
            if len(weights) > 1:
                self._notes.left_out.append(f"{one.name}, which holds a sum of joints that move independently")
                continue
            ((joint, weight),) = weights.items()
            # ½ k L² is in J, 1e3 N mm
            stiffness = 1e3 * one.stiffness * weight**2
            if stiffness < LEAST_STIFFNESS:
                self._notes.left_out.append(f"{one.name}, which is softer than any spring of a model file")
                continue
            before = springs.get(joint, JointSpring())
            if one.servo:
                springs[joint] = JointSpring(before.spring, before.servo + stiffness, before.rest)
                gains.append(f"{self._joint_name(joint)} ({one.servo})")
                self._gains_read += 1
            else:
                self._tendons_read += one.tendon
                total, rest = before.spring + stiffness, (one.rest - shift) / weight
                # a spring alone keeps its rest to the last digit
                rest = (before.spring * before.rest + stiffness * rest) / total if before.spring else rest
                springs[joint] = JointSpring(total, before.servo, rest)
        if gains:
            self._notes.changed.append(
                f"the compliance of drives is that of their servos' position gains: {', '.join(gains)}. It is the "
                "controller's, and has nothing of gears"
            )
        return springs

    def _on_leads(self, weights: dict[int, float]) -> tuple[dict[int, float], float]:
        """Weights of the coordinates, mm or rad, of joints that follow none, and what is added to their sum."""
        leads, total, shift = self._leads(), dict[int, float](), 0.0
        for joint, weight in weights.items():
            own = weight / METRE if self._slides(joint) else weight
            if (mimic := self._mimics.get(joint)) is not None:
                shift += own * mimic.offset
                own *= mimic.ratio
            lead = leads.get(joint, joint)
            total[lead] = total.get(lead, 0.0) + own
        return {joint: weight for joint, weight in total.items() if weight}, shift

    def _single(self) -> list[int]:
        """Joints of one freedom."""
        return [joint for joint, kind in enumerate(self._joint_types) if kind in ("HINGE", "SLIDE")]

    def _springs_of_joints(self) -> Iterator[_Elastic]:
        model = self._model
        for joint in self._single():
            stiffness, name = float(model.jnt_stiffness[joint]), f"the spring of joint '{self._joint_name(joint)}'"
            if self._is_linear("jnt", joint, name) and stiffness > 0.0:
                rest = float(model.qpos_spring[int(model.jnt_qposadr[joint])])
                yield _Elastic(name, {joint: 1.0}, stiffness, rest)

    def _is_linear(self, kind: str, index: int, name: str) -> bool:
        """Whether a spring has a constant stiffness; else it is left out."""
        poly = getattr(self._model, f"{kind}_stiffnesspoly", None)
        if poly is None or not poly[index].any():
            return True
        self._notes.left_out.append(f"{name}, which is not linear")
        return False

    def _springs_of_tendons(self) -> Iterator[_Elastic]:
        model = self._model
        for tendon in range(model.ntendon):
            named = self._name("TENDON", tendon) or f"number {tendon + 1}"
            stiffness, name = float(model.tendon_stiffness[tendon]), f"the spring of tendon '{named}'"
            if not self._is_linear("tendon", tendon, name) or not stiffness > 0.0:
                continue
            low, high = (float(v) for v in model.tendon_lengthspring[tendon])
            weights = self._tendon_weights(tendon)
            if not weights:
                self._notes.left_out.append(f"{name}, which is no sum of joints")
            elif low < high:
                self._notes.left_out.append(f"{name}, which is slack from {printed(low)} to {printed(high)}")
            else:
                yield _Elastic(name, weights, stiffness, low, tendon=True)

    def _tendon_weights(self, tendon: int) -> dict[int, float]:
        """Of joints of one freedom whose sum is the length of a fixed tendon; none of another tendon."""
        model, weights = self._model, dict[int, float]()
        single = self._single()
        for k, joint in self._wrapped(tendon):
            if joint not in single:
                return {}
            weights[joint] = weights.get(joint, 0.0) + float(model.wrap_prm[k])
        return weights

    def _gains(self) -> Iterator[_Elastic]:
        """Position gains of actuators: their force falls with the length that they drive."""
        model = self._model
        affine = int(self._mujoco.mjtBias.mjBIAS_AFFINE)
        single = self._single()
        for k in range(model.nu):
            per_length, per_speed = (float(-v) for v in model.actuator_biasprm[k][1:3])
            if int(model.actuator_biastype[k]) != affine or not per_length:
                continue
            name = f"the position gain of actuator '{self._name('ACTUATOR', k) or f'number {k + 1}'}'"
            driven, weights = int(model.actuator_trnid[k][0]), dict[int, float]()
            if self._transmissions[k] in BY_JOINT:
                weights = {driven: 1.0} if driven in single else {}
            elif self._transmissions[k] == "TENDON":
                weights = self._tendon_weights(driven)
            if not weights:
                continue
            if per_length < 0.0:
                self._notes.left_out.append(f"{name}, which pushes away from where it is sent")
                continue
            gear = float(model.actuator_gear[k][0])
            said = f"kp {printed(per_length)}" + (f", kv {printed(per_speed)}" if per_speed else "")
            said += f", gear {printed(gear)}" if gear != 1.0 else ""
            yield _Elastic(name, {j: gear * w for j, w in weights.items()}, per_length, servo=said)

    def robot(self, tip: str | None) -> Robot:
        taken = self._taken(tip)
        self._driven = self._driven_joints(taken)
        self._held = self._joint_springs(taken)
        self._sprung = self._sprung_joints(taken)
        bodies: dict[str, Body] = {WORLD: Body(WORLD)}
        joints: list[RobotJoint] = []
        for index in taken:
            self._add(index, bodies, joints)
        masters = masters_of(joints, self._master)
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
        shift, turns = METRE * np.array(model.body_pos[index]), _turns(model.body_quat[index])
        first = int(model.body_jntadr[index])
        moving = [joint for joint in range(first, first + int(model.body_jntnum[index])) if not self._stands(joint)]
        anchor = np.zeros(3)
        for k, joint in enumerate(moving):
            position = METRE * np.array(model.jnt_pos[joint])
            last = joint == moving[-1] and not position.any()
            child = name if last else f"{name}-{k + 1}"
            bodies.setdefault(child, Body(child, between=True))
            place = _placing(shift, turns, position - anchor)
            if not self._name("JOINT", joint):
                self._notes.changed.append(f"a joint of body '{name}' has no name: '{self._joint_name(joint)}'")
            if self._joint_types[joint] == "BALL":
                joints += self._ball(joint, parent, child, place, bodies)
            else:
                joints.append(self._joint(joint, parent, child, place, self._mimics.get(joint)))
            # a joint's own reference: the angle at which the file shows the machine
            shift, turns, anchor, parent = np.zeros(3), (), position, child
        if parent != name:
            joints.append(RobotJoint(f"{name}-fixed", "fixed", parent, name, _placing(shift, turns, -anchor)))
        centre = METRE * np.array(model.body_ipos[index])
        bodies[name] = Body(
            name, float(model.body_mass[index]), triple(centre),
            inertia=self._inertia(index),
        )  # fmt: skip

    def _names(self, joint: int) -> list[str]:
        """Of a joint, or of the three that stand for a ball."""
        name = self._joint_name(joint)
        return [f"{name}-{axis}" for axis in "xyz"] if self._joint_types[joint] == "BALL" else [name]

    def _ball(
        self, joint: int, parent: str, child: str, place: Placing, bodies: dict[str, Body]
    ) -> list[RobotJoint]:
        """A ball joint as three revolute ones about perpendicular axes, one after the other."""
        model, name, joints = self._model, self._joint_name(joint), list[RobotJoint]()
        driven = joint in self._driven
        # about each axis, to the first order around where it is free of stress; N m are 1e3 N mm
        stiffness = 1e3 * float(model.jnt_stiffness[joint])
        if not self._is_linear("jnt", joint, f"the spring of joint '{name}'") or stiffness < LEAST_STIFFNESS:
            stiffness = 0.0
        passive = not driven and (stiffness > 0.0 or (self._closes and bool(self._driven | self._sprung)))
        home = (0.0, 0.0, 0.0)
        if self._closes and model.nkey:
            address = int(model.jnt_qposadr[joint])
            R = turned(_turns(model.key_qpos[0][address : address + 4]))
            home = (
                float(np.arctan2(-R[1, 2], R[2, 2])), float(np.arcsin(np.clip(R[0, 2], -1.0, 1.0))),
                float(np.arctan2(-R[0, 1], R[0, 0])),
            )  # fmt: skip
        rotor = 1e6 * float(model.dof_armature[int(model.jnt_dofadr[joint])])
        for k, own in enumerate(self._names(joint)):
            behind = child if k == 2 else f"{own}-body"
            bodies.setdefault(behind, Body(behind, between=True))
            joints.append(RobotJoint(
                own, "turns", parent, behind, place, triple(np.eye(3)[k]), home=home[k], rotor=rotor,
                passive=passive, stiffness=stiffness,
            ))  # fmt: skip
            parent, place = behind, Placing()
        self._notes.changed.append(
            f"joint '{name}' is a ball: the joints {', '.join(self._names(joint))} stand in its place, "
            "one after the other"
        )
        if model.jnt_limited[joint]:
            self._notes.left_out.append(f"the limit of joint '{name}', a ball: three joints have none together")
        return joints

    def _stands(self, joint: int) -> bool:
        """Whether a joint is free, and is to hold its body where the file shows it."""
        if self._joint_types[joint] == "FREE" and self._reading.fix_base:
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
        """Say that MuJoCo changed moments of inertia, of shapes; whether all are left out in place of that."""
        problem = f"a body's shapes have {NO_BODYS}"
        remedy = "give it an <inertial>, or say `validate import` without --strict"
        return not self._notes.repaired(
            self._reading.repairs,
            ModelFileError(f"{self._file}: {problem}: {remedy}"),
            doubtful=f"{problem}, and MuJoCo does not name it: those of all bodies are left out",
            changed=f"{problem}: they became their mean, and MuJoCo does not name it",
        )

    def _repair(self, index: int) -> bool:
        """Say that the file's moments of inertia were repaired; whether they are left out in place of that."""
        given, new = (METRE**2 * moments for moments in self._repaired[index])
        if is_of_a_body(inertia_values(given)):
            # within the rounding of the file's numbers
            return False
        name = self._bodies[index]
        self._impossible[name] = given, new
        return not repaired_moments(
            (given, new), FilePlace(self._file, f"body '{name}'"), self._reading, self._notes
        )

    def _joint(self, joint: int, parent: str, child: str, place: Placing, mimic: Mimic | None) -> RobotJoint:
        slides, model = self._slides(joint), self._model
        unit = METRE if slides else 1.0
        axis = triple(model.jnt_axis[joint])
        reference = unit * float(model.qpos0[int(model.jnt_qposadr[joint])])
        if reference:
            place = _referred(place, np.array(axis), reference, slides=slides)
        name, kind = self._joint_name(joint), KINDS[slides]
        if (stands := self._standing.get(joint)) is not None:
            unit_name = "mm" if slides else "rad"
            self._notes.changed.append(
                f"an equality holds joint '{name}': it stands at {printed(stands)} {unit_name}"
            )
            return RobotJoint(name, kind, parent, child, place, axis).standing(stands)
        limits, home = None, 0.0
        if model.jnt_limited[joint]:
            low, high = (unit * float(v) for v in model.jnt_range[joint])
            given = (high, low) if joint in self._exchanged else (low, high)
            where = FilePlace(self._file, f"joint '{name}'")
            limits, home = taken_limits(given, name, where, self._reading, self._notes, slides=slides)
        driven_or_sprung = self._driven | self._sprung
        passive = joint not in driven_or_sprung and self._closes and bool(driven_or_sprung)
        if joint in self._sprung:
            # what follows a joint on a spring follows it as it does a driven one
            passive = mimic is None
        held = self._held.get(joint, JointSpring())
        if held.spring and not held.servo:
            # a servo holds the joint where it is sent, a spring where it is free of stress
            home = held.rest if limits is None else min(max(held.rest, limits[0]), limits[1])
        if self._closes:
            # where the file shows the machine, or its first keyframe has it, its loops are closed
            address = int(model.jnt_qposadr[joint])
            home = unit * float(model.key_qpos[0][address]) if model.nkey else reference
        # kg m² are 1e6 kg mm²; of a joint that slides it is a mass
        rotor = float(model.dof_armature[int(model.jnt_dofadr[joint])]) * (1.0 if slides else 1e6)
        return RobotJoint(
            name, kind, parent, child, place, axis, limits, home, mimic, rotor,
            passive, held.spring + (0.0 if passive else held.servo), held.rest,
        )  # fmt: skip

    def _master(self, name: str) -> RobotJoint:
        joint = next(i for i in range(self._model.njnt) if self._joint_name(i) == name)
        return self._joint(joint, WORLD, name, Placing(), None)

    def _closures(self) -> list[RobotClosure]:
        """What holds two bodies that are taken together: equalities ``connect`` and ``weld``."""
        model, closures = self._model, []
        for k in self._closures_kept:
            ball = CLOSING[self._equality_types[k]]
            names = [self._bodies[i] for i in self._closed_bodies(k)]
            if self._on_sites[k]:
                sites = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
                places = [self._place(model.site_pos[i], model.site_quat[i]) for i in sites]
            else:
                data, plain = model.eq_data[k], np.array([1.0, 0.0, 0.0, 0.0])
                first, second = (data[:3], data[3:6]) if ball else (data[3:6], data[:3])
                places = [self._place(first, plain if ball else data[6:10]), self._place(second, plain)]
            closures.append(
                RobotClosure(self._closure_name(k), (names[0], names[1]), (places[0], places[1]), turns=ball)
            )
        return closures

    def _place(self, position: Array, quaternion: Array) -> Placing:
        return _placing(METRE * np.array(position), _turns(quaternion), np.zeros(3))

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
        if unsupported := [f"{what} ({count})" for what, count in counts.items() if count]:
            left.append(f"what no model file has: {', '.join(unsupported)}")
        for key, what in (("dof_damping", "damping"), ("dof_frictionloss", "friction")):
            if np.any(getattr(model, key)):
                left.append(f"{what} of joints ({key})")
        if np.any(model.body_gravcomp):
            left.append("compensation of weight (gravcomp)")
        off = [i for i in range(1, model.nbody) if i not in taken]
        if off:
            named, mass = ", ".join(self._bodies[i] for i in off), float(model.body_mass[off].sum())
            left.append(f"bodies that are not on the way to '{tip}': {named}, {printed(mass)} kg together")


def _turns(quaternion: Array) -> Turns:
    """Of a quaternion of MuJoCo, which has its scalar first."""
    w, x, y, z = (float(v) for v in quaternion)
    return quaternion_turns(x, y, z, w)


def _placing(shift: Array, turns: Turns, then: Array) -> Placing:
    """Shifted, turned, and shifted again in the turned axes."""
    return Placing(triple(shift + turned(turns) @ then), turns)


def _referred(place: Placing, axis: Array, reference: float, *, slides: bool) -> Placing:
    """So that the coordinate is ``reference`` where the file shows the machine."""
    if slides:
        return _placing(np.array(place.shift), place.turns, -reference * axis)
    x, y, z = axis
    return Placing(place.shift, (*place.turns, ((float(x), float(y), float(z)), -reference)))
