"""Machines that the tests of design share."""

import numpy as np
import pytest

from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import translation

E, DENSITY, DIAMETER, LENGTH = 210_000.0, 7.85e-6, 10.0, 1000.0
"""Of a round steel rod: N/mm², kg/mm³, mm."""


def rod(*, stiff_along: float = 1.0) -> Section:
    """Section of a round rod; with a factor on EA its rotary inertia and its axial give fall by as much."""
    area, second = np.pi * DIAMETER**2 / 4.0, np.pi * DIAMETER**4 / 64.0
    return Section(
        EA=stiff_along * E * area, GJ=E / 2.6 * 2.0 * second, EIy=E * second, EIz=E * second, mass=DENSITY * area
    )


@pytest.fixture(scope="session")
def cantilever():
    """A slender cantilever along x with a point mass at its tip, kg."""

    def made(tip: float = 0.0, stiff_along: float = 1e6) -> Machine:
        parts = (Beam("rod", LENGTH, section=rod(stiff_along=stiff_along)), RigidOffset("tip", mass=tip))
        return Machine("cantilever", parts, postures={"straight": np.zeros(0)})

    return made


@pytest.fixture(scope="session")
def six_joints():
    """An arm of six joints with elastic gears and two beams, in a bent posture."""
    axes = {"pan": "z", "lift": "y", "elbow": "y", "wrist-1": "y", "wrist-2": "z", "wrist-3": "x"}
    gears = dict(zip(axes, (1e-8, 2e-8, 3e-8, 1e-7, 1.5e-7, 2e-7), strict=True))
    unit = dict(zip("xyz", np.eye(3), strict=True))
    between = {
        "pan": RigidOffset("column", translation((0.0, 0.0, 300.0))),
        "lift": Beam("upper", 600.0, section=rod()),
        "elbow": Beam("fore", 500.0, section=rod()),
        "wrist-1": RigidOffset("hand", translation((100.0, 20.0, 0.0))),
        "wrist-2": RigidOffset("palm", translation((80.0, 0.0, -30.0))),
        "wrist-3": RigidOffset("tool", translation((60.0, 10.0, 40.0))),
    }
    parts = []
    for name, axis in axes.items():
        lateral = (5e-9, 4e-9) if name == "lift" else (0.0, 0.0)
        parts += [Joint(name, unit[axis], compliance=gears[name], lateral=lateral), between[name]]
    bent = dict(zip(axes, (0.3, -0.6, 1.1, 0.4, -0.7, 0.2), strict=True))
    return Machine("six-joints", tuple(parts), postures={"bent": np.zeros(0)}, held={"bent": bent})
