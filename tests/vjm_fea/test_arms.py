"""Arms of actuated, sprung and coupled joints: the virtual joint model against Exudyn, from the same file."""

import numpy as np
import pytest
from helpers.riding import PLACES, cantilever, clamped, on_rails

import vjm
from vjm.baselines.msa import msa_machine
from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.machine.equilibria import equilibria
from vjm.model.laws import DeadZone, OneSided, Polynomial, StrainWave
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint, JointCoupling, PointSpring, RigidOffset
from vjm.postures import in_posture
from vjm.rotations import AXES, frame, rotation_from_vector
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.opensees import OpenSeesEngine, available

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


# A joint that rides on a beam: the virtual joint method against two finite element engines.


ENGINES = [
    ExudynEngine,
    pytest.param(OpenSeesEngine, marks=pytest.mark.skipif(not available(), reason="OpenSeesPy is not installed")),
]
WRENCH = (100.0, 200.0, -1500.0, 1e4, 0.0, 3e3)


def at_end(machine, posture, engine):
    """Displacement of the end under weight and a wrench."""
    there, label = in_posture(machine, posture)
    case = LoadCase(
        label, 1.0, "load", free=COMPONENTS, loads=(Load(WRENCH, ""),), gravity=(0.0, 0.0, -9.81), steps=1
    )  # fmt: skip
    return engine.trace(there, case).points[-1].displacement


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "machine", [cantilever(5.0, compliance=1e-5, lateral=(1e-8, 2e-8)), clamped()], ids=lambda machine: machine.name
)
def test_ten_places_of_a_carriage(machine, engine):
    for place in PLACES:
        found, other = (at_end(machine, {"x": place}, each) for each in (vjm.VjmEngine(16), engine()))
        size = np.abs(found[:3]).max()
        # 16 elements on the beam: 1/16² of the second order of a bend of 0.07 rad, and of the fourth
        assert other[:3] == pytest.approx(found[:3], abs=2e-5 * size + 1e-12), place


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("posture", ["a", "b", "c"])
def test_a_bridge_on_two_elastic_rails(engine, posture):
    machine = on_rails()
    found, other = (at_end(machine, posture, each) for each in (vjm.VjmEngine(16), engine()))
    assert other[:3] == pytest.approx(found[:3], abs=2e-5 * np.abs(found[:3]).max())


@pytest.mark.parametrize("posture", ["a", "b", "c"])
def test_matrix_structural_analysis_of_the_bridge(posture):
    """Without load both are exact for beams."""
    machine = on_rails()
    found = vjm.stiffness(machine, posture, wrench=(0.0,) * 6).unloaded
    exact = msa_machine(machine.at(posture), machine.posture(posture)).end_stiffness()
    assert found == pytest.approx(exact, rel=1e-7, abs=1e-7 * np.abs(exact).max())


# Laws of springs in the finite element engines: their paths are those of the virtual joint method.


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


@pytest.mark.quick_cases(4)
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
