"""Small machines with branches and closed loops, one of each kind, in a posture p without forces."""

from dataclasses import replace

import numpy as np

from helpers.virtual_work import Statics, posture_values
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Closure, Coupling, Joint, PointSpring, RigidOffset, Section
from vjm.rotations import AXES, frame, rotation_from_vector

SECTION = Section(EA=4e7, GJ=3e9, EIy=5e9, EIz=2e9, GAy=2e7, GAz=1e7, mass=4e-3)
X, Y, Z = AXES.values()


def beam(name, length, turned=(0.0, 0.0, 0.0)):
    return Beam(name, length, own_frame=rotation_from_vector(turned), section=SECTION)


def offset(name, *p, turned=(0.0, 0.0, 0.0), mass=0.0):
    return RigidOffset(name, frame(rotation_from_vector(turned), p), mass)


def drawn(chain, part):
    """Frame ``(4, 4)`` behind a part in the posture."""
    return Statics(replace(chain, ends={"it": part}), posture_values(chain, "p")).drawn["it"]


def closed(chain, name, part, other="", turns=False):
    """The machine with a frame behind a part held where its posture has it, on another part or the base."""
    A, B = (drawn(chain, each) if each else np.eye(4) for each in (part, other))
    closure = Closure(name, (part, other), np.array([np.eye(4), np.linalg.inv(B) @ A]), turns)
    return replace(chain, closures=(*chain.closures, closure))


def y_tree():
    parts = (
        Joint("pan", Z, compliance=3e-8, lateral=(2e-9, 4e-9)), beam("stem", 300.0, (0.0, -1.2, 0.3)),
        Joint("left", Y, compliance=5e-8), beam("side", 250.0, (0.2, 0.4, 0.9)),
        Joint("right", X, compliance=2e-8), beam("fore", 280.0, (0.5, -0.3, -0.8)),
    )  # fmt: skip
    return Machine("y-tree", parts, postures={"p": np.zeros(0)}, after={"right": "stem"},
                 held={"p": {"pan": 0.4, "left": 0.3, "right": -0.2}})  # fmt: skip


def bridged_tree():
    """The tree with a spring between a beam's middle and the other's tip, at its free length."""
    chain = y_tree()
    points = np.array([chain.beams[1].tip, chain.beams[2].tip])
    gap = (drawn(chain, "side") - drawn(chain, "fore"))[:3, 3]
    spring = PointSpring("bridge", ("side", "fore"), points, 50.0, float(np.linalg.norm(gap)))
    return replace(chain, point_springs=(spring,))


def four_bar():
    """Crank, elastic coupler, rocker; the tool hangs on the coupler."""
    parts = (
        Joint("drive", Z, compliance=6e-8), offset("crank", 120.0, 0.0, 0.0, mass=1.0),
        Joint("q1", Z, passive=True), beam("coupler", 260.0), Joint("q2", Z, passive=True),
        offset("rocker", 0.0, -190.0, 0.0, mass=1.5), Joint("q3", Z, passive=True),
        beam("tool", 150.0, (0.3, -0.4, 0.6)),
    )  # fmt: skip
    chain = Machine("four-bar", parts, postures={"p": np.array([-0.7, 0.2, 0.4])}, held={"p": {"drive": 0.9}},
                  after={"tool": "coupler"})  # fmt: skip
    return closed(chain, "pivot", "q3")


def leg(name, p, turned, q):
    where = offset(f"{name}/foot", *p, turned=turned)
    parts = (
        where, Joint(f"{name}/drive", Z, slides=True, compliance=4e-5), Joint(f"{name}/q1", X, passive=True),
        Joint(f"{name}/q2", Y, passive=True), beam(f"{name}/rod", 320.0, (0.0, -1.4, 0.0)),
        Joint(f"{name}/q3", Y, passive=True),
    )  # fmt: skip
    return parts, q


def two_legs():
    """Two legs that hold a platform; the last part is the platform."""
    (first, q), (second, r) = (
        leg("a", (0.0, 0.0, 0.0), (0.1, 0.2, 0.0), (0.2, -0.3, 0.25)),
        leg("b", (400.0, 30.0, 20.0), (0.0, -0.5, 0.4), (-0.1, 0.35, 0.2)),
    )
    platform = offset("platform", 200.0, 15.0, 25.0, mass=2.0)
    chain = Machine("two-legs", (*first, *second, platform), postures={"p": np.array([*q, *r])},
                  held={"p": {"a/drive": 40.0, "b/drive": 55.0}},
                  after={"b/foot": "", "platform": "a/q3"})  # fmt: skip
    return closed(chain, "b", "b/q3", "platform")


def palletiser():
    """A rigid parallelogram, held three times over across its plane, that carries an elastic forearm."""
    parts = (
        offset("pillar", 0.0, 0.0, 200.0), Joint("main", Y, compliance=2e-8),
        offset("arm", 0.0, 0.0, 400.0, mass=3.0), Joint("elbow", Y, passive=True),
        offset("head", 80.0, 0.0, 0.0, mass=1.0), Joint("pin", Y, passive=True),
        offset("rod", 0.0, 0.0, -400.0, mass=0.5),
        Joint("foot", Y, passive=True),
        beam("forearm", 350.0, (0.0, 0.2, 0.1)),
    )  # fmt: skip
    chain = Machine("palletiser", parts, postures={"p": np.array([-0.4, 0.4, -0.4])}, held={"p": {"main": 0.4}},
                  after={"forearm": "head"})  # fmt: skip
    return closed(chain, "base", "foot", "pillar")


def coupled():
    """Two passive hinges that a belt couples, the second of which a strut with a ball joint holds."""
    parts = (
        beam("column", 300.0, (0.0, -1.3, 0.2)), Joint("shoulder", Y, passive=True),
        beam("upper", 260.0, (0.3, 0.0, 0.2)),
        Joint("elbow", Z, passive=True), beam("fore", 240.0), beam("strut", 310.0, (0.0, 0.7, -0.5)),
        offset("tool", 30.0, -20.0, 45.0),
    )  # fmt: skip
    chain = Machine("coupled", parts, postures={"p": np.array([0.5, -0.3])},
                  after={"strut": "upper", "tool": "fore"},
                  couplings=(Coupling("belt", (("shoulder", 1.0), ("elbow", 0.6)), 0.32),))  # fmt: skip
    return closed(chain, "ball", "strut", turns=True)


MACHINES = {make.__name__: make for make in (y_tree, bridged_tree, four_bar, two_legs, palletiser, coupled)}
"""By name; each function makes a machine."""


def truth(chain):
    """Stiffness ``(6, 6)`` of the end-effector without load, by virtual work."""
    return Statics(chain, posture_values(chain, "p")).stiffness_as_drawn()


def apart(K, other):
    """Largest difference of two stiffnesses over the largest entries of forces and of moments."""
    size = np.sqrt(np.repeat([np.abs(other[:3, :3]).max(), np.abs(other[3:, 3:]).max()], 3))
    return float(np.abs((K - other) / size[:, None] / size).max())
