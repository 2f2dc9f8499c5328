"""An imported description against the engine that reads it: frames, weight and mass matrix in random postures."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol
from xml.etree import ElementTree

import numpy as np
import pinocchio
from scipy.linalg import eigh

from helpers.as_pinocchio import mimics
from vjm.design.linear_state import LinearState, loaded_posture, loading
from vjm.design.modes import HEAVIEST, MM_PER_M, mass_matrix, modes_of
from vjm.engines import refuse_unbuildable
from vjm.io.bounded_xml import XmlElement, read_xml
from vjm.io.errors import ModelFileError
from vjm.io.model_file import build_chain
from vjm.io.robot import Reading
from vjm.io.robot_document import Imported
from vjm.io.robot_file import Description, import_robot
from vjm.io.robot_text import LEAST
from vjm.model.machine import Machine
from vjm.model.mechanism import NO_LOADS, Mechanism
from vjm.model.parts import RigidOffset

Array = np.ndarray
State = tuple[Array, Array, dict[str, tuple[Array, Array]]]
"""Mass matrix, torques, and by joint its place and axis."""
G = 9.81
POSTURES = 3
SLIDE = 0.1
"""m, to which joints slide where they have no limits; others turn by 1 rad."""
# rounding over some thirty bodies: the worst of all descriptions are 1e-13 of the longest way, 1e-12 of the largest
# entry; MuJoCo's moments of inertia are turned to principal axes and back
FRAMES, WEIGHT, MASSES, TUNE = 1e-10, 1e-9, 1e-9, 1e-7


STIFFNESS = 1e-7
"""Of the largest entry: central differences of forces that are linear, over steps of `STEP`."""
STEP = 1e-4
"""rad or m."""
MATRIX, FREQUENCIES = "mass matrix", "lowest frequencies"
LOWEST = 6
LEAST_MOMENT = float(LEAST)


class Engine(Protocol):
    """A description as another engine reads it; metres, kilograms, radians."""

    names: list[str]
    """Of its joints of one freedom, in the order of its coordinates."""
    slides: Mapping[str, bool]
    followers: Mapping[str, tuple[str, float, float]]
    """Master, ratio and offset by follower."""
    standing: Mapping[str, float]
    """Coordinates of joints that are held."""
    mass: float
    """Of all that moves."""
    unread: float
    """kg m², the most that moments which stand for none add to an entry of the mass matrix."""

    def stiffness(self) -> Array:
        """Of springs and servos in its coordinates ``(n, n)``."""
        ...

    def springs(self, q: Mapping[str, float]) -> Array:
        """Torques ``(n,)`` of springs, not of servos, on its coordinates."""
        ...

    def at(self, q: Mapping[str, float]) -> State:
        """Mass matrix ``(n, n)``, torques ``(n,)`` that hold it, and places and axes of joints, world."""
        ...


class OfPinocchio:
    """A URDF."""

    def __init__(self, file: Path) -> None:
        self.model = pinocchio.buildModelFromXML(as_pinocchio_reads(file))
        self.model.gravity.linear = np.array([0.0, 0.0, -G])
        self.data = self.model.createData()
        self.names = list(self.model.names[1:])
        kinds = {name: self._joint(name).shortname() for name in self.names}
        self.slides = {name: kind.startswith("JointModelP") for name, kind in kinds.items()}
        self.followers, self.standing = mimics(file), dict[str, float]()
        self.mass, self.unread = float(sum(one.mass for one in self.model.inertias[1:])), 0.0

    def _joint(self, name: str) -> Any:
        return self.model.joints[self.model.getJointId(name)]

    def stiffness(self) -> Array:
        return np.zeros((len(self.names), len(self.names)))

    def springs(self, q: Mapping[str, float]) -> Array:
        return np.zeros(len(self.names))

    def at(self, q: Mapping[str, float]) -> State:
        own = pinocchio.neutral(self.model)
        for name, value in q.items():
            joint = self._joint(name)
            own[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        upper = np.triu(pinocchio.crba(self.model, self.data, own))
        M = upper + upper.T - np.diag(np.diag(upper))
        torque = pinocchio.computeGeneralizedGravity(self.model, self.data, own)
        pinocchio.forwardKinematics(self.model, self.data, own)
        # of one joint it has one axis less
        J = pinocchio.computeJointJacobians(self.model, self.data, own).reshape(6, -1)
        places = {}
        for name in self.names:
            column = J[:, self._joint(name).idx_v]
            place = self.data.oMi[self.model.getJointId(name)].translation
            places[name] = place, column[:3] if self.slides[name] else column[3:]
        return M, torque, places


def as_pinocchio_reads(file: Path) -> str:
    """A URDF without what Pinocchio's reader refuses or no mechanics has; what floats stands where it is."""
    given = read_xml(file).root
    robot = ElementTree.Element("robot", name="robot")
    links, joints = given.all("link"), given.all("joint")
    parents = {one.attributes.get("link") for joint in joints for one in joint.all("parent")}
    if "world" in parents - {link.attributes.get("name") for link in links}:
        # as Drake has it
        ElementTree.SubElement(robot, "link", name="world")
    for link in links:
        element = ElementTree.SubElement(robot, "link", link.attributes)
        for inertial in link.all("inertial"):
            heavy = _copied(element, inertial)
            if heavy.find("mass") is None:
                ElementTree.SubElement(heavy, "mass", value="0")
            moments = heavy.find("inertia")
            if moments is None:
                moments = ElementTree.SubElement(heavy, "inertia")
            moments.attrib = dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), "0") | moments.attrib
    for joint in joints:
        element = _copied(robot, joint)
        if element.get("type") in ("floating", "planar"):
            element.set("type", "fixed")
        limit = element.find("limit")
        if limit is None and element.get("type") in ("revolute", "prismatic"):
            limit = ElementTree.SubElement(element, "limit")
        if limit is not None:
            limit.attrib = {"effort": "0", "velocity": "0"} | limit.attrib
        for name in ("dynamics", "safety_controller", "calibration"):
            for unread in element.findall(name):
                element.remove(unread)
    return ElementTree.tostring(robot, encoding="unicode")


