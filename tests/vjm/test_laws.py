"""Laws of springs: closed forms, energies, tangents, inverses, and how files write them."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.file_texts import model_text, part_text
from scipy.integrate import quad

import vjm
from vjm.io.joint_tables import LAW_TABLES
from vjm.model.laws import LAWS, DeadZone, Law, OneSided, Polynomial, StrainWave, Tabulated

EXAMPLES: list[Law] = [
    StrainWave(K1=3.1e7, K2=5e7, K3=5.7e7, T1=1.4e4, T2=4.8e4),
    StrainWave(K1=6e7, K2=5e7, K3=2e7, T1=1.4e4, T2=4.8e4, transition=1e-4),
    Polynomial(1e6, (-0.01, 0.02), K2=1e6, K3=5e8),
    Polynomial(1e6, (-0.01, 0.01), K3=-2e9),
    DeadZone(1e6, 2e-3),
    DeadZone(1e6, 2e-3, 1e3, 1e-5),
    OneSided(20.0, 1e-3),
    OneSided(20.0, 1e-3, -2.0, "below"),
    Tabulated((-2.0, -1.0, 0.0, 1.0, 3.0), (-5.0, -1.0, 0.0, 2.0, 3.0)),
]


def names(law):
    return f"{law.kind}-{EXAMPLES.index(law)}"


def around(law, count=401):
    """Deflections about its knots, and beyond them."""
    knots = law.curve.knots
    wide = float(np.ptp(knots)) or 1.0
    return np.sort(np.concatenate([np.linspace(knots[0] - wide, knots[-1] + wide, count), knots])), wide


@pytest.mark.parametrize("law", EXAMPLES, ids=names)
def test_the_force_is_the_slope_of_the_energy_and_the_tangent_that_of_the_force(law):
    u, wide = around(law)
    knots = law.curve.knots
    # the energy over each stretch is the integral of the force, so that a closed loop leaves nothing
    for a, b in zip(u[:-1:40], u[40::40], strict=False):
        inside = [k for k in knots if a < k < b] or None
        work, _ = quad(lambda x: float(law.force(x)), a, b, points=inside, limit=200)
        assert float(law.energy(b) - law.energy(a)) == pytest.approx(work, rel=1e-9, abs=1e-12)
    assert float(law.energy(0.0)) == pytest.approx(0.0, abs=1e-12 * float(np.abs(law.energy(u)).max()))
    # a difference of the fourth order within each piece: of polynomials of the fourth degree it has rounding only
    h = 1e-3 * float(np.diff(np.unique([*knots, knots[0] - wide])).min())
    inside = u[np.abs(u[:, None] - knots).min(axis=1) > 3.0 * h]
    first, second = ((law.force(inside + k * h) - law.force(inside - k * h)) / (2.0 * k * h) for k in (1, 2))
    scale = float(np.abs(law.tangent(u)).max())
    rounding = 1e-15 * float(np.abs(law.force(u)).max()) / h / scale
    np.testing.assert_allclose(
        law.tangent(inside) / scale, (4.0 * first - second) / 3.0 / scale, atol=1e-8 + rounding
    )
    assert np.all(law.tangent(u) >= -1e-12 * scale)


@pytest.mark.parametrize("law", EXAMPLES, ids=names)
def test_the_inverse_gives_the_deflection(law):
    for u in around(law, 101)[0]:
        force = float(law.force(u))
        back = law.deflection(force)
        assert float(law.force(back)) == pytest.approx(force, rel=1e-13, abs=1e-13 * float(law.largest_stiffness))
        if float(law.tangent(u)) > 1e-3 * law.largest_stiffness:
            assert back == pytest.approx(u, rel=1e-9, abs=1e-12)


def test_a_strain_wave_gear_is_its_catalogue_beyond_its_transitions():
    K1, K2, K3, T1, T2 = 3.1e7, 5e7, 5.7e7, 1.4e4, 4.8e4
    gear, a = StrainWave(K1, K2, K3, T1, T2), T1 / K1
    b = a + (T2 - T1) / K2
    for u in np.linspace(-2.0 * b, 2.0 * b, 1001):
        size = abs(u)
        torque = K1 * size if size < a else T1 + K2 * (size - a) if size < b else T2 + K3 * (size - b)
        off = abs(float(gear.force(u)) - np.sign(u) * torque)
        near = min(abs(size - a), abs(size - b)) < 0.5 * gear.width
        assert off <= (3.0 / 32.0 * (K2 - K1) * gear.width if near else 1e-11 * T2)
    at_kink = float(gear.force(a)) - T1
    assert at_kink == pytest.approx(3.0 / 32.0 * (K2 - K1) * gear.width, rel=1e-9)
    assert gear.region(0.0) == "below T1"
    assert gear.region(-2.0 * b) == "beyond T2"


def test_one_way_springs_have_no_force_the_other_way():
    cable = OneSided(20.0, 1e-3)
    assert np.all(cable.force([-5.0, -1.0, -0.5e-3]) == 0.0)
    assert float(cable.force(2.0)) == pytest.approx(40.0, rel=1e-15)
    assert (cable.region(-1.0), cable.region(1.0)) == ("without contact", "in contact")
    backlash = DeadZone(1e6, 2e-3)
    assert np.all(backlash.force(np.linspace(-0.9e-3, 0.9e-3, 11)) == 0.0)
    assert backlash.deflection(0.0) == 0.0
    assert backlash.deflection(-500.0) == pytest.approx(-1.5e-3, rel=1e-12)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: StrainWave(1.0, 1.0, 1.0, 2.0, 1.0), "T2 must be above T1 = 2"),
        (lambda: StrainWave(1.0, 0.0, 1.0, 1.0, 2.0), "K2 must be above zero"),
        (lambda: StrainWave(1.0, 1.0, 1.0, 1.0, 2.0, transition=3.0), "transition must be above zero and at most"),
        (lambda: Polynomial(1.0, (-1.0, 1.0), K3=-1.0), "its tangent is -2 at -1: it must be positive"),
        (lambda: Polynomial(1.0, (0.5, 1.0)), "range must be [lower, upper] with zero within"),
        (lambda: Polynomial(1.0, (-1.0, 1.0), K2=1.0, K3=0.2), "its tangent is -0.4 at -1"),
        (lambda: DeadZone(1.0, 1.0, 2.0), "inside must be from 0 to below"),
        (lambda: OneSided(1.0, 0.1, acts="up"), "acts must be 'above' or 'below'"),
        (lambda: OneSided(1.0, 0.1, begins=-1.0), "begins must leave it without force"),
        (lambda: Tabulated((0.0, 1.0, 2.0), (0.0, 1.0, 1.0)), "forces must be finite and ascend"),
        (lambda: Tabulated((0.0, 1.0, 2.0), (1.0, 2.0, 3.0)), "a force of 0 at a deflection of 0"),
        (lambda: StrainWave(float("nan"), 1.0, 1.0, 1.0, 2.0), "K1 must be finite"),
    ],
)
def test_numbers_that_make_no_law_are_refused(make, said):
    with pytest.raises(ValueError, match=said.replace("[", r"\[").replace("]", r"\]")):
        make()


@pytest.mark.parametrize("slides", [False, True])
@pytest.mark.parametrize("law", EXAMPLES, ids=names)
def test_a_file_writes_what_it_reads(law, slides):
    written = law.table(slides=slides)
    assert LAW_TABLES[law.kind].model_validate(written).law(slides=slides) == law


def test_every_law_has_an_example():
    assert {type(law) for law in EXAMPLES} == set(LAWS.values())


GEAR = 'kind = "strain_wave", K1_1e4Nm_per_rad = 3.1, K2_Nmm_per_rad = 5e7, K3_1e4Nm_per_rad = 5.7, T2_Nm = 48.0'


def arm(tmp_path, law):
    file = tmp_path / "arm.toml"
    elbow = part_text("actuated", "elbow", axis="z") + f"law = {law}\n"
    fore = part_text("link", "fore", translation_mm=[400.0, 0.0, 0.0])
    file.write_text(model_text("arm", elbow, fore, postures={"p": {"elbow": 0.3}}), encoding="utf-8")
    return file


def test_a_catalogue_has_the_law(tmp_path):
    by_row = vjm.load(arm(tmp_path, '{ catalogue = "harmonic-drive-50-100", row = "size-32-100" }'))
    numbers = (
        "K1_1e4Nm_per_rad = 6.7, K2_1e4Nm_per_rad = 11.0, K3_1e4Nm_per_rad = 12.0, T1_Nm = 29.0, T2_Nm = 108.0"
    )
    by_numbers = vjm.load(arm(tmp_path, f'{{ kind = "strain_wave", {numbers} }}'))
    assert by_row.parts[0].law == by_numbers.parts[0].law == StrainWave(6.7e7, 1.1e8, 1.2e8, 2.9e4, 1.08e5)


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (f"{{ {GEAR}, T1_Nm = 140.0 }}", "part 'elbow': law: T2 must be above T1 = 140000, not 48000"),
        (
            f"{{ {GEAR}, T1_N = 14.0 }}",
            "part 'elbow': law.T1_N has the unit of what slides or stretches: give T1_Nmm",
        ),
        (f"{{ {GEAR}, T1_Nmn = 14.0 }}", "part 'elbow': unknown key 'T1_Nmn' in law; did you mean 'T1_Nm'?"),
        (f"{{ {GEAR} }}", "part 'elbow': law.T1_Nmm is missing: a law of kind 'strain_wave' needs it"),
        (f"{{ {GEAR}, T1_Nm = 14.0, T1_Nmm = 14e3 }}", "T1 stands twice: give it once"),
        ('{ kind = "gear" }', "part 'elbow': law kind must be one of 'strain_wave', 'polynomial'"),
        ("{ K1_Nm = 3.0 }", "part 'elbow': law kind is missing: add it"),
        ('{ catalogue = "harmonic-drive-csf-30", row = "example" }', "has no row 'example'"),
        ('{ catalogue = "square-tubes", row = "40x40x2" }', "is no law: its kind must be one of strain_wave"),
        (f"{{ {GEAR}, T1_Nm = 14.0 }}\ncompliance_rad_per_Nmm = 1e-9", "has a law and compliance_rad_per_Nmm"),
    ],
)
def test_a_wrong_law_in_a_file_is_one_line(law, said, tmp_path):
    with pytest.raises(vjm.ModelFileError) as refused:
        vjm.load(arm(tmp_path, law))
    assert said in str(refused.value)


def test_from_python_a_joint_has_one_law():
    law = EXAMPLES[0]
    joint = vjm.Joint("elbow", vjm.axis("z"), law=law)
    assert joint.elastic
    with pytest.raises(ValueError, match="has a law and a compliance"):
        replace(joint, compliance=1e-9)
    with pytest.raises(ValueError, match="has a law and a stiffness"):
        vjm.PointSpring("s", ("", "a"), np.zeros((2, 3)), 1.0, law=law)


# turns in 1e-4 rad, as they are printed beside torques and slopes, at T1 and T2
PRINTED_TURNS = {
    "harmonic-drive-csf-30": {
        "csf-8-30": ("8.5", "19"),
        "csf-11-30": ("9.5", "19"),
        "csf-14-30": ("10.5", "31"),
        "csf-17-30": ("11.5", "30"),
        "csf-20-30": ("12.3", "38"),
        "csf-25-30": ("14", "40"),
        "csf-32-30": ("12.1", "38"),
    },
    "harmonic-drive-50-100": {
        "rsf-8b-50": ("6.6", "13"),
        "rsf-8b-100": ("3.2", "8"),
        "rsf-11b-50": ("3.6", "8"),
        "rsf-11b-100": ("3.0", "6"),
        "rsf-14b-50": ("5.8", "16"),
    },
}
PRINTED = [(name, row, turns) for name, rows in PRINTED_TURNS.items() for row, turns in rows.items()]


@pytest.mark.parametrize(("name", "row", "turns"), PRINTED)
def test_rows_of_a_makers_catalogue_turn_as_it_prints(tmp_path, name, row, turns):
    law = vjm.load(arm(tmp_path, f'{{ catalogue = "{name}", row = "{row}" }}')).parts[0].law
    for torque, printed in zip((law.T1, law.T2), turns, strict=True):
        # reason: slopes of two digits, half a unit of which is 3 % at most; half of the turn's last digit
        half = 0.5 * 10.0 ** -len(printed.partition(".")[2])
        assert abs(law.deflection(torque) * 1e4 - float(printed)) <= half + 0.03 * float(printed)


def test_a_makers_worked_example_turns_as_it_says(tmp_path):
    law = vjm.load(arm(tmp_path, '{ catalogue = "harmonic-drive-50-100", row = "size-32-100" }')).parts[0].law
    assert law.deflection(60e3) == pytest.approx(7.15e-4, rel=1e-3)


def test_every_row_of_a_gear_has_a_turn_to_be_held_to():
    rows = {name: {str(row["name"]) for row in vjm.catalogue(name)} for name in PRINTED_TURNS}
    assert rows == {name: set(turns) for name, turns in PRINTED_TURNS.items()} | {
        "harmonic-drive-50-100": {*PRINTED_TURNS["harmonic-drive-50-100"], "size-32-100"}
    }


# The library's machines whose springs have laws, against what a hand computes of them.


def test_the_scara_turns_by_its_catalogues_slopes():
    """A force of 100 N across the stretched arm: 60 N m at the shoulder, 25 N m at the elbow."""
    found = vjm.stiffness(vjm.load("scara"), "stretched", wrench=(0.0, 100.0, 0.0, 0.0, 0.0, 0.0))
    shoulder = 29.0 / 6.7e4 + (60.0 - 29.0) / 11.0e4
    elbow = 14.0 / 1.0e4 + (25.0 - 14.0) / 1.3e4
    # the levers shorten by the square of a milliradian
    assert found.displacement[5] == pytest.approx(shoulder + elbow, rel=1e-5)
    assert found.displacement[1] == pytest.approx(600.0 * shoulder + 250.0 * elbow, rel=1e-5)
    # at the load the second slopes count, N mm/rad
    compliance = 600.0**2 / 11.0e7 + 250.0**2 / 1.3e7
    assert found.loaded_compliance[1, 1] == pytest.approx(compliance, rel=1e-4)
    assert found.unloaded_compliance[1, 1] == pytest.approx(600.0**2 / 6.7e7 + 250.0**2 / 1.0e7, rel=1e-9)
    assert "joint 'elbow' is between T1 and T2" in found.laws[1]


def test_the_cable_robot_has_the_stiffness_of_its_lines():
    """Four cables of 20 N/mm under 80 N, along (900, 740) over 1165.16 mm."""
    found = vjm.stiffness(vjm.load("planar-cables"))
    length = np.hypot(900.0, 740.0)
    k, t = 20.0, 80.0
    along, across = 900.0 / length, 740.0 / length
    K = np.linalg.inv(found.loaded_compliance[np.ix_([0, 2], [0, 2])])
    # a strain of 1e-6 rounds the law: 1e-3 mm of 4
    assert K[0, 0] == pytest.approx(4.0 * (k * along**2 + t / length * across**2), rel=1e-9)
    assert K[1, 1] == pytest.approx(4.0 * (k * across**2 + t / length * along**2), rel=1e-9)
    assert all(pull == pytest.approx(80.0, rel=1e-9) for pull in found.pulls.values())
    assert "4 of 4 cables are taut, and force-closed" in found.laws[-1]


def test_a_cable_of_the_robot_slackens_where_a_hand_computes_it():
    """Pulled down the lower cables give up their 4 mm: the platform has sunk by 6.3 mm, to first order."""
    machine = vjm.load("planar-cables")
    load = vjm.Load((0.0, 0.0, -1.0, 0.0, 0.0, 0.0))
    path = vjm.trace(machine, vjm.LoadCase("drawn", 400.0, "load", free=vjm_components(), loads=(load,)))
    lower = [change for change in path.law_changes if change.name.startswith("lower")]
    assert {change.region for change in lower} == {"slack"}
    # both at one place, which is one point of the path
    assert np.all(np.diff(path.s) > 0.0)
    # the exact length between the points is the free one
    sunk = 740.0 - np.sqrt(1161.1609330903607**2 - 900.0**2)
    for change in lower:
        assert change.point.displacement[2] == pytest.approx(-sunk, rel=1e-6)


def test_the_compensator_bears_the_weight_that_a_hand_computes():
    """Level: 1.5 kN m of weight at the shoulder, 6.4 kN of pull at 86 mm, and the turns of both drives."""
    machine, g = vjm.load("compensated-arm"), 9.81

    def pull(length):
        u = length - 250.0
        return 4000.0 + 5.7143 * u + 8.1633e-3 * u**2 + 1.16618e-5 * u**3

    def torques(turn):
        """At shoulder and elbow, towards larger coordinates, downwards: from weights, pull, and drives."""
        a, b = np.cos(turn[0]), np.cos(turn[0] + turn[1])
        elbow = g * (35.0 * 300.0 + 50.0 * 800.0) * b
        shoulder = g * (60.0 * 400.0 + 85.0 * 900.0) * a + elbow
        # the point on the upper arm, from the shoulder, x and z
        point, anchor = 300.0 * np.array([a, -np.sin(turn[0])]), np.array([-200.0, 150.0])
        way = anchor - point
        force = pull(np.linalg.norm(way)) * way / np.linalg.norm(way)
        shoulder += point[1] * force[0] - point[0] * force[1]
        return np.array([shoulder, elbow])

    compliance = np.array([4e-10, 8e-10])
    turn = np.zeros(2)
    # each turn changes the torques by 1e-3 of itself
    for _ in range(20):
        turn = compliance * torques(turn)
    found = vjm.stiffness(machine, "level", wrench=(0.0,) * 6, gravity=(0.0, 0.0, -g))
    held = torques(turn)
    assert found.torques["shoulder"] == pytest.approx(-held[0], rel=1e-9)
    assert found.torques["elbow"] == pytest.approx(-held[1], rel=1e-9)
    assert found.displacement[4] == pytest.approx(turn.sum(), rel=1e-9)
    sunk = -900.0 * np.sin(turn[0]) - 800.0 * np.sin(turn.sum())
    assert found.displacement[2] == pytest.approx(sunk, rel=1e-9)
    # without it the shoulder bears 1.6 times as much, to what a millimetre of sag changes
    relieved = 300.0 * pull(522.0) * 150.0 / 522.0
    assert (held[0] + relieved) / held[0] == pytest.approx(1.59, abs=0.005)


def vjm_components():
    """All components of a pose."""
    return ("x", "y", "z", "rx", "ry", "rz")
