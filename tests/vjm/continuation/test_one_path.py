"""No step of a ramp leads across a fold, wherever the ramp ends and however many steps it has."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.file_texts import model_text, table_text
from scipy.optimize import minimize_scalar

import vjm
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.model.load_case import ARC, COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import AXES, translation

PUSH = Load((0.0, 0.0, -1.0, 0.0, 0.0, 0.0))
FAR = 900.0
"""mm: how far off the part stands that makes the machine's length another than the toggle's."""


SLIDE = {"kind": "joint", "motion": "slides", "axis": "z"}


def limit(half, rise, k):
    """Largest load on the apex of two springs, N: von Mises' truss, where l³ = l₀ b² (springs' law k (l − l₀))."""
    free = np.hypot(half, rise)
    length = np.cbrt(free * half**2)
    return 2.0 * k * (free / length - 1.0) * np.sqrt(length**2 - half**2)


def toggle(name, parent, z, half, rise, k):
    """An apex that slides along z on its parent, and two springs without stress that hold it up."""
    springs = [
        table_text(
            "[point_springs]", name=f"{name}{side}", between=[parent, name],
            points_mm=[[sign * half, 0.0, z - rise], [0.0, 0.0, z]],
            stiffness_N_per_mm=k, free_length_mm=float(np.hypot(half, rise)),
        )
        for side, sign in (("a", -1.0), ("b", 1.0))
    ]  # fmt: skip
    guide = table_text("[joints]", name=f"{name}_guide", between=[parent, name], at_mm=[0.0, 0.0, z], **SLIDE)
    return [table_text("[bodies]", name=name), guide], springs


def stack(tmp_path, toggles, soft):
    """Toggles on each other, on a body that a spring of ``soft`` N/mm carries, and a part far off without load."""
    bodies, springs, parent = [
        table_text("[bodies]", name="arm"),
        table_text(
            "[joints]", name="arm_guide", between=["ground", "arm"], at_mm=[0.0, 0.0, 0.0], stiffness_N_per_mm=soft,
            **SLIDE,
        ),
        table_text("[bodies]", name="far"),
        table_text(
            "[joints]", name="far_hinge", kind="joint", stiffness_Nmm_per_rad=1e6, between=["ground", "far"],
            at_mm=[FAR, 0.0, 0.0], axis="y",
        ),
    ], [], "arm"  # fmt: skip
    for i, sizes in enumerate(toggles):
        body, own = toggle(f"apex{i}", parent, 60.0 * (i + 1), *sizes)
        bodies, springs, parent = bodies + body, springs + own, f"apex{i}"
    file = tmp_path / "stack.toml"
    file.write_text(
        model_text(
            "stack",
            *bodies,
            *springs,
            kind="bodies",
            end={"body": parent, "at_mm": [0.0, 0.0, 60.0 * len(toggles)]},
        ),
        encoding="utf-8",
    )
    return vjm.load(str(file))


def pushed(machine, to, steps):
    posture = next(iter(machine.postures))
    return VjmEngine().trace(machine, LoadCase(posture, to, "load", free=COMPONENTS, loads=(PUSH,), steps=steps))


@pytest.mark.quick_cases(18)
@pytest.mark.parametrize("steps", [None, 1, 2, 3, 7, 50])
@pytest.mark.parametrize("to", [45.28, 45.3, 50.0, 600.0, 1500.0, 3000.0, 2e4, 1e7, 1e9])
def test_a_toggle_has_its_limit_wherever_the_ramp_ends(tmp_path, to, steps):
    truss = (300.0, 60.0, 50.0)
    force = limit(*truss)
    # the case's own number
    assert force == pytest.approx(45.2872, abs=5e-5)
    path = pushed(stack(tmp_path, [truss], soft=1e3), to, steps)
    assert np.all(path.unstable == 0)
    assert path.points[-1].ramp <= force * (1.0 + 1e-9)
    if to < force:
        assert path.complete
    else:
        assert path.events[-1].kind is EventKind.LIMIT
        # Newton's tolerance of 1e-11 is of a scale of 1e6 N mm over 900 mm
        assert path.events[-1].force == pytest.approx(force, rel=1e-8)
        assert path.stopped.startswith("the load is greatest at 45.287")


@pytest.mark.quick_cases(4)
@pytest.mark.parametrize("seed", range(12))
def test_the_weakest_of_several_toggles_is_found(tmp_path, seed):
    """Toggles on each other, and a spring that moves far more than they: each bears the load by itself."""
    random = np.random.default_rng(seed)
    toggles = [
        (random.uniform(50.0, 400.0), 10.0 ** random.uniform(1.0, 1.7), 10.0 ** random.uniform(1.0, 2.5))
        for _ in range(random.integers(1, 4))
    ]
    force = min(limit(*sizes) for sizes in toggles)
    machine = stack(tmp_path, toggles, soft=10.0 ** random.uniform(-1.0, 2.0))
    for factor in (0.9, 1.0 + 10.0 ** random.uniform(-2.0, 0.0), 10.0 ** random.uniform(0.3, 5.0)):
        steps = random.choice(np.array([None, 1, 2, 3, 5, 12, 40], dtype=object))
        path = pushed(machine, factor * force, steps)
        if factor < 1.0:
            assert path.complete, (factor, steps)
        else:
            assert path.events[-1].kind is EventKind.LIMIT, (factor, steps)
            # tolerance as above, of loads down to a thousandth of that
            assert path.events[-1].force == pytest.approx(force, rel=1e-5), (factor, steps)


BAR, RISE, EA = 100.0, np.deg2rad(20.0), 1e4


@pytest.mark.parametrize("steps", [None, 1, 2, 5, 30])
@pytest.mark.parametrize("share", [0.98, 1.02, 1.5, 3.0, 20.0])
def test_a_driven_displacement_stops_where_it_snaps_back(share, steps):
    """A bar to a crown that a soft spring pushes: δ = w + c P(w) folds where 1 + c P'(w) = 0."""
    c, height, half = 0.3, BAR * np.sin(RISE), BAR * np.cos(RISE)

    def driven(w):
        length = np.hypot(half, height - w)
        return w - c * EA * (length / BAR - 1.0) * (height - w) / length

    top = minimize_scalar(lambda w: -driven(w), bounds=(0.0, height), method="bounded", options={"xatol": 1e-10})
    fold = -top.fun
    stiff = Section(EA, 1e10, 1e10, 1e10)
    parts = (
        Joint("q1", AXES["z"], passive=True), Beam("left", BAR, section=stiff),
        Joint("q2", AXES["z"], passive=True),
        Joint("spring", AXES["y"], slides=True, fixed=True, compliance=c),
    )  # fmt: skip
    machine = Machine("half", parts, postures={"up": np.array([RISE, -RISE])})
    path = VjmEngine(1).trace(machine, LoadCase("up", -share * fold, "y", steps=steps))
    assert np.all(path.unstable == 0)
    if share < 1.0:
        assert path.complete
    else:
        assert path.events[-1].kind is EventKind.FOLD
        # flat at the fold: the search's own tolerance squared, and rounding
        assert path.events[-1].s == pytest.approx(fold, rel=1e-9)
        assert path.stopped.startswith("the controlled displacement turns back")


