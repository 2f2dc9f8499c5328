"""Observed order of the virtual springs, against closed forms and a rod integrated by shooting.

The orders are derived in `docs/virtual-springs.md`, whose table is what these tests print:
`pytest tests/vjm/test_spring_order.py -rP`.
"""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, Placement, Section
from vjm.model.springs import BeamColumnSpring
from vjm.rotations import AXES
from vjm.statics import free_stability, solve_under_wrench

L = 100.0
EULER = 1000.0
EI = EULER * L**2 / np.pi**2
ROOT = {
    "pinned": np.pi,
    "clamped-pinned": brentq(lambda u: np.sin(u) - u * np.cos(u), 4.4, 4.6, xtol=1e-14),
    "clamped-clamped": 2.0 * np.pi,
    "clamped-free": np.pi / 2.0,
    # a base that turns by M L/EI: u sin u = cos u − sin u/u
    "sprung-pinned": brentq(lambda u: u * np.sin(u) - np.cos(u) + np.sin(u) / u, np.pi, 4.4, xtol=1e-14),
}
"""kL of the straight column's lowest mode."""


def closed_form(ends, EA):
    """P of P (1 − P/EA) = EI (kL)²/L²: an extensible, shear-rigid column, whatever holds its ends."""
    euler = EI * ROOT[ends] ** 2 / L**2
    return 2.0 * euler / (1.0 + np.sqrt(1.0 - 4.0 * euler / EA))


def column(ends, EA, plane):
    """A column that buckles in its soft plane, xy, or, its pins turned, in the stiff one."""
    about, section = {"soft": ("z", Section(EA, EI, 20.0 * EI, EI)), "stiff": ("y", Section(EA, EI, EI, EI / 2.0))}[
        plane
    ]
    beam, pin = Beam("link", L, section=section), Joint("tip", AXES[about], passive=True)
    match ends:
        case "pinned":
            parts = (Joint("base", AXES[about], passive=True), beam, pin)
        case "clamped-pinned":
            parts = (beam, pin)
        case "sprung-pinned":
            parts = (Beam("spring", 1e-9, compliance=np.diag([1e-9] * 5 + [L / EI]), own_segments=1), beam, pin)
        case _:
            parts = (beam,)
    return Machine(
        ends, parts, postures={"straight": np.zeros(len([p for p in parts if p.name in ("base", "tip")]))}
    )


@cache
def critical_error(ends, n, placement="best", EA=1e6, plane="soft"):
    """Relative error of the critical load with n springs."""
    chain, exact = column(ends, EA, plane), closed_form(ends, EA)
    engine = VjmEngine(n, placement=Placement(placement))
    if ends == "clamped-free":
        model = engine.model(chain)

        def smallest(load):
            at = solve_under_wrench(model, np.array([-load, 0, 0, 0, 0, 0]), np.zeros(model.size))
            return free_stability(at).eigenvalue

        return brentq(smallest, 0.5 * exact, 2.0 * exact, rtol=1e-13) / exact - 1.0
    room = 2.5 if placement == "end" else 1.3
    event = engine.trace(chain, LoadCase("straight", -room * exact * L / EA)).critical
    assert event.kind is EventKind.BIFURCATION
    return event.force / exact - 1.0


def order(n, error):
    return -np.polyfit(np.log(n), np.log(np.abs(error)), 1)[0]


def show(what, n, error):
    listed = ", ".join(f"{k}: {e:.1e}" for k, e in zip(n, error, strict=True))
    print(f"| {what} | {listed} | {order(n, error):.1f} |")


# --- straight columns ------------------------------------------------------------------------------


@pytest.mark.parametrize(("ends", "plane", "n"), [
    ("pinned", "soft", (2, 3, 4, 6, 8)), ("pinned", "stiff", (2, 3, 4, 6, 8)),
    ("clamped-pinned", "soft", (2, 3, 4, 6, 8)), ("sprung-pinned", "soft", (2, 3, 4, 6, 8)),
    ("clamped-clamped", "soft", (3, 4, 5, 6, 8)), ("clamped-free", "soft", (1, 2)),
])  # fmt: skip
def test_critical_load_of_best_springs_is_better_than_fourth_order(ends, plane, n):
    error = np.array([critical_error(ends, k, plane=plane) for k in n])
    show(f"critical load, {ends}, {plane} plane", n, error)
    assert order(n, error) >= 3.8
    # a clamped column's half-waves have half the springs: it needs eight for what the pinned one does with four
    assert abs(critical_error(ends, 8, plane=plane)) <= 1e-4
    if ends != "clamped-clamped":
        assert abs(critical_error(ends, 4, plane=plane)) <= 1e-3


