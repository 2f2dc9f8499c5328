"""Random trees of turning, sliding, sprung and coupled joints, beams, point springs and weights."""

from __future__ import annotations

import numpy as np

from helpers.energy import Energy
from vjm.model.chain import Chain
from vjm.model.joints import ActuatedJoint, CoupledJoint, PointSpring, SprungJoint
from vjm.model.parts import Beam, RigidOffset
from vjm.rotations import AXES, frame, rotation_from_vector

GRAVITY = (1.2, -2.3, -9.4)


def random_machine(seed: int) -> tuple[Chain, dict[str, float]]:
    """A machine and the coordinates of its joints."""
    rng = np.random.default_rng(seed)
    parts, after, values, scalar = [], {}, {}, []
    for i in range(int(rng.integers(2, 7))):
        if i > 1 and rng.random() < 0.3:
            after[f"j{i}"] = str(rng.choice([part.name for part in parts]))
        joint = _joint(rng, f"j{i}", scalar)
        parts.append(joint)
        if not isinstance(joint, CoupledJoint):
            values[joint.name] = float(rng.uniform(-40, 40) if joint.slides else rng.uniform(-2, 2))
        if not (isinstance(joint, ActuatedJoint) and joint.matrix is not None):
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
    chain = Chain("random", tuple(parts), base, after=after, point_springs=springs, ends=ends)
    return chain, values


def _joint(rng, name, scalar):
    axis = AXES[str(rng.choice(["x", "y", "z"]))]
    slides = rng.random() < 0.3
    size = 10.0 ** rng.uniform(-4, -3) if slides else 10.0 ** rng.uniform(-8, -7)
    lateral = tuple(10.0 ** rng.uniform(-9, -7.5, 2)) if rng.random() < 0.5 else (0.0, 0.0)
    kind = rng.random()
    if kind < 0.2:
        return SprungJoint(name, axis, slides, stiffness=1.0 / size, preload=float(rng.normal()) * 0.01 / size)
    if kind < 0.35 and scalar:
        others = rng.choice(scalar, size=min(len(scalar), 2), replace=False)
        ratios = tuple((str(other), float(rng.uniform(-1, 1))) for other in others)
        return CoupledJoint(
            name, axis, ratios=ratios, as_bent=bool(rng.random() < 0.6), compliance=size, lateral=lateral
        )
    if kind < 0.5:
        return ActuatedJoint(name, axis, slides, matrix=_compliance(rng, 200.0))
    return ActuatedJoint(name, axis, slides, size, lateral)


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


def energy_of(chain: Chain, values: dict[str, float], loads=()) -> Energy:
    """The machine's energy under its weight."""
    return Energy(chain, values, GRAVITY, loads)