def _copied(onto: ElementTree.Element, given: XmlElement) -> ElementTree.Element:
    """An element of a file with all that is in it but extensions, put into another one."""
    own = {key: value for key, value in given.attributes.items() if ":" not in key}
    element = ElementTree.SubElement(onto, given.tag, own)
    for child in (one for one in given.children if ":" not in one.tag):
        _copied(element, child)
    return element


class OfMujoco:
    """An MJCF file."""

    def __init__(self, file: Path) -> None:
        import mujoco

        self.mujoco = mujoco
        self.model = model = mujoco.MjModel.from_xml_path(str(file))
        kinds = mujoco.mjtJoint
        if np.isin(model.jnt_type, [int(kinds.mjJNT_FREE), int(kinds.mjJNT_BALL)]).any():
            self.model = model = _on_its_base(mujoco, file, model)
        model.opt.gravity[:] = 0.0, 0.0, -G
        # contacts, springs and wind are no part of the machine's weight
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        model.opt.density = model.opt.viscosity = 0.0
        self.data = mujoco.MjData(model)
        body = lambda i: model.body(model.jnt_bodyid[i]).name or f"body-{model.jnt_bodyid[i]}"  # noqa: E731
        self.names = [model.joint(i).name or f"{body(i)}-joint-{i}" for i in range(model.njnt)]
        slide = int(mujoco.mjtJoint.mjJNT_SLIDE)
        self.slides = {name: int(model.jnt_type[i]) == slide for i, name in enumerate(self.names)}
        self.followers, self.standing = {}, {}
        for k in range(model.neq):
            a, b = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
            offset, ratio = model.eq_data[k][:2]
            joints = int(model.eq_type[k]) == int(mujoco.mjtEq.mjEQ_JOINT) and model.eq_active0[k]
            if int(model.eq_type[k]) == int(mujoco.mjtEq.mjEQ_TENDON) and model.eq_active0[k] and b < 0:
                # of one tendon over two joints; files with two tendons have not been met
                wraps = slice(model.tendon_adr[a], model.tendon_adr[a] + model.tendon_num[a])
                if (model.wrap_type[wraps] == int(mujoco.mjtWrap.mjWRAP_JOINT)).all() and model.tendon_num[a] == 2:
                    (b, a), (of_b, of_a) = model.wrap_objid[wraps], model.wrap_prm[wraps]
                    offset, ratio, joints = offset / of_a, -of_b / of_a, True
            if joints and b < 0:
                self.standing[self.names[a]] = float(model.qpos0[model.jnt_qposadr[a]] + offset)
            elif joints and not model.eq_data[k][2:5].any():
                here, there = (float(model.qpos0[model.jnt_qposadr[j]]) for j in (a, b))
                self.followers[self.names[a]] = self.names[b], float(ratio), here + offset - ratio * there
        moves = np.zeros(model.nbody, dtype=bool)
        for i in range(1, model.nbody):
            moves[i] = model.body_jntnum[i] > 0 or moves[model.body_parentid[i]]
        self.mass = float(model.body_mass[moves].sum())
        # each joint turns each of these bodies by its own rate or not at all
        self.unread = LEAST_MOMENT * int(np.isclose(model.body_inertia, LEAST_MOMENT, rtol=1e-3).all(axis=1).sum())

    def stiffness(self) -> Array:
        mujoco, model, data = self.mujoco, self.model, self.mujoco.MjData(self.model)
        # neither weight that is compensated, nor limits of forces, nor muscles
        model.body_gravcomp[:] = 0.0
        model.actuator_forcelimited[:] = model.jnt_actfrclimited[:] = model.tendon_actfrclimited[:] = 0
        model.actuator_biasprm[model.actuator_biastype != int(mujoco.mjtBias.mjBIAS_AFFINE)] = 0.0
        forces = np.zeros((2, model.nv, model.nv))
        for i in range(model.nv):
            for k, way in enumerate((STEP, -STEP)):
                data.qpos[:] = model.qpos0
                data.qpos[i] += way
                mujoco.mj_forward(model, data)
                forces[k, :, i] = data.qfrc_passive + data.qfrc_actuator
        return (forces[1] - forces[0]) / (2.0 * STEP)

    def springs(self, q: Mapping[str, float]) -> Array:
        self.at(q)
        return self.data.qfrc_spring.copy()

    def at(self, q: Mapping[str, float]) -> State:
        mujoco, model, data = self.mujoco, self.model, self.data
        for i, name in enumerate(self.names):
            data.qpos[model.jnt_qposadr[i]] = q[name]
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        places = {}
        for i, name in enumerate(self.names):
            # MuJoCo's anchor of a joint that slides is where it is before it does
            way = q[name] - model.qpos0[model.jnt_qposadr[i]] if self.slides[name] else 0.0
            places[name] = data.xanchor[i] + way * data.xaxis[i], data.xaxis[i].copy()
        return M, data.qfrc_bias.copy(), places