@pytest.mark.parametrize(("ends", "n"), [
    ("pinned", (3, 4, 5, 6)), ("clamped-pinned", (4, 5, 6, 8)), ("clamped-clamped", (6, 8, 10, 12)),
])  # fmt: skip
def test_critical_load_of_an_inextensible_column_is_tenth_order(ends, n):
    """c and d are the beam-column's but for a relative z⁵, and z is the square of the segment's length."""
    error = np.array([critical_error(ends, k, EA=1e9) for k in n])
    show(f"critical load, {ends}, inextensible", n, error)
    assert order(n, error) == pytest.approx(10.0, abs=0.3)


def segments_load(n, EA=1e6):
    """Critical load of the pinned column from its segments' energies against their chords alone."""
    h = L / n
    spring = BeamColumnSpring(Section(EA, EI, EI, EI), h)

    def smallest(load):
        compliance = spring.compliance(np.array([-load, 0, 0, 0, 0, 0]))
        length = h * (1.0 - load / EA)
        K = np.zeros((2 * n + 2, 2 * n + 2))
        for i in range(n):
            # of both nodes' deflections and slopes: the slopes' difference, their mean off the chord, the chord
            rows = np.array([[0, -1, 0, 1], [1 / length, 0.5, -1 / length, 0.5], [-1 / length, 0, 1 / length, 0]])
            bend = 1.0 / compliance[5, 5] - load * h / 4.0
            shear = length**2 / compliance[1, 1] + load * length
            K[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += rows.T @ np.diag([bend, shear, -load * length]) @ rows
        free = [i for i in range(2 * n + 2) if i not in (0, 2 * n)]
        return np.linalg.eigvalsh(K[np.ix_(free, free)])[0]

    return brentq(smallest, 0.5 * EULER, 1.5 * EULER, rtol=1e-13)


@pytest.mark.parametrize("n", [2, 3, 4, 6, 8])
def test_critical_load_is_that_of_the_segments_energies(n):
    engines = closed_form("pinned", 1e6) * (1.0 + critical_error("pinned", n))
    # located to 1e-9 of the ramp
    assert engines == pytest.approx(segments_load(n), rel=1e-10)


def test_conventional_placements_have_their_orders():
    n = np.array([4, 8, 16])
    error = {rule: np.array([critical_error("pinned", int(k), rule) for k in n]) for rule in Placement}
    for rule in ("end", "middle", "two-thirds"):
        show(f"critical load, pinned, {rule}", n, error[rule])
        assert order(n, error[rule]) == pytest.approx(4.0 if rule == "two-thirds" else 2.0, abs=0.1)
    # the next term, of the fourth order, is 4 % of the second at n = 16
    assert error["end"][-1] / error["middle"][-1] == pytest.approx(-2.0, abs=0.05)


@pytest.mark.parametrize("n", [1, 2, 4, 8, 16])
def test_no_critical_point_in_tension_below_five_times_eulers_load(n):
    """Fewer than three springs reach n² times it: each segment stands for a column of its own."""
    load = min(5.0, n**2) * EULER
    path = VjmEngine(n).trace(column("pinned", 1e6, "soft"), LoadCase("straight", load * L / 1e6))
    assert path.events == ()
    assert path.complete
    assert np.all(path.unstable == 0)
    # the error measured is rounding alone
    assert path.force[-1] == pytest.approx(load, rel=2e-10)


@pytest.mark.parametrize("n", [3, 4, 8, 16])
def test_round_column_buckles_at_the_closed_form_in_both_planes_at_once(n):
    joints = [Joint(name, AXES[axis], passive=True) for name, axis in zip("abcd", "yzzy", strict=True)]
    beam = Beam("link", L, section=Section(1e6, EI, EI, EI))
    chain = Machine("round", (*joints[:2], beam, *joints[2:]), postures={"straight": np.zeros(4)})
    path = VjmEngine(n).trace(chain, LoadCase("straight", -0.5))
    assert path.critical.multiplicity == 2
    assert path.critical.switched
    assert path.complete, path.stopped
    assert path.critical.force == pytest.approx(closed_form("pinned", 1e6), rel=1e-3 if n < 8 else 3e-6)
    assert np.all(path.unstable <= 0)
    # behind it the elastica: F = P_E (1 + δ/2L) of what the bowing has shortened
    bowed = (0.5 - path.force[-1] * L / 1e6) / L
    assert path.force[-1] == pytest.approx(closed_form("pinned", 1e6) * (1.0 + bowed / 2.0), rel=1e-3)


# --- bending far, in a plane and in space ------------------------------------------------------------


def rod(section, n, moment, length=L):
    """Tip ``(15,)`` of a shear-rigid rod: position, rotation by rows, moment; n is the dead force."""
    K = np.array([section.GJ, section.EIy, section.EIz])

    def slope(_, y):
        R, m = y[3:12].reshape(3, 3), y[12:]
        k = R.T @ m / K
        tangent = R[:, 0] * (1.0 + R[:, 0] @ n / section.EA)
        turn = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
        return np.concatenate([tangent, (R @ turn).ravel(), np.cross(n, tangent)])

    start = np.concatenate([np.zeros(3), np.eye(3).ravel(), moment])
    return solve_ivp(slope, (0.0, length), start, method="DOP853", rtol=1e-12, atol=1e-10).y[:, -1]


@cache
def rod_tip(section, force):
    """Tip of the cantilever under a dead force, the root's moment found by shooting for a free end."""
    moment, n = np.zeros(3), np.array(force)
    for share in np.linspace(0.125, 1.0, 8):
        found = root(lambda m, f=share * n: rod(section, f, 1e3 * m)[12:] / 1e3, moment / 1e3, tol=1e-13)
        moment = 1e3 * found.x
    assert np.abs(found.fun).max() < 1e-9
    return rod(section, n, moment)


@cache
def lumped_tip(section, force, n, placement):
    """Position and rotation of the tip of n springs under the same force, raised in steps."""
    chain = Machine("cantilever", (Beam("link", L, section=section),), postures={"straight": np.zeros(0)})
    model = VjmEngine(n, placement=Placement(placement)).model(chain)
    x = np.zeros(model.size)
    for share in np.linspace(0.125, 1.0, 8):
        at = solve_under_wrench(model, np.concatenate([share * np.array(force), np.zeros(3)]), x)
        x = at.x
    return at.kinematics.end[:3]


def tip_errors(section, force, n, placement):
    """Distance of the tip over the length, and norm of the rotation's error, for each n."""
    exact = rod_tip(section, force)
    tips = [lumped_tip(section, force, k, placement) for k in n]
    shift = np.array([np.linalg.norm(T[:, 3] - exact[:3]) / L for T in tips])
    return shift, np.array([np.linalg.norm(T[:, :3] - exact[3:12].reshape(3, 3)) for T in tips])


PLANAR = Section(1e8, 8e5, 2e6, 1e6)
"""Inextensible for all that counts: F/EA is 1e-5."""
FAR = (0.0, 910.0, 0.0)
"""Bends it to 0.81 of its length."""


@pytest.mark.slow
def test_planar_cantilever_meets_the_elastica():
    assert rod_tip(PLANAR, FAR)[1] > 0.8 * L
    # Bisshopp and Drucker (1945): δ/L = 0.81061 at P L²/EI = 10
    assert rod_tip(PLANAR, (0.0, 1000.0, 0.0))[1] / L == pytest.approx(0.81061, abs=2e-5)
    n = (4, 8, 16, 32)
    for rule, least in (("end", 1.8), ("middle", 1.4), ("two-thirds", 2.4), ("best", 3.8)):
        error, _ = tip_errors(PLANAR, FAR, n, rule)
        show(f"planar cantilever, tip at 0.8 L, {rule}", n, error)
        assert order(n, error) >= least
    assert error[1] <= 1e-4
    assert order(n, error) == pytest.approx(4.0, abs=0.1)


def test_pinned_column_behind_buckling_meets_the_elastica():
    """The pair of bars, 4 mm shortened, buckled in its soft plane: half of it, from the middle to a pin."""
    bar = Section(EA=2.0 * 310.0 / 46e-6, GJ=2.0 * 310.0 / 29e-6, EIy=2.0 * 310.0 / 15e-7, EIz=2.0 * 310.0 / 72e-7)
    euler = np.pi**2 * bar.EIz / 310.0**2

    def open_end(unknown):
        load, bend = unknown * (euler, 1e5)
        end = rod(bar, np.array([-load, 0.0, 0.0]), np.array([0.0, 0.0, bend]), 155.0)
        return np.array([end[0] - 153.0, end[14] / 1e5])

    found = root(open_end, [1.0, 2.0], tol=1e-13)
    assert np.abs(found.fun).max() < 1e-9
    exact = found.x[0] * euler
    joints = [Joint(name, AXES["z"], passive=True) for name in "ab"]
    chain = Machine("bars", (joints[0], Beam("link", 310.0, section=bar), joints[1]), postures={"s": np.zeros(2)})
    n = (2, 4, 8, 16)
    for rule in ("end", "middle", "two-thirds", "best"):
        to = [VjmEngine(k, placement=Placement(rule)).trace(chain, LoadCase("s", -4.0)) for k in n]
        error = np.array([path.force[-1] / exact - 1.0 for path in to])
        show(f"pinned bars, force at 4 mm, {rule}", n[1:], error[1:])
    assert abs(error[2]) <= 1e-5
    assert order(n, error) >= 2.9


UNEQUAL = Section(1e6, 4e5, 2e6, 1e6)
OBLIQUE = (-50.0, 250.0, 200.0)


@pytest.mark.slow
def test_spatial_bending_with_torsion_is_second_order():
    n = (4, 8, 16, 32, 64)
    for error, what in zip(tip_errors(UNEQUAL, OBLIQUE, n, "best"), ("tip", "rotation"), strict=True):
        show(f"spatial cantilever, {what}, best", n, error)
        # even powers of 1/n only
        assert order(n[1:], error[1:]) == pytest.approx(2.0, abs=0.05)
    # the limit by itself, of two meshes, is the rod's
    coarse, fine = (lumped_tip(UNEQUAL, OBLIQUE, k, "best")[:, 3] for k in (32, 64))
    limit = (4.0 * fine - coarse) / 3.0
    assert np.linalg.norm(limit - rod_tip(UNEQUAL, OBLIQUE)[:3]) / L < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["end", "middle", "two-thirds"])
