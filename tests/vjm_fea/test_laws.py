"""Laws of springs in the finite element engines: their paths are those of the virtual joint method."""

from __future__ import annotations

import numpy as np
import pytest

import vjm
from vjm.model.laws import DeadZone, OneSided, Polynomial, StrainWave
from vjm.model.parts import PointSpring

SECTION = vjm.Section(EA=7e6, GJ=2e8, EIy=3e8, EIz=3e8, GAy=2e6, GAz=2e6)
EVERYWHERE = ("x", "y", "z", "rx", "ry", "rz")


def arm(law, *, slides=False, springs=()):
    """A stiff beam behind a joint with a law, which a spring may hold too."""
    joint = vjm.Joint("elbow", vjm.axis("x" if slides else "z"), slides, law=law)
    beam = vjm.Beam("fore", 300.0, section=SECTION)
    tip = vjm.RigidOffset("tip", vjm.translation((50.0, 0.0, 0.0)))
    return vjm.build("arm", [joint, beam, tip], point_springs=springs)


STAY = PointSpring(
    "stay", ("", "tip"), np.array([[0.0, 400.0, 0.0], [0.0, 0.0, 0.0]]), free_length=528.0, law=OneSided(20.0, 0.05)
)
CASES = {
    "gear": (arm(StrainWave(3.1e6, 5e6, 5.7e6, 1.4e4, 4.8e4)), (0.0, 300.0, 0.0)),
    "hardening": (arm(Polynomial(1e6, (-0.1, 0.1), K3=1e9)), (0.0, 200.0, 0.0)),
    "backlash": (arm(DeadZone(3e6, 4e-3, inside=2e5)), (0.0, 200.0, 0.0)),
    "slide": (arm(DeadZone(500.0, 1.0, inside=50.0), slides=True), (800.0, 0.0, 0.0)),
    "cable": (
        arm(Polynomial(1e6, (-0.2, 0.2)), springs=[STAY]),
        (0.0, -200.0, 0.0),
    ),
}  # fmt: skip


@pytest.mark.parametrize("engine", ["exudyn", "opensees"])
@pytest.mark.parametrize("name", CASES)
def test_the_path_is_the_virtual_joint_methods(name, engine):
    module = "exudyn" if engine == "exudyn" else "openseespy"
    pytest.importorskip(module, reason=f"{module}, which is compared, is not installed")
    machine, force = CASES[name]
    machine = machine.rigid_in_shear() if engine == "opensees" else machine
    size = float(np.linalg.norm(force))
    load = vjm.Load((*(np.array(force) / size), 0.0, 0.0, 0.0))
    case = vjm.LoadCase("home", size, "load", free=EVERYWHERE, loads=(load,), steps=8)
    own, other = (vjm.trace(machine, case, word) for word in ("vjm-16", engine))
    assert own.complete
    assert other.complete
    along = np.flatnonzero(force)[0]
    for s in case.length * np.arange(1, 9) / 8:
        a, b = (path.displacement[int(np.argmin(np.abs(path.s - s)))] for path in (own, other))
        # 16 springs and 16 elements are within 1e-6 of a beam; the laws are the same
        assert b[along] == pytest.approx(a[along], rel=1e-5)