@pytest.mark.parametrize(("reach", "steps"), [(1.0, 1), (10.0, 2), (1e3, 3), (1e6, 1)])
def test_a_hardening_path_without_a_fold_is_followed_to_its_end(tmp_path, reach, steps):
    """The same springs pulled: F = 2k (1 − l₀/l) z grows for ever, and no long step of it is refused."""
    half, rise, k = 300.0, 60.0, 50.0
    machine = stack(tmp_path, [(half, rise, k)], soft=1e3)
    posture = next(iter(machine.postures))
    pull = Load((0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
    load_case = LoadCase(posture, reach, "load", free=COMPONENTS, loads=(pull,), steps=steps)
    path = VjmEngine().trace(machine, load_case)
    assert path.complete
    assert len(path.points) == steps + 1
    z = rise + path.points[-1].displacement[2] - reach / 1e3
    # Newton's tolerance on a stiffness of 4 N/mm
    assert 2.0 * k * (1.0 - np.hypot(half, rise) / np.hypot(half, z)) * z == pytest.approx(reach, rel=1e-7)


@pytest.mark.parametrize("share", [0.5, 0.99, 1.01, 2.0, 10.0, 1e3])
def test_a_stiffness_beyond_the_fold_is_refused(tmp_path, share):
    """Under the whole load in one go there is a stable state, which no path from the unloaded one leads to."""
    truss = (300.0, 60.0, 50.0)
    machine = stack(tmp_path, [truss], soft=1e3)
    wrench = (0.0, 0.0, -share * limit(*truss), 0.0, 0.0, 0.0)
    if share < 1.0:
        assert np.linalg.eigvalsh(vjm.stiffness(machine, wrench=wrench).loaded_compliance)[-1] > 0.0
    else:
        with pytest.raises(NoConvergenceError, match=f"stability is lost at {1.0 / share:.6g} of"):
            vjm.stiffness(machine, wrench=wrench)


# Arms of sprung joints under load: their buckling loads in closed form, and none where there is none.


K, A = 2e5, 100.0
"""N mm/rad and mm: the springs of the joints and the lengths of the links."""


def column(count: int = 3, preload: float = 0.0) -> Machine:
    """Links in a row on springs that turn about z."""
    parts: list = []
    for i in range(count):
        joint = (
            Joint(f"q{i}", AXES["z"], passive=True, compliance=1.0 / K, preload=preload)
            if i
            else Joint("q0", AXES["z"], compliance=1.0 / K)
        )
        parts += [joint, RigidOffset(f"l{i}", translation([A, 0.0, 0.0]))]
    held = {"straight": {f"q{i}": 0.0 for i in range(count)}}
    return Machine("column", tuple(parts), postures={"straight": np.zeros(0)}, held=held)


def under(force: float, *, follower: bool) -> LoadCase:
    """A load along the column at its free end, from nothing."""
    load = Load((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0), follower=follower)
    return LoadCase("straight", force, "load", free=COMPONENTS, loads=(load,))


def test_a_dead_load_buckles_it_at_the_closed_form():
    stiff = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]]) * K
    # links turn by φ_i: ½ φᵀ stiff φ against the load's ½ P a Σ φ_i²
    critical = float(np.linalg.eigvalsh(stiff / A)[0])
    path = VjmEngine().trace(column(), under(1.2 * critical, follower=False))
    events = [event for event in path.events if event.kind is EventKind.BIFURCATION]
    assert len(events) == 1
    # critical loads are located to 1e-9 of the path
    assert events[0].s == pytest.approx(critical, rel=1e-8)