def test_springs_of_22_twist_and_are_first_order_in_space(rule):
    """Their turns about x, y, z in this order inject a twist of about φ_y φ_z/2 a segment."""
    n = (16, 32, 64)
    for error, what in zip(tip_errors(UNEQUAL, OBLIQUE, n, rule), ("tip", "rotation"), strict=True):
        show(f"spatial cantilever, {what}, {rule}", n, error)
        assert order(n, error) == pytest.approx(1.0, abs=0.1)


# Virtual springs of beams: textbook compliances, and splitting that does not change the unloaded chain.


ROUNDING = 1e-13
"""Of a few sums and products of entries, each compared with the size that its row and column give it."""


def relative_error(k, expected):
    """Largest error of a compliance over the geometric mean of the two diagonal entries that it couples."""
    size = np.sqrt(np.diag(expected))
    return np.abs((k - expected) / np.outer(size, size)).max()


def tip_compliance(model, q=None):
    """Compliance (6, 6) at the end-effector with the passive joints held: J k Jᵀ."""
    x = model.configuration(np.zeros(len(model.passive)) if q is None else q)
    J = model.kinematics(x).jacobian[:, model.elastic]
    return J @ model.compliance @ J.T


def test_cantilever_of_the_textbooks():
    L, s = 200.0, Section(EA=2e6, GJ=3e7, EIy=4e7, EIz=5e7, GAy=6e5, GAz=7e5)
    # a force at the tip: L³/3EI + L/GA, turning it by L²/2EI; a moment: L²/2EI and L/EI
    expected = np.zeros((6, 6))
    expected[0, 0] = L / s.EA
    expected[1, 1] = L**3 / (3 * s.EIz) + L / s.GAy
    expected[2, 2] = L**3 / (3 * s.EIy) + L / s.GAz
    expected[3, 3] = L / s.GJ
    expected[4, 4] = L / s.EIy
    expected[5, 5] = L / s.EIz
    expected[1, 5] = expected[5, 1] = L**2 / (2 * s.EIz)
    # up along +z is a turn about −y
    expected[2, 4] = expected[4, 2] = -(L**2) / (2 * s.EIy)
    assert relative_error(s.compliance(L), expected) < ROUNDING
    bernoulli = Section(s.EA, s.GJ, s.EIy, s.EIz).compliance(L)
    assert bernoulli[1, 1] == pytest.approx(L**3 / (3 * s.EIz), rel=ROUNDING)