@dataclass(frozen=True)
class Outcome:
    """What became of a description.

    Attributes:
        kind: ``right``; ``right but for moments`` that are said to be left out; ``refused``; ``differs``.
        why: the reason of a refusal without names, or what differs.
    """

    kind: str
    why: str = ""


def _on_its_base(mujoco: Any, file: Path, model: Any) -> Any:
    """A model without its free joints, with three hinges for a ball; joints without names keep their number."""
    spec = mujoco.MjSpec.from_file(str(file))
    for key in list(spec.keys):
        spec.delete(key)
    for i, joint in enumerate(list(spec.joints)):
        body = model.body(model.jnt_bodyid[i]).name or f"body-{model.jnt_bodyid[i]}"
        joint.name = joint.name or f"{body}-joint-{i}"
        # a spring that follows from a time constant and the inertia is that of the machine with its free base
        joint.springdamper, joint.stiffness[0] = (0.0, 0.0), model.jnt_stiffness[i]
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            spec.delete(joint)
        elif joint.type == mujoco.mjtJoint.mjJNT_BALL:
            for name, axis in zip("xyz", np.eye(3), strict=True):
                joint.parent.add_joint(
                    name=f"{joint.name}-{name}", type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, pos=joint.pos,
                    armature=joint.armature, stiffness=joint.stiffness, limited=0, range=(0.0, 0.0),
                )  # fmt: skip
            spec.delete(joint)
    return spec.compile()


def compared(file: Path, engine: type[OfPinocchio] | type[OfMujoco], like: Path | None = None) -> Outcome:
    """Whether the machine of a description is that which the engine reads of it, or of another file."""
    try:
        found = import_robot(Description(file), None, Reading(fix_base=True))
        machine = build_chain(found.document, file.name)
        refuse_unbuildable(machine)
    except ModelFileError as error:
        return Outcome("refused", str(error).removeprefix(f"{file.name}: "))
    theirs = engine(like or file)
    left = [line for line in found.notes.lines() if "moments of inertia" in line]
    rng = np.random.default_rng(0)
    for _ in range(POSTURES):
        q = _random(rng, theirs, found, machine)
        said = _difference(machine, found, theirs, q)
        if said and set(said) <= {MATRIX, FREQUENCIES} and left:
            return Outcome("right but for moments", ", ".join(said.values()))
        if said:
            return Outcome("differs", ", ".join(f"{what} by {value}" for what, value in said.items()))
    return Outcome("right")


