"""Parameters of machines that only tests ask for."""

from __future__ import annotations

from dataclasses import replace

from vjm.model.machine import Machine
from vjm.model.parameters import Parameter
from vjm.model.parts import Beam, Joint, RigidOffset
from vjm.rotations import AXES, frame, rotation_from_vector


def with_part(chain, changed):
    return replace(chain, parts=tuple(changed if part.name == changed.name else part for part in chain.parts))


def part_of(chain, name):
    return next(part for part in chain.parts if part.name == name)


def joint_compliance(chain: Machine, joint: str) -> Parameter:
    """Compliance of a joint about or along its axis."""
    part = part_of(chain, joint)
    unit = "mm/N" if part.slides else "rad/(N mm)"
    value = part.compliances[0]

    def apply(chain: Machine, value: float) -> Machine:
        return with_part(chain, part_of(chain, joint).with_compliance(0, value))

    return Parameter(f"{joint} own compliance", unit, value, value, apply)


def orientation(chain: Machine, name: str, axis: str) -> Parameter:
    """Turn of a part about an axis x, y or z of the chain frame at its root, in rad from how it stands."""
    given = part_of(chain, name)

    def apply(chain: Machine, value: float) -> Machine:
        R, part = rotation_from_vector(AXES[axis] * value), part_of(chain, name)
        match part, given:
            case Beam(), Beam():
                return with_part(chain, replace(part, own_frame=R @ given.own_frame))
            case RigidOffset(), RigidOffset():
                return with_part(chain, replace(part, transform=frame(R) @ given.transform))
            case Joint(), Joint():
                return with_part(chain, replace(part, axis=R @ given.axis))
            case _:
                raise AssertionError(name)

    return Parameter(f"{name} turn about {axis}", "rad", 0.0, 1.0, apply)