def test_a_follower_gives_no_static_event():
    # Ziegler's column flutters, which needs masses; it has no other equilibrium at any load
    path = VjmEngine().trace(column(), under(10.0 * K / A, follower=True))
    assert path.complete
    assert path.events == ()
    assert np.abs(path.points[-1].displacement).max() < 1e-9


def test_a_preload_is_in_balance_where_the_path_begins():
    torque = 0.02 * K
    path = VjmEngine().trace(column(2, torque), under(1.0, follower=False))
    # the second joint turns by torque/K; the first bears nothing
    start = path.points[0].displacement
    assert start[:2] == pytest.approx([A * (np.cos(0.02) - 1.0), A * np.sin(0.02)], abs=1e-9)


ARMS = np.array([400.0, 300.0, 200.0])
SPRINGS = np.array([2e6, 1.5e6, 1e6])


def arm_of_short_parts() -> Machine:
    """Long rigid links, each on a spring that is a part 0.1 mm long, which gives way at its tip."""
    parts: list = []
    for i, (arm, k) in enumerate(zip(ARMS, SPRINGS, strict=True)):
        compliance = np.diag([1e-9, 1e-9, 1e-9, 1e-12, 1e-12, 1.0 / k])
        parts += [
            Beam(f"s{i}", 0.1, compliance=compliance),
            RigidOffset(f"l{i}", translation([arm - 0.1 * (i < 2), 0.0, 0.0])),
        ]
    return Machine("short", tuple(parts), postures={"straight": np.zeros(0)})


def critical_of_arm() -> float:
    """½ φᵀ K φ of the springs against ½ P Σ a φ²."""
    K = np.diag(SPRINGS) + np.diag([*SPRINGS[1:], 0.0]) - np.diag(SPRINGS[1:], 1) - np.diag(SPRINGS[1:], -1)
    root = 1.0 / np.sqrt(ARMS)
    return float(np.linalg.eigvalsh(K * root[:, None] * root)[0])


@pytest.mark.quick_cases(5)
@pytest.mark.parametrize("reach", [1.01, 1.02, 1.05, 1.1, 1.15, 1.2, 1.25, 1.3, 1.4, 1.5, 1.6, 1.75, 2.0, 2.5])
def test_the_branch_is_taken_however_far_the_load_goes(reach):
    critical = critical_of_arm()
    path = VjmEngine().trace(arm_of_short_parts(), under(reach * critical, follower=False))
    assert path.complete, path.stopped
    (event,) = [event for event in path.events if event.kind is EventKind.BIFURCATION]
    assert event.switched
    # critical loads are located to 1e-9 of the path, and the links' compliance of 1e-9 mm/N shortens them
    assert event.s == pytest.approx(critical, rel=1e-7)


def test_an_arc_measures_the_arm_by_its_links():
    case = replace(under(1.5 * critical_of_arm(), follower=False), control=ARC)
    path = VjmEngine().trace(arm_of_short_parts(), case)
    assert path.complete, path.stopped
    assert len(path.points) < 200