def _random(rng: np.random.Generator, theirs: Engine, found: Imported, machine: Machine) -> dict[str, float]:
    """Coordinates of all joints, m and rad."""
    limits = {joint.name: joint.limits for joint in machine.moving}
    q = dict(theirs.standing)
    for name in (one for one in theirs.names if one not in theirs.standing):
        unit = 1e3 if theirs.slides[name] else 1.0
        own = limits.get(found.joints[name])
        wide = SLIDE if theirs.slides[name] else 1.0
        low, high = (-wide, wide) if own is None else np.clip(np.array(own) / unit, -10.0 * wide, 10.0 * wide)
        q[name] = float(rng.uniform(low, high))
    return q | {name: _followed(name, q, theirs) for name in theirs.followers if name in q}


def _followed(name: str, q: Mapping[str, float], theirs: Engine) -> float:
    if name not in theirs.followers:
        return q[name]
    master, ratio, offset = theirs.followers[name]
    return ratio * _followed(master, q, theirs) + offset


def _difference(machine: Machine, found: Imported, theirs: Engine, q: Mapping[str, float]) -> dict[str, str]:
    """What differs by more than rounding, and by how much."""
    label = {found.joints[name]: name for name in theirs.names if name not in theirs.standing}
    unit = {name: 1e3 if slides else 1.0 for name, slides in theirs.slides.items()}
    ours = {joint: q[name] * unit[name] for joint, name in label.items()}
    passive = np.array([ours[joint.name] for joint in machine.joints], dtype=float)
    held = {joint.name: ours[joint.name] for joint in machine.held_joints}
    # the tree alone: its loops hold it in none of these postures
    open_tree = replace(
        machine, closures=(), couplings=(), poses={}, postures={"random": passive}, held={"random": held}
    )
    asked = loaded_posture(open_tree, "random", gravity=(0.0, 0.0, -G))
    model = Mechanism(open_tree.at("random"))
    x = model.configuration(passive)
    state = LinearState(asked, model, x, np.zeros(6), NO_LOADS, np.zeros(6))
    M, torque, places = theirs.at(q)
    # rates of all joints by those that follow none, in the order of our coordinates
    own = (joint.name for joint in (*machine.joints, *machine.held_joints))
    free = sorted(own, key=lambda name: model.built.spans[name].start)
    T = np.zeros((len(theirs.names), len(free)))
    for i, name in enumerate(theirs.names):
        for joint, ratio in _ratios(machine, found.joints[name]).items() if name not in theirs.standing else ():
            T[i, free.index(joint)] = ratio / unit[name]
    M, torque, places = theirs.at(q)
    # kg m² and N m: our rates are rad and mm
    wanted, got = 1e6 * T.T @ M @ T, mass_matrix(state)
    if got.shape != wanted.shape:
        return {"coordinates": f"{len(got) - len(wanted)}"}
    bodies = (part for part in model.chain.parts if model.built.begins[part.name].joint >= 0)
    mass = sum(part.mass for part in bodies if isinstance(part, RigidOffset))
    far = across = 0.0
    length = max([float(np.linalg.norm(place)) for place, _ in places.values()] + [1e-3])
    axes = {joint.name: joint.axis for joint in model.chain.moving}
    for name in label.values():
        place, axis = places[name]
        there = f"{found.joints[name]}-follows"
        there = there if there in model.built.begins else found.joints[name]
        site = model.built.begins[there]
        T_there = state.kinematics.behind[site.joint + 1] @ site.frame
        far = max(far, float(np.abs(1e-3 * T_there[:3, 3] - place).max()) / length)
        across = max(across, float(np.abs(T_there[:3, :3] @ axes[there] - axis).max()))
    # what has no spring stands for nothing yet; springs that no model has are said
    ours_held = np.array([1.0 / axis_compliance(machine, joint) for joint in free])
    to_fill_in = np.array([joint in found.to_fill_in for joint in free])
    held = 1e3 * T.T @ theirs.stiffness() @ T
    unlike = float(np.abs(np.diag(np.where(to_fill_in, 0.0, ours_held)) - held).max())
    unlike /= max(float(np.abs(held).max()), 1e-300)
    off_springs = _off_springs(machine, theirs, q, ours, T, free)
    if any("the spring of" in line or "the position gain of" in line for line in found.left_out):
        unlike = off_springs = 0.0
        held = np.diag(np.where(to_fill_in, 0.0, ours_held))
    out_of_tune = _out_of_tune(state, wanted, held + np.diag(np.where(to_fill_in, ours_held, 0.0)))
    forces, weight = -state.load_forces(loading(asked, model, x)), 1e3 * T.T @ torque
    largest = max(float(np.abs(weight).max()), 1e3 * G * theirs.mass * length)
    heaviest = float(np.abs(wanted).max())
    slides = {joint.name: joint.slides for joint in machine.moving}
    said = {
        "mass": (abs(mass - theirs.mass) / max(theirs.mass, 1e-300), WEIGHT),
        "places of joints": (far, FRAMES), "axes of joints": (across, FRAMES),
        "stiffness": (unlike, STIFFNESS), "torques of springs": (off_springs, WEIGHT),
        FREQUENCIES: (out_of_tune, TUNE + _unread_share(theirs, wanted, [not slides[name] for name in free])),
        "torques of the weight": (float(np.abs(forces - weight).max()) / max(largest, 1e-300), WEIGHT),
        MATRIX: (
            float(np.abs(got - wanted).max()) / max(heaviest, 1e-300),
            MASSES + 1e6 * theirs.unread / max(heaviest, 1e-300),
        ),
    }  # fmt: skip
    return {what: f"{value:.1e}" for what, (value, most) in said.items() if not value < most}


