"""Machines with a carriage that rides on a beam: a cantilever, a beam held at both ends, a gantry on two rails."""

import numpy as np

import vjm
from vjm.rotations import frame

LENGTH, EI, EA, MASS = 1000.0, 1.0e10, 1.0e8, 2.0e-3
SECTION = vjm.Section(EA=EA, GJ=8e9, EIy=EI, EIz=EI, mass=MASS)
"""Of the beam: N, N mm², kg/mm."""
PLACES = (0.0, 1.0, 40.0, 123.0, 250.0, 500.0, 731.0, 950.0, 999.0, LENGTH)
"""Ten places of the carriage, mm."""


def carriage(beam: str = "bridge", name: str = "x", **of_joint: object) -> vjm.Joint:
    """The joint that rides on a beam along the chain frame's x axis."""
    return vjm.Joint(name, vjm.axis("x"), slides=True, rides_on=beam, **of_joint)


def cantilever(mass: float = 0.0, section: vjm.Section = SECTION, **of_joint: object) -> vjm.Machine:
    """A clamped beam with a carriage of a mass in kg."""
    parts = [
        vjm.Beam("bridge", LENGTH, section=section), carriage(**of_joint), vjm.RigidOffset("carriage", mass=mass)
    ]  # fmt: skip
    return vjm.build("cantilever", parts, {"there": {"x": 400.0}})


def clamped() -> vjm.Machine:
    """A beam clamped at both ends, with a carriage."""
    parts = [vjm.Beam("bridge", LENGTH, section=SECTION), carriage()]
    held = vjm.Closure("far", ("bridge", ""), np.array([np.eye(4), frame(p=[LENGTH, 0.0, 0.0])]))
    return vjm.build("clamped", parts, {"there": {"x": 400.0}}, closures=[held])


def supported() -> vjm.Machine:
    """A beam between a hinge about y and a ball joint, with a carriage."""
    parts = [
        vjm.Joint("hinge", vjm.axis("y"), passive=True), vjm.Beam("bridge", LENGTH, section=SECTION), carriage()
    ]  # fmt: skip
    held = vjm.Closure("far", ("bridge", ""), np.array([np.eye(4), frame(p=[LENGTH, 0.0, 0.0])]), turns=True)
    return vjm.build("supported", parts, {"there": {"x": 400.0}}, closures=[held])


def on_rails() -> vjm.Machine:
    """A bridge between two carriages on elastic rails along x; a carriage on the bridge bears a ram along z."""
    along_y = frame(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    second = vjm.JointCoupling((("u", 1.0),), as_deflected=False)
    parts = [
        vjm.Beam("rail", 800.0, section=SECTION),
        vjm.RigidOffset("across", frame(p=[0.0, LENGTH, 0.0])),
        vjm.Beam("other-rail", 800.0, section=SECTION),
        carriage("rail", "u", compliance=1e-5, lateral=(1e-9, 2e-9)),
        vjm.RigidOffset("turn", along_y, mass=8.0),
        vjm.Beam("bridge", LENGTH, section=SECTION),
        vjm.RigidOffset("turn-back", np.linalg.inv(along_y), mass=8.0),
        carriage("other-rail", "v", coupling=second, compliance=1e-5),
        carriage("bridge", "w", compliance=2e-5, lateral=(1e-9, 0.0)),
        vjm.RigidOffset("ram", frame(p=[0.0, 0.0, -300.0]), mass=12.0),
    ]
    after = {"across": "", "turn": "u", "bridge": "turn", "turn-back": "bridge"}
    weld = vjm.Closure("on-the-other", ("turn-back", "v"), np.array([np.eye(4), np.eye(4)]))
    postures = {"a": {"u": 300.0, "w": 400.0}, "b": {"u": 790.0, "w": 0.0}, "c": {"u": 0.0, "w": 950.0}}
    return vjm.build("on-rails", parts, postures, after=after, closures=[weld])
