"""A closure of two parts' ends, as a five-bar linkage has it: against its virtual work."""

import numpy as np
import pytest

import vjm

CRANK, ROD, APART, SOFT, FORCE = 200.0, 300.0, 200.0, 1e-7, 1.0


def test_a_closure_without_frames_holds_the_parts_ends_together():
    section = vjm.shape("square_tube", width_mm=40.0, wall_mm=3.0).stiffness()
    about = vjm.axis("z")

    def arm_of(side):
        knee = vjm.Joint(f"{side}-knee", about, passive=True)
        crank, rod = (
            vjm.Beam(f"{side}-{name}", size, section=section) for name, size in (("a", CRANK), ("b", ROD))
        )
        return [vjm.Joint(side, about, compliance=SOFT), crank, knee, rod]

    angle = 2.0
    rise = np.arccos((0.5 * APART - CRANK * np.cos(angle)) / ROD)
    posture = {"left": angle, "left-knee": rise - angle, "right": np.pi - angle, "right-knee": angle - rise}
    parts = [*arm_of("left"), vjm.RigidOffset("apart", vjm.translation([APART, 0.0, 0.0])), *arm_of("right")]
    tips = vjm.Closure("tips", ("left-b", "right-b"), turns=True)
    machine = vjm.build("five-bar", parts, {"drawn": posture}, after={"apart": ""}, closures=[tips])
    moved = vjm.stiffness(machine, "drawn", wrench=(0.0, -FORCE, 0.0, 0.0, 0.0, 0.0)).displacement
    # dx = 0 gives the rods' turn by the cranks', and virtual work the motors' torque
    turn = -CRANK * np.sin(angle) / (ROD * np.sin(rise))
    torque = 0.5 * FORCE * (CRANK * np.cos(angle) + ROD * np.cos(rise) * turn)
    along = 0.5 * FORCE / np.sin(rise)
    energy = (
        SOFT * torque**2
        + (torque / CRANK) ** 2 * CRANK**3 / (3.0 * section.EIz)
        + along**2 * ROD / section.EA
        + (along * np.cos(rise - angle)) ** 2 * CRANK / section.EA
    )
    # large deflections change 2.6e-3 mm of 200 mm by 1e-5 and more
    assert moved[1] == pytest.approx(-2.0 * energy / FORCE, rel=1e-4)