def test_count_multiplies_every_stiffness():
    s = Section(1e6, 2e6, 3e6, 4e6, 5e5, 6e5)
    assert np.allclose(s.times(3).compliance(50.0) * 3, s.compliance(50.0), rtol=ROUNDING, atol=0)
    k = np.diag([1e-5, 1e-3, 1e-3, 1e-7, 1e-7, 1e-7])
    assert np.array_equal(Beam("b", 100.0, compliance=k, count=2).tip_compliance(), k / 2)


@given(data=st.data(), n=st.integers(1, 12), placement=st.sampled_from(list(Placement)))
def test_segments_have_together_the_compliance_of_the_whole(chains, data, n, placement):
    chain = data.draw(chains)
    split = chain.refined({beam.name: n for beam in chain.beams if beam.section is not None}, placement)
    q = chain.posture("p")
    whole, parts = (tip_compliance(Mechanism(c), q) for c in (chain, split))
    # sums over up to a hundred springs with levers
    assert relative_error(parts, whole) < 100 * ROUNDING


@pytest.mark.parametrize("placement", Placement)
def test_beam_with_a_rigid_arm_keeps_its_compliance_when_split(chain, placement):
    (foot,) = (beam for beam in chain.beams if beam.name == "foot")
    model = Mechanism(Machine("foot", (foot,)).refined({"foot": 7}, placement))
    turned = Machine("foot", (Beam("foot", 1.0, own_frame=foot.own_frame, compliance=foot.beam_compliance()),))
    # the matrix is read at the tip, wherever that is: only the frame's turn matters
    assert relative_error(tip_compliance(model), tip_compliance(Mechanism(turned))) < 10 * ROUNDING


