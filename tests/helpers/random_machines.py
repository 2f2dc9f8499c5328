"""Random machines: trees under their weight, and machines of all kinds with closed loops under all loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from helpers.virtual_work import Statics, with_support
from vjm.model.load_case import COMPONENTS, Load
from vjm.model.machine import Machine
from vjm.model.parts import (
    Beam,
    Closure,
    Coupling,
    Joint,
    JointCoupling,
    Placement,
    PointSpring,
    RigidOffset,
    Section,
)
from vjm.rotations import AXES, frame, rotation_from_vector

GRAVITY = (1.2, -2.3, -9.4)


def random_machine(seed: int) -> tuple[Machine, dict[str, float]]:
    """A machine and the coordinates of its joints."""
    rng = np.random.default_rng(seed)
    parts, after, values, scalar = [], {}, {}, []
    for i in range(int(rng.integers(2, 7))):
        if i > 1 and rng.random() < 0.3:
            after[f"j{i}"] = str(rng.choice([part.name for part in parts]))
        joint = _joint(rng, f"j{i}", scalar)
        parts.append(joint)
        if joint.coupling is None:
            values[joint.name] = float(rng.uniform(-40, 40) if joint.slides else rng.uniform(-2, 2))
        if joint.matrix is None:
            scalar.append(joint.name)
        parts.append(_link(rng, f"l{i}"))
    names = [part.name for part in parts]
    tips = [names[-1]] + [name for name in names if name in after.values()]
    springs = ()
    if rng.random() < 0.4:
        points = np.array([rng.uniform(-300, 300, 3), rng.uniform(-80, 80, 3)])
        if isinstance(parts[-1], Beam):
            # beyond the tip of the one spring that the beam is here
            x, y, z = points[1]
            points[1] = parts[-1].tip + parts[-1].own_frame @ [abs(x), y, z]
        springs = (PointSpring("s", ("", names[-1]), points, float(rng.uniform(0.1, 2.0)), 20.0, 5.0),)
    base = frame(rotation_from_vector(rng.normal(size=3)), rng.uniform(-100, 100, 3))
    ends = {f"e{k}": tip for k, tip in enumerate(tips[:2])}
    chain = Machine("random", tuple(parts), base, after=after, point_springs=springs, ends=ends)
    return chain, values


def _joint(rng, name, scalar):
    axis = AXES[str(rng.choice(["x", "y", "z"]))]
    slides = rng.random() < 0.3
    size = 10.0 ** rng.uniform(-4, -3) if slides else 10.0 ** rng.uniform(-8, -7)
    lateral = tuple(10.0 ** rng.uniform(-9, -7.5, 2)) if rng.random() < 0.5 else (0.0, 0.0)
    kind = rng.random()
    if kind < 0.2:
        return Joint(name, axis, slides, passive=True, compliance=size, preload=float(rng.normal()) * 0.01 / size)
    if kind < 0.35 and scalar:
        others = rng.choice(scalar, size=min(len(scalar), 2), replace=False)
        ratios = tuple((str(other), float(rng.uniform(-1, 1))) for other in others)
        coupling = JointCoupling(ratios, as_deflected=bool(rng.random() < 0.6))
        return Joint(name, axis, compliance=size, lateral=lateral, coupling=coupling)
    if kind < 0.5:
        return Joint(name, axis, slides, matrix=_compliance(rng, 200.0))
    return Joint(name, axis, slides, compliance=size, lateral=lateral)


def _link(rng, name):
    R = rotation_from_vector(rng.normal(size=3))
    if rng.random() < 0.3:
        return Beam(name, float(rng.uniform(80, 400)), own_frame=R, compliance=_compliance(rng, 200.0))
    T = frame(R, rng.uniform(-300, 300, 3))
    return RigidOffset(name, T, float(rng.uniform(0.5, 8)), rng.uniform(-150, 150, 3))


def _compliance(rng, length):
    A = rng.normal(size=(6, 6)) * 0.4 + np.eye(6)
    unit = np.repeat([length, 1.0], 3) * 10.0 ** rng.uniform(-4.5, -3.8)
    return A @ A.T * unit[:, None] * unit


KINDS = ("chain", "arm", "tree", "platform", "four-bar", "strut", "gear", "mixed")
"""Of `random_case`, in the order of the seeds."""
REGULAR = 1e-4
"""Smallest eigenvalue, in units of the machine, and singular value of the constraints that count as regular."""
WITHOUT_LOADS = 0.1
"""Largest turn, rad, by which springs under stress may move a machine from where it is drawn."""


@dataclass(frozen=True)
class Case:
    """A machine in a posture under loads, or with its end-effector displaced.

    Attributes:
        kind: one of `KINDS`.
        chain: the machine; its posture is "drawn".
        gravity: m/s².
        loads: on parts, in full.
        wrenches: dead ones on ends by name.
        imposed: displacement ``(6,)`` of the end-effector; None where it is free.
        free: components of it that are free all the same; the displacement has none.
    """

    kind: str
    chain: Machine
    gravity: tuple[float, float, float] | None
    loads: tuple[Load, ...]
    wrenches: Mapping[str, tuple[float, ...]]
    imposed: tuple[float, ...] | None
    free: tuple[str, ...] = ()

    @property
    def values(self) -> dict[str, float]:
        """Coordinates of its joints by name."""
        passive = zip((joint.name for joint in self.chain.joints), self.chain.postures["drawn"], strict=True)
        return dict(self.chain.held["drawn"]) | {name: float(value) for name, value in passive}

    def statics(self) -> Statics:
        """Its equations."""
        chain, values = self.chain, self.values
        if self.free:
            chain, values = with_support(chain, values, self.free)
        return Statics(
            chain, values, gravity=self.gravity, loads=self.loads, wrenches=self.wrenches, imposed=self.imposed,
        )  # fmt: skip

    def times(self, factor: float) -> Case:
        """Under such a multiple of all loads."""
        return replace(
            self,
            gravity=None if self.gravity is None else tuple(factor * g for g in self.gravity),
            loads=tuple(replace(load, wrench=tuple(factor * w for w in load.wrench)) for load in self.loads),
            wrenches={name: tuple(factor * w for w in wrench) for name, wrench in self.wrenches.items()},
            imposed=None if self.imposed is None else tuple(factor * d for d in self.imposed),
        )


def random_case(seed: int, kind: str = "") -> Case:
    """A machine whose posture as drawn is regular, under loads that bend it by a few degrees."""
    kind = kind or KINDS[seed % len(KINDS)]
    for attempt in range(200):
        rng = np.random.default_rng([seed, attempt])
        case = _Maker(rng).case(kind)
        least, rank, step = case.statics().first_step()
        if least < REGULAR or rank < REGULAR:
            continue
        # springs under stress are what they are: only what the loads add is brought to size
        unloaded = replace(case, gravity=None, loads=(), wrenches={}, imposed=case.imposed and (0.0,) * 6)
        stressed = unloaded.statics().first_step()[2]
        if np.abs(stressed).max() < WITHOUT_LOADS:
            return case.times(float(rng.uniform(0.01, 0.08)) / float(np.abs(step - stressed).max()))
    raise AssertionError(f"seed {seed}: no regular {kind} in 200")


class _Maker:
    """Adds parts behind others; a random number decides what."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.parts: list = []
        self.after: dict[str, str] = {}
        self.values: dict[str, float] = {}
        self.scalar: list[str] = []
        self.loops: list[tuple[str, str, bool]] = []
        self.gears: list[tuple[str, str, float]] = []
        self.springs: list[PointSpring] = []

    def case(self, kind: str) -> Case:
        """A machine of a kind under loads of the size one."""
        rng, at = self.rng, ""
        modules = {
            "chain": [self.chain_joint] * 3,
            "arm": [self.joint] * int(rng.integers(2, 6)),
            "tree": [self.joint] * int(rng.integers(3, 6)),
            "platform": [self.platform],
            "four-bar": [self.joint, self.four_bar, self.four_bar][int(rng.integers(2)) :],
            "strut": [self.joint, self.strut, self.joint],
            "gear": [self.gear, self.joint],
            "mixed": [self.joint, *rng.choice([self.four_bar, self.strut, self.gear, self.platform], 2)],
        }[kind]
        ends = {}
        for number, module in enumerate(modules):
            if kind == "tree" and number and rng.random() < 0.5:
                ends[f"e{len(ends)}"] = at
                at = str(rng.choice(["", *(part.name for part in self.parts)]))
            at = module(at)
        if kind in ("arm", "tree", "strut", "gear", "mixed"):
            # else fewer than six springs may move the end-effector
            at = self.beam(at)
        if kind not in ("chain", "platform") and rng.random() < 0.4:
            points = np.array([rng.uniform(-300, 300, 3), rng.uniform(-80, 80, 3)])
            carrier = next(part.name for part in reversed(self.parts) if not isinstance(part, Beam))
            self.springs.append(PointSpring("s", ("", carrier), points, float(rng.uniform(0.1, 2.0)), 20.0, 5.0))
        chain = self.closed(kind, ends)
        # a chain with passive joints bears nothing unless its end is held
        imposed = kind == "chain" or (kind != "tree" and rng.random() < 0.3)
        free: tuple[str, ...] = ()
        if imposed and rng.random() < 0.4:
            free = tuple(str(c) for c in rng.permutation(COMPONENTS)[: int(rng.integers(1, 3))])
        displacement = rng.normal(size=6) * np.repeat([200.0, 1.0], 3) * [c not in free for c in COMPONENTS]
        size = np.repeat([1.0, 200.0], 3) * 10.0
        gravity = tuple(rng.normal(size=3) * 0.3) if rng.random() < 0.7 else None
        solid = [p.name for p in self.parts if isinstance(p, RigidOffset)]
        loads = []
        if solid and rng.random() < 0.5:
            what = rng.normal(size=6) * size * [1, 1, 1, *[rng.random() < 0.4] * 3]
            loads.append(Load(tuple(what), str(rng.choice(solid)), float(rng.random()), bool(rng.random() < 0.4)))
        wrenches = {}
        if not imposed:
            for name in ("", *ends):
                wrenches[name] = tuple(rng.normal(size=6) * size * [1, 1, 1, *[rng.random() < 0.5] * 3])
        return Case(kind, chain, gravity, tuple(loads), wrenches, tuple(displacement) if imposed else None, free)

    def closed(self, name: str, ends: Mapping[str, str]) -> Machine:
        """The machine with its loops closed where it is drawn."""
        rng = self.rng
        base = frame(rotation_from_vector(rng.normal(size=3)), rng.uniform(-100, 100, 3))
        passive = [part.name for part in self.parts if isinstance(part, Joint) and part.free]
        chain = Machine(
            name,
            tuple(self.parts),
            base,
            postures={"drawn": np.array([self.values[joint] for joint in passive])},
            held={"drawn": {joint: v for joint, v in self.values.items() if joint not in passive}},
            after=self.after,
            point_springs=tuple(self.springs),
            ends=ends,
        )
        drawn = Statics(replace(chain, ends={part.name: part.name for part in self.parts}), self.values).drawn
        closures = []
        for k, (a, b, turns) in enumerate(self.loops):
            own = frame(rotation_from_vector(rng.normal(size=3)), rng.uniform(-20, 20, 3))
            there = np.linalg.inv(drawn[a] if a else np.eye(4)) @ drawn[b] @ own
            closures.append(Closure(f"c{k}", (a, b), np.array([there, own]), turns))
        couplings = [
            Coupling(f"g{k}", ((a, 1.0), (b, ratio)), self.values[a] + ratio * self.values[b])
            for k, (a, b, ratio) in enumerate(self.gears)
        ]
        return replace(chain, closures=tuple(closures), couplings=tuple(couplings))

    def add(self, part, behind: str) -> str:
        """A part behind another."""
        if behind != (self.parts[-1].name if self.parts else ""):
            self.after[part.name] = behind
        self.parts.append(part)
        return part.name

    def name(self, what: str) -> str:
        """A new name."""
        return f"{what}{len(self.parts)}"

    def link(self, behind: str) -> str:
        """A rigid offset, a beam with a matrix, or one with a section."""
        if self.rng.random() < 0.6:
            return self.add(_link(self.rng, self.name("l")), behind)
        return self.beam(behind)

    def beam(self, behind: str) -> str:
        """A beam with a section, whole or split."""
        rng = self.rng
        EIy, EIz = 10.0 ** rng.uniform(8.5, 9.5, 2)
        shear = 10.0 ** rng.uniform(6, 7, 2) if rng.random() < 0.5 else np.full(2, np.inf)
        section = Section(10.0 ** rng.uniform(6.5, 7.5), 0.5 * EIy, EIy, EIz, *shear, mass=5e-3)
        beam = Beam(
            self.name("b"),
            float(rng.uniform(100, 300)),
            own_frame=rotation_from_vector(rng.normal(size=3)),
            section_frame=rotation_from_vector(rng.normal(size=3)),
            end_offset=rng.uniform(-30, 30, 3) * (rng.random() < 0.5),
            section=section,
            count=int(rng.integers(1, 3)),
        )
        if rng.random() < 0.4:
            placement = list(Placement)[int(rng.integers(4))]
            beam = replace(beam, segments=int(rng.integers(1, 4)), placement=placement)
        return self.add(beam, behind)

    def joint(self, behind: str) -> str:
        """A held joint with springs, and a link."""
        joint = _joint(self.rng, self.name("j"), self.scalar)
        if joint.passive and self.rng.random() < 0.5:
            joint = replace(joint, preload=0.0, rest=0.0)
        if joint.coupling is not None:
            # a radian for a hundred millimetres: by a radian for each it would turn over as its slide deflects
            slides = {part.name for part in self.parts if getattr(part, "slides", False)}
            ratios = tuple((name, r / (100.0 if name in slides else 1.0)) for name, r in joint.coupling.ratios)
            joint = replace(joint, coupling=replace(joint.coupling, ratios=ratios))
        at = self.add(joint, behind)
        if joint.coupling is None:
            self.values[at] = float(self.rng.uniform(-40, 40) if joint.slides else self.rng.uniform(-2, 2))
        if joint.rest is not None:
            self.parts[-1] = replace(joint, rest=self.values[at] + float(self.rng.uniform(-0.02, 0.02)))
        if joint.matrix is None:
            self.scalar.append(at)
        return self.link(at)

    def passive(self, behind: str, axis: str = "", slides: bool = False) -> str:
        """A passive joint about or along an axis."""
        axis = axis or str(self.rng.choice(["x", "y", "z"]))
        at = self.add(Joint(self.name("p"), AXES[axis], slides, passive=True), behind)
        self.values[at] = float(self.rng.uniform(-20, 20) if slides else self.rng.uniform(-0.8, 0.8))
        return at

    def chain_joint(self, behind: str) -> str:
        """A drive or mount, a joint, beams and a passive joint, in series."""
        rng = self.rng
        kind = rng.random()
        axis = rotation_from_vector(rng.normal(size=3))[0]
        if kind < 0.3:
            c = 10.0 ** rng.uniform(-4, -3)
            behind = self.add(Joint(self.name("a"), axis, slides=True, fixed=True, compliance=c), behind)
        elif kind < 0.6:
            c = 10.0 ** rng.uniform(-8, -7)
            behind = self.add(Joint(self.name("m"), axis, passive=True, fixed=True, compliance=c), behind)
        else:
            behind = self.joint(behind)
        if rng.random() < 0.7:
            behind = self.passive(behind, slides=bool(rng.random() < 0.2))
        return self.link(self.beam(behind))

    def platform(self, behind: str) -> str:
        """Two to four legs that carry a platform; legs end in welds."""
        feet, rng = [], self.rng
        for _ in range(int(rng.integers(2, 5))):
            at = self.add(self.offset(), behind)
            passive = int(rng.integers(1, 4))
            at = self.joint(at)
            for _ in range(passive):
                at = self.passive(at, slides=bool(rng.random() < 0.15))
                if rng.random() < 0.5:
                    at = self.add(self.offset(80.0), at)
            at = self.beam(at)
            feet.append(self.passive(at) if rng.random() < 0.3 else at)
        at = self.add(self.offset(), feet[-1])
        self.loops += [(at, foot, False) for foot in feet[:-1]]
        return at

    def offset(self, size: float = 200.0) -> RigidOffset:
        """A rigid piece with a mass."""
        rng = self.rng
        T = frame(rotation_from_vector(rng.normal(size=3)), rng.uniform(-size, size, 3))
        return RigidOffset(self.name("o"), T, float(rng.uniform(0.5, 4)), rng.uniform(-50, 50, 3))

    def four_bar(self, behind: str) -> str:
        """A crank with a drive, a coupler that carries on, and a rocker; hinges about one axis."""
        rng = self.rng
        root = self.add(self.offset(80.0), behind)
        drive = Joint(self.name("j"), AXES["z"], compliance=10.0 ** rng.uniform(-8, -7))
        self.values[drive.name] = float(rng.uniform(-0.5, 0.5))
        crank = self.add(self.flat_beam(100.0), self.add(drive, root))
        coupler = self.add(self.flat_beam(150.0), self.passive(crank, "z"))
        foot = self.add(RigidOffset(self.name("o"), frame(np.eye(3), [40.0, 120.0, 0.0])), root)
        rocker = self.add(self.flat_beam(110.0), self.passive(foot, "z"))
        self.loops.append((coupler, self.passive(rocker, "z"), False))
        return self.add(self.offset(100.0), coupler)

    def flat_beam(self, length: float) -> Beam:
        """A beam along x."""
        C = _compliance(self.rng, 200.0)
        return Beam(self.name("b"), float(length * self.rng.uniform(0.7, 1.3)), compliance=C, own_mass=0.5)

    def strut(self, behind: str) -> str:
        """A joint and a link, held by a cylinder between two ball-like joints from the link to what was before."""
        rng = self.rng
        joint = Joint(self.name("j"), AXES["z"], passive=True, compliance=1.0 / (10.0 ** rng.uniform(6, 7)))
        self.values[joint.name] = float(rng.uniform(-1, 1))
        at = self.add(self.offset(), self.add(joint, behind))
        foot = self.add(self.offset(), behind)
        turns = self.passive(self.passive(foot, "y"), "z")
        pushed = self.add(RigidOffset(self.name("o"), frame(np.eye(3), [float(rng.uniform(60, 150)), 0, 0])), turns)
        c = 1.0 / (10.0 ** rng.uniform(2, 3))
        slide = Joint(self.name("c"), AXES["x"], slides=True, passive=True, compliance=c, rest=0.0)
        self.values[slide.name] = float(rng.uniform(10, 40))
        slide = replace(slide, rest=self.values[slide.name] + float(rng.uniform(-1, 1)))
        self.loops.append((at, self.add(slide, pushed), True))
        return at

    def gear(self, behind: str) -> str:
        """A passive joint and a link, geared to another joint whose lever a spring holds."""
        rng = self.rng
        turned = self.passive(behind)
        at = self.add(self.offset(), turned)
        foot = self.add(self.offset(100.0), behind)
        other = self.passive(foot, "z")
        lever = self.add(RigidOffset(self.name("o"), frame(np.eye(3), [100.0, 0.0, 0.0])), other)
        points = np.array([[rng.uniform(-100, 100), 300.0, 0.0], [100.0, 0.0, 0.0]])
        k, name = 10.0 ** rng.uniform(2, 3), self.name("s")
        self.springs.append(PointSpring(name, (foot, lever), points, k, float(rng.uniform(200, 300)), 0.0))
        self.gears.append((turned, other, float(rng.uniform(0.5, 2.0)) * float(rng.choice([-1, 1]))))
        return at