def _off_springs(
    machine: Machine, theirs: Engine, q: Mapping[str, float], ours: Mapping[str, float], T: Array, free: list[str]
) -> float:
    """By how much torques of springs without a drive differ, of the largest that one has a unit from its rest."""
    torques = 1e3 * T.T @ theirs.springs(q)
    sprung = [joint for joint in machine.joints if joint.name in free and joint.held]
    off = [torques[free.index(joint.name)] + (ours[joint.name] - joint.rest) / joint.compliance for joint in sprung]
    return max(map(abs, off), default=0.0) / max((1.0 / joint.compliance for joint in sprung), default=1.0)


def _out_of_tune(state: LinearState, M: Array, K: Array) -> float:
    """By how much the lowest six frequencies differ, relative, from those of a mass matrix and a stiffness.

    Zero where a joint is free: only the closures that the tree does not have hold it.
    """
    if not (np.diag(K) > 0.0).all() or not M.any():
        return 0.0
    inverse = eigh(M, K, eigvals_only=True)[::-1]
    # as our modes: what has no mass has no frequency
    inverse = inverse[inverse > HEAVIEST * inverse[0]][:LOWEST]
    wanted = np.sqrt(MM_PER_M / inverse) / (2.0 * np.pi)
    got = modes_of(state, LOWEST).frequencies
    return float(np.abs(got / wanted - 1.0).max()) if len(got) == len(wanted) else np.inf


def _unread_share(theirs: Engine, M: Array, turns: list[bool]) -> float:
    """The most that moments which stand for none change a frequency, relative.

    They add up to ``unread`` times the number of joints to the mass matrix of the joints that turn.
    """
    if not theirs.unread or not any(turns):
        return 0.0
    light = np.linalg.norm(np.linalg.inv(M)[np.ix_(turns, turns)], 2)
    return float(0.5e6 * theirs.unread * sum(turns) * light)


def axis_compliance(machine: Machine, name: str) -> float:
    """Of a joint about or along its own axis; infinite where it is free."""
    joint = next(joint for joint in machine.moving if joint.name == name)
    return joint.compliance if joint.held else np.inf


def _ratios(machine: Machine, name: str) -> dict[str, float]:
    """A joint's rate by those of the joints that follow none."""
    coupling = {joint.name: joint.coupling for joint in machine.moving}[name]
    if coupling is None:
        return {name: 1.0}
    found: dict[str, float] = {}
    for other, ratio in coupling.ratios:
        for joint, share in _ratios(machine, other).items():
            found[joint] = found.get(joint, 0.0) + ratio * share
    return found