def test_foot_as_a_beam_meets_every_printed_entry_of_19(chain, foot_printed):
    (foot,) = (beam for beam in chain.beams if beam.name == "foot")
    k = foot.beam_compliance()
    for (i, j), printed in foot_printed.items():
        # (19) prints two digits: half a unit of the last one
        unit = 10.0 ** (np.floor(np.log10(abs(printed))) - 1)
        assert abs(k[i - 1, j - 1] - printed) < 0.5 * unit, (i, j)
    # where (19) prints a zero, the beam has nothing that the digits of its neighbours would show
    printed_matrix = foot.compliance
    size = np.sqrt(np.diag(printed_matrix))
    assert np.abs(k / np.outer(size, size))[printed_matrix == 0.0].max() < 0.01


def test_link_as_a_beam_meets_20_but_for_the_stiff_plane(chain):
    (link,) = (beam for beam in chain.beams if beam.name == "link")
    beam, printed = 2 * link.beam_compliance(), link.compliance
    off = np.abs(beam - printed) / np.where(printed == 0.0, np.inf, np.abs(printed))
    # two-digit entries: (2,2) and (2,6) lie within half a unit of the last digit of 23 and 11
    assert off[1, 1] < 0.5 / 23
    assert off[1, 5] < 0.5 / 11
    # no single length meets both planes of (20): the stiff one is 6 % off at 310 mm
    assert off[2, 2] == pytest.approx(1 - 0.0480 / 0.051, abs=0.0001 / 0.051)


def test_two_thirds_rule_puts_the_spring_there():
    section = Section(1e6, 1e7, 1e7, 1e7)
    model = Mechanism(Machine("beam", (Beam("b", 90.0, section=section),)).refined(1, "two-thirds"))
    # the first virtual joint stands 60 mm from the root, 30 mm before the tip
    assert model.before[0][:3, 3] == pytest.approx([60, 0, 0], rel=1e-15)
    assert model.tail[:3, 3] == pytest.approx([30, 0, 0], rel=1e-15)


