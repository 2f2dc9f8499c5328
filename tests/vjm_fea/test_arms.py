"""Arms of actuated, sprung and coupled joints: the virtual joint model against Exudyn, from the same file."""

from __future__ import annotations

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.machine.equilibria import equilibria
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint, JointCoupling, RigidOffset
from vjm.rotations import AXES, frame, rotation_from_vector
from vjm_fea.exudyn.engine import ExudynEngine

WEIGHT = (0.0, 0.0, -9.81)
TEN_KG = Load((0.0, 0.0, -98.1, 0.0, 0.0, 0.0))


def under_weight(posture: str, *loads: Load) -> LoadCase:
    """The free end under weight and loads."""
    return LoadCase(posture, 1.0, "load", free=COMPONENTS, gravity=WEIGHT, loads=loads, steps=4)


@pytest.mark.parametrize("posture", ["work", "stretched"])
def test_ur10_under_its_weight_and_ten_kilograms(posture: str):
    chain, load_case = load_chain("ur10"), under_weight(posture, TEN_KG)
    found, other = (engine.trace(chain, load_case).points[-1] for engine in (VjmEngine(), ExudynEngine()))
    # both are rigid links on the same springs and solve to 1e-11 of the residual
    for part in (slice(0, 3), slice(3, 6)):
        size = np.abs(found.displacement[part]).max()
        assert other.displacement[part] == pytest.approx(found.displacement[part], abs=1e-10 * size)
    tree = Mechanism(chain.split())
    batch = equilibria(tree, tree.posture(posture), gravity=WEIGHT, wrench=np.array(TEN_KG.wrench))
    assert batch.deflection[0, 0, :3] == pytest.approx(found.displacement[:3], abs=1e-10)


def test_ur10s_stiffness_is_that_of_differences():
    model = Mechanism(load_chain("ur10").split())
    q, wrench = model.posture("work"), np.array([30.0, -20.0, -98.1, 0.0, 0.0, 0.0])
    found = equilibria(model, q, gravity=WEIGHT, wrench=wrench)
    columns = []
    for i in range(6):
        slopes = []
        for size in (2.0, 4.0) if i < 3 else (600.0, 1200.0):
            ahead, behind = (
                equilibria(model, q, gravity=WEIGHT, wrench=wrench + s * np.eye(6)[i]) for s in (size, -size)
            )
            turned = 0.5 * (ahead.rotation @ np.swapaxes(behind.rotation, -1, -2))[0, 0]
            spin = [turned[c, b] - turned[b, c] for b, c in ((1, 2), (2, 0), (0, 1))]
            slopes.append(np.concatenate([(ahead.position - behind.position)[0, 0], spin]) / (2.0 * size))
        columns.append((4.0 * slopes[0] - slopes[1]) / 3.0)
    C = np.array(columns).T
    scale = np.sqrt(np.outer(np.diag(C), np.diag(C)))
    # positions of a metre to 1e-13 over differences of 0.05 mm
    assert found.compliance[0, 0] / scale == pytest.approx(C / scale, abs=1e-8)
    assert found.stiffness[0, 0] @ found.compliance[0, 0] == pytest.approx(np.eye(6), abs=1e-8)


def test_an_arm_of_two_beams_by_names_of_its_own():
    chain, load_case = load_chain("planar-2r"), under_weight("bent", TEN_KG)
    found, other = (engine.trace(chain, load_case).points[-1] for engine in (VjmEngine(16), ExudynEngine()))
    # 16 segments a beam, of fourth order here and there: 1.5e-7 measured
    assert other.displacement[:3] == pytest.approx(
        found.displacement[:3], abs=1e-6 * np.abs(found.displacement).max()
    )


def test_segments_by_part_split_that_part():
    chain = load_chain("planar-2r")
    split = {beam.name: beam.segments for beam in VjmEngine(8, parts=(("fore", 3),)).split(chain).beams}
    assert split == {"upper": 8, "fore": 3}
    foot = {beam.name: beam.segments for beam in VjmEngine(16).split(load_chain("orthoglide-chain")).beams}
    assert foot == {"foot": None, "link": 16}
    with pytest.raises(ValueError, match="no beam 'frame' to split"):
        VjmEngine(8, parts=(("frame", 3),)).split(chain)


def all_kinds(as_deflected: bool) -> Machine:
    """Lateral springs, a sliding drive, a preloaded spring, a coupling and a 6×6 joint compliance."""

    def link(name: str, x: float, seed: int) -> RigidOffset:
        T = frame(rotation_from_vector(np.random.default_rng(seed).normal(size=3)), [x, 30.0, -40.0])
        return RigidOffset(name, T, 2.0, np.array([0.4 * x, 10.0, 0.0]))

    matrix = np.diag([1e-5, 0.0, 2e-5, 3e-9, 0.0, 5e-9])
    parts = (
        Joint("pan", AXES["z"], compliance=1e-8, lateral=(2e-9, 3e-9)), link("a", 200.0, 0),
        Joint("boom", AXES["x"], slides=True, compliance=1e-4), link("b", 150.0, 1),
        Joint("spring", AXES["y"], passive=True, compliance=2.5e-08, preload=2e5), link("c", 180.0, 2),
        Joint(
            "follower", AXES["y"], compliance=2e-8,
            coupling=JointCoupling((("pan", -0.5),), as_deflected=as_deflected),
        ),
        link("d", 120.0, 3), Joint("wrist", AXES["x"], matrix=matrix), link("e", 60.0, 4),
    )  # fmt: skip
    held = {"home": {"pan": 0.4, "boom": 35.0, "spring": 0.3, "wrist": -0.5}}
    return Machine("all", parts, postures={"home": np.zeros(0)}, held=held)


@pytest.mark.parametrize("as_deflected", [False, True])
def test_every_kind_of_joint_is_exudyns(as_deflected):
    chain, load_case = all_kinds(as_deflected), under_weight("home", TEN_KG)
    paths = [engine.trace(chain, load_case) for engine in (VjmEngine(), ExudynEngine())]
    for start_or_end in (0, -1):
        found, other = (path.points[start_or_end] for path in paths)
        # the drawn posture counts from where nothing is prestressed; both solve to 1e-11 of the residual
        size = np.abs(found.displacement[:3]).max()
        assert size > 0.1
        assert other.displacement[:3] == pytest.approx(found.displacement[:3], abs=1e-9 * size)


def test_a_coupling_as_bent_is_the_trees():
    chain = all_kinds(as_deflected=True)
    at_end = VjmEngine().trace(chain, under_weight("home", TEN_KG)).points[-1]
    tree = Mechanism(chain.split())
    found = equilibria(tree, tree.posture("home"), gravity=WEIGHT, wrench=np.array(TEN_KG.wrench))
    assert found.deflection[0, 0, :3] == pytest.approx(at_end.displacement[:3], abs=1e-9)