@pytest.mark.parametrize(
    ("segments", "said"),
    [({"none": 2}, "no beam 'none'"), ({"b": 0}, "at least one segment"), ({"m": 2}, "has no section")],
)
def test_impossible_splits_are_refused_by_name(segments, said):
    parts = (Beam("b", 1.0, section=Section(1, 1, 1, 1)), Beam("m", 1.0, compliance=np.eye(6)))
    with pytest.raises(ValueError) as refusal:
        Machine("c", parts).refined(segments)
    assert said in str(refusal.value)


def test_chain_refuses_equal_names_and_unknown_postures(chain):
    with pytest.raises(ValueError) as refusal:
        Machine("c", (Joint("q", AXES["z"], passive=True), Joint("q", AXES["y"], passive=True)))
    assert "q stands twice" in str(refusal.value)
    with pytest.raises(KeyError) as unknown:
        chain.posture("E")
    assert "A, B, C, D" in str(unknown.value)


def test_actuator_compliance_adds_to_the_chains_own(chain):
    c = 2e-6
    soft = tip_compliance(Mechanism(chain.with_actuator_compliance(c)))
    # the drive is the first part, its axis x: in posture A it deflects by c along x and does nothing else
    added = np.zeros((6, 6))
    added[0, 0] = c
    rigid = tip_compliance(Mechanism(chain))
    assert np.abs(soft - rigid - added).max() < 1e-15 * np.abs(rigid).max()


@given(load=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6), axial=st.floats(-30.0, 30.0))
def test_beam_column_spring_is_conservative_and_firm_under_any_load(load, axial):
    """Its compliance is the derivative of its strain, symmetric, and positive definite under any axial force."""
    h = 20.0
    section = Section(EA=1e6, GJ=2e6, EIy=3e6, EIz=1e6)
    spring = BeamColumnSpring(section, h)
    euler = np.pi**2 * section.EIz / h**2  # of the segment alone
    unit = np.array([1e3, 1e3, 1e3, 1e4, 1e4, 1e4])
    reaction = np.array(load) * unit
    reaction[0] = axial * euler / 10.0
    compliance = spring.compliance(reaction)
    assert np.array_equal(compliance, compliance.T)
    step = 1e-4 * unit
    slope = [(spring.strain(reaction + d) - spring.strain(reaction - d)) / (2.0 * d.sum()) for d in np.diag(step)]
    size = np.sqrt(np.outer(np.diag(spring.unloaded), np.diag(spring.unloaded)))
    # central differences of a smooth law over 1e-4 of its loads, and rounding of the strain over that step
    assert np.abs((np.array(slope).T - compliance) / size).max() < 1e-5 * np.abs(compliance / size).max()
    without_moment = np.array([reaction[0], 0, 0, 0, 0, 0])
    assert np.linalg.eigvalsh(spring.compliance(without_moment) / size)[0] > 0.0


def test_beam_column_spring_is_the_exact_segment_to_the_fourth_order_in_its_load():
    """φ = 1/(z + √z cot √z) and ψ = 3(1 − √z cot √z)/(z √z cot √z), from the stability functions of a strut."""
    h, EI = 10.0, 2e6
    section = Section(EA=1e15, GJ=1.0, EIy=EI, EIz=EI)
    spring = BeamColumnSpring(section, h)
    error = []
    loads = np.array([0.1, 0.2, 0.4])
    for z in loads:
        root = np.sqrt(z)
        G = root / np.tan(root)
        compliance = spring.compliance(np.array([-4.0 * EI * z / h**2, 0, 0, 0, 0, 0]))
        rotation, shift = 1.0 / (z + G), 3.0 * (1.0 - G) / (z * G)
        error.append([
            abs(compliance[5, 5] / (h / EI * rotation) - 1.0),
            abs(compliance[1, 1] / (h**3 / (12 * EI) * shift) - 1.0),
        ])  # fmt: skip
    observed = np.polyfit(np.log(loads), np.log(np.array(error)), 1)[0]
    # the error is of order z⁵; the next term, of z⁶, bends the slope at z = 0.4
    assert np.all(observed > 4.7)
    assert np.all(np.array(error)[0] < 1e-5)
