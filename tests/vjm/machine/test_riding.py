"""A joint that rides on a beam: against closed forms, differences, and what cannot ride."""

import copy

import numpy as np
import pytest
from helpers.riding import EA, EI, LENGTH, MASS, PLACES, cantilever, clamped, supported

import vjm
from vjm.io.model_file import ModelFileError, build_chain
from vjm.kernels.derivatives import frame_derivatives
from vjm.machine.equilibria import equilibria
from vjm.model.mechanism import Mechanism

DOCUMENT = {
    "format": 1, "name": "crane", "title": "A crane", "source": "made up",
    "units": {"length": "mm", "force": "N", "angle": "rad"},
    "parts": [
        {"kind": "beam", "name": "bridge", "length_mm": 1000.0, "mass_kg": 2.0,
         "section": {"EA_N": 1e8, "GJ_Nmm2": 8e9, "EIy_Nmm2": 1e10, "EIz_Nmm2": 1e10}},
        {"kind": "actuated", "name": "x", "axis": "x", "motion": "slides", "rides_on": "bridge",
         "limits_mm": [0.0, 1000.0]},
        {"kind": "link", "name": "carriage", "mass_kg": 5.0, "centre_of_mass_mm": [0.0, 0.0, 0.0]},
    ],
    "postures": {"there": {"x": 400.0}},
}  # fmt: skip


def forms(name: str, x: np.ndarray) -> np.ndarray:
    """Deflections of a beam by a force of 1 N at ``x`` mm across it, at that place."""
    a, b, L = x, LENGTH - x, LENGTH
    return {
        "cantilever": a**3 / (3.0 * EI),
        "clamped": a**3 * b**3 / (3.0 * EI * L**3),
        "supported": a**2 * b**2 / (3.0 * EI * L),
    }[name]


@pytest.mark.parametrize(
    ("machine", "load"), [(cantilever(), 1.0), (clamped(), 50.0), (supported(), 1.0)], ids=lambda one: str(one)
)  # fmt: skip
def test_a_force_on_the_carriage_deflects_the_beam_as_the_textbook_says(machine, load):
    x = np.array(PLACES)
    exact = forms(machine.name, x)
    model = Mechanism(machine.split())
    rows = np.zeros((len(x), len(model.joints)))
    rows[:, model.joints.index("x")] = x
    found = equilibria(model, rows, wrench=np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])).deflection[:, 0, 2]
    # the second order, 1e-9 of the cantilever, and the membrane force of a held beam, (w/r)² = 1e-6
    assert -found == pytest.approx(exact, rel=2e-6, abs=1e-12 * exact.max())
    for place, value in zip(PLACES, exact.tolist(), strict=True):
        one = vjm.stiffness(machine, {"x": place}, wrench=(0.0, 0.0, -load, 0.0, 0.0, 0.0))
        # the membrane force of the clamped beam under 50 N
        assert -one.displacement[2] / load == pytest.approx(value, rel=2e-5, abs=1e-9 * exact.max())


def test_its_weight_bends_a_cantilever_where_the_carriage_is():
    x, w = np.array(PLACES), 9.81e-3 * MASS
    exact = w * x**2 * (6.0 * LENGTH**2 - 4.0 * LENGTH * x + x**2) / (24.0 * EI)
    model = Mechanism(cantilever().split())
    found = equilibria(model, x[:, None], gravity=(0.0, 0.0, -9.81e-3)).deflection[:, 0, 2]
    # exact at the ends of segments; at an end of the beam the other piece weighs as 4 segments of 1e-5 mm do
    assert -found == pytest.approx(exact, rel=4e-7, abs=1e-12 * exact.max())


def test_many_postures_are_each_one():
    machine = cantilever(5.0, compliance=1e-4, lateral=(1e-8, 2e-8))
    wrench, gravity = np.array([500.0, 30.0, -400.0, 4e4, 1e4, 2e4]), (0.0, 0.0, -9.81)
    found = equilibria(Mechanism(machine.split()), np.array(PLACES)[:, None], gravity=gravity, wrench=wrench)
    for k, place in enumerate(PLACES):
        one = vjm.stiffness(machine, {"x": place}, wrench=tuple(wrench), gravity=gravity, engine=vjm.VjmEngine(4))
        # the same springs made in another way; at the ends a segment of 1e-5 mm
        assert found.deflection[k, 0] == pytest.approx(one.displacement, rel=1e-6, abs=1e-9)
        assert found.torques[k, 0] == pytest.approx(one.torques["x"], rel=1e-6)


def test_the_drive_bears_what_acts_along_the_beam_there_and_moves_along_it():
    """Its compliance acts along the tangent of the bent beam where it stands, and takes the load along.

    By c N along the beam, the load bends it as it does at that place: d(F x³/3EI)/dx = F x²/EI, twice the slope.
    """
    wrench, c = np.array([50.0, 0.0, -800.0, 0.0, 0.0, 0.0]), 1e-5
    stiff, soft = (vjm.stiffness(cantilever(compliance=each), "there", wrench=tuple(wrench)) for each in (0.0, c))
    slope = stiff.displacement[4]
    # the cross-section turns about y by 0.0064
    assert slope == pytest.approx(800.0 * 400.0**2 / (2.0 * EI), rel=1e-3)
    tangent = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    pull = float(wrench[:3] @ tangent)
    assert stiff.torques["x"] == pytest.approx(-pull, rel=1e-9)
    moved = soft.displacement[:3] - stiff.displacement[:3]
    # c N = 6e-4 mm over x = 400 mm, and the slope's square, 4e-5, of c N
    assert moved == pytest.approx(c * pull * np.array([1.0, 0.0, -2.0 * slope]), abs=1e-4 * c * pull)


def test_derivatives_by_its_coordinate_are_the_differences_of_equilibria():
    machine = cantilever(5.0, compliance=1e-4, lateral=(1e-8, 2e-8))
    model, step, gravity = Mechanism(machine.split()), 0.05, (0.0, 0.0, -9.81)
    wrench, q = np.array([500.0, 30.0, -400.0, 4e4, 1e4, 2e4]), np.array([[123.0], [731.0]])

    def position(rows):
        return equilibria(model, rows, gravity=gravity, wrench=wrench, compliance=False).position

    found = equilibria(model, q, gravity=gravity, wrench=wrench, compliance=False)
    exact = frame_derivatives(
        model.arrays(gravity, moments=True), model.values(q), model.naturals(q), wrench[None, None], found.x
    )
    by_place = sum(share * exact.value[:, :, :3, joint] for joint, share in model.shares("x").items())
    # Richardson: the remainder is the rounding of 1 m over a step, 1e-11
    fine, coarse = ((position(q + h) - position(q - h)) / (2.0 * h) for h in (step, 2.0 * step))
    assert np.abs(by_place - (4.0 * fine - coarse) / 3.0).max() < 1e-8


def test_modes_shares_and_sensitivities_of_a_carriage():
    light = vjm.Section(EA=EA, GJ=8e9, EIy=EI, EIz=2.0 * EI)
    machine = cantilever(50.0, light)
    for place in (250.0, 731.0, 1000.0):
        # the mass is a point: k = 3 EI/x³, N/mm is kg/s² times 1000
        exact = np.sqrt(3000.0 * EI / place**3 / 50.0) / (2.0 * np.pi)
        assert vjm.modes(machine, {"x": place}, number=1).frequencies[0] == pytest.approx(exact, rel=1e-9)
    load = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
    shares = vjm.shares(machine, {"x": 731.0}, wrench=load)
    assert {row["part"]: row["energy"] for row in shares.table()}["bridge"] == pytest.approx(1.0, rel=1e-9)
    rows = {
        row.parameter: row.relative
        for row in vjm.sensitivities(machine, wrench=load, posture={"x": 731.0}, along="z").rows
    }
    assert rows["bridge.section.EIy"] == pytest.approx(-1.0, rel=1e-6)
    # the beam behind the carriage bears nothing
    assert rows["bridge.length"] == pytest.approx(0.0, abs=1e-6)


def test_its_beam_weighs_as_much_wherever_it_stands():
    for place in PLACES:
        machine = cantilever(5.0)
        assert vjm.modes(machine, {"x": place}, number=1).mass == pytest.approx(5.0 + MASS * LENGTH, rel=1e-12)


def _passive(content):
    content["parts"][1] |= {"kind": "joint"}


def _turning(content):
    content["parts"][1] = {"kind": "actuated", "name": "x", "axis": "x", "rides_on": "bridge"}
    content["postures"]["there"]["x"] = 0.5


def _nowhere(content):
    content["parts"][1]["limits_mm"] = [1100.0, 1200.0]
    content["postures"]["there"]["x"] = 1150.0


def _beyond(content):
    del content["parts"][1]["limits_mm"]
    content["postures"]["there"]["x"] = 1000.1


def _twice(content):
    content["parts"].append(content["parts"][1] | {"name": "other"})
    content["postures"]["there"]["other"] = 500.0


def _spring(content):
    content["point_springs"] = [
        {"name": "s", "between": ["", "bridge"], "points_mm": [[0.0] * 3] * 2, "stiffness_N_per_mm": 1.0}
    ]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["parts"][1].update(rides_on="brigde"), "rides_on = 'brigde' is no beam before it"),
        (lambda d: d["parts"].reverse(), "rides_on = 'bridge' is no beam before it"),
        (lambda d: d["parts"][1].update(rides_on="carriage"), "rides_on = 'carriage' is no beam before it"),
        (lambda d: d["parts"][1].update(axis="y"), r"its axis is not along the beam, .*: give \[1, 0, 0\]"),
        (lambda d: d["parts"][1].update(axis=[-1.0, 0.0, 0.0]), "its axis is not along the beam"),
        (lambda d: d["parts"][1].update(after="bridge"), "has after and rides_on"),
        (_turning, "what rides on a beam slides"),
        (_passive, "what rides on a beam slides, and is actuated or coupled"),
        (_twice, "joint 'x' rides on it too, and a beam carries one"),
        (_spring, "joint 'x' rides on 'bridge': fix it to another part"),
        (lambda d: d["parts"][0].update(bow_mm=[1.0, 0.0]), "that beam needs a section, and neither"),
        (lambda d: d["parts"][0].update(segments=1), "segments = 1, one spring without a shape"),
        (_nowhere, "limits, 1100 to 1200 mm, leave no place on 1000 mm of beam"),
        (_beyond, "1000.1 exceeds its limit 1000"),
        (lambda d: d["postures"]["there"].update(x=-0.1), "x = -0.1 is below its limit 0 by 0.1 mm"),
    ],
)  # fmt: skip
def test_what_cannot_ride_is_refused(change, said):
    content = copy.deepcopy(DOCUMENT)
    change(content)
    with pytest.raises(ModelFileError, match=said) as caught:
        build_chain(content, "crane.toml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("place", [-1.0, 1000.5])
def test_off_the_beam_nothing_is_computed(place):
    machine = build_chain(DOCUMENT, "crane.toml")
    for ask in (
        lambda: vjm.stiffness(machine, {"x": place}, wrench=(0.0, 0.0, -1.0, 0.0, 0.0, 0.0)),
        lambda: vjm.modes(machine, {"x": place}),
        lambda: equilibria(Mechanism(machine.split()), np.array([[400.0], [place]])),
        lambda: vjm.tool_postures(machine, (place, 0.0, 0.0)),
        lambda: vjm.compensate(machine, [(place, 0.0, 0.0)]),
        lambda: machine.locked({"x": place}),
    ):
        with pytest.raises(ValueError, match=r"limit|not on the beam|out of reach"):
            ask()


def test_one_spring_at_the_end_of_a_beam_carries_nothing_on_its_way():
    machine = cantilever()
    with pytest.raises(ValueError, match=r"joint 'x' rides on a beam: .* Take an engine that splits it"):
        vjm.stiffness(machine, "there", wrench=(0.0, 0.0, -1.0, 0.0, 0.0, 0.0), engine=vjm.VjmEngine())


BODIES = {
    "format": 1, "kind": "bodies", "name": "crane", "title": "A crane", "source": "made up",
    "units": {"length": "mm", "force": "N", "angle": "rad"},
    "end": {"body": "carriage", "at_mm": [100.0, 650.0, 0.0]},
    "bodies": [
        {"name": "near"}, {"name": "far"},
        {"name": "carriage", "mass_kg": 5.0, "centre_of_mass_mm": [100.0, 650.0, 0.0]},
    ],
    "joints": [
        {"name": "x", "kind": "actuated", "motion": "slides", "between": ["near", "carriage"], "axis": "y",
         "rides_on": "bridge", "at_mm": [100.0, 650.0, 0.0], "drawn": 400.0},
        {"name": "foot", "kind": "weld", "between": ["ground", "near"], "at_mm": [100.0, 250.0, 0.0]},
    ],
    "beams": [
        {"name": "bridge", "between": ["near", "far"], "from_mm": [100.0, 250.0, 0.0],
         "to_mm": [100.0, 1250.0, 0.0], "mass_kg": 2.0,
         "section": {"EA_N": 1e8, "GJ_Nmm2": 8e9, "EIy_Nmm2": 1e10, "EIz_Nmm2": 1e10}},
    ],
    "postures": {"there": {"x": 900.0}},
}  # fmt: skip


def test_a_file_of_bodies_says_the_same():
    drawn, chain = vjm.load(BODIES), vjm.load(DOCUMENT)
    for place in (0.0, 400.0, 900.0, 1000.0):
        one, other = (
            vjm.stiffness(machine, {"x": place}, wrench=wrench, gravity=(0.0, 0.0, -9.81))
            for machine, wrench in ((drawn, (0.0, 0.0, -90.0, 0, 0, 0)), (chain, (0.0, 0.0, -90.0, 0, 0, 0)))
        )
        assert one.displacement[2] == pytest.approx(other.displacement[2], rel=1e-9, abs=1e-12)
        assert one.displacement[1] == pytest.approx(other.displacement[0], rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d["joints"][0].update(rides_on="brige"), "rides_on = 'brige' is no beam.*bridge"),
        (lambda d: d["joints"][0].update(between=["far", "carriage"]), "whose first body is 'near'"),
        (lambda d: d["joints"][0].update(drawn=300.0), r"drawn = 300 puts it at \[100, 550, 0\]"),
        (lambda d: d["joints"][0].update(kind="joint"), "of kind 'actuated' or 'coupled'"),
        (lambda d: d["joints"][0].update(between=["carriage", "near"]), "rides_on is told from the first body"),
        (lambda d: d["joints"][1].update(between=["ground", "far"], at_mm=[100.0, 1250.0, 0.0]),
         "'bridge': where joints ride on it is told from the first body"),
    ],
)  # fmt: skip
def test_bodies_that_cannot_ride_are_refused(change, said):
    content = copy.deepcopy(BODIES)
    change(content)
    with pytest.raises(ModelFileError, match=said) as caught:
        vjm.load(content)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("limits", "doubted"), [([-10.0, 1200.0], True), ([0.0, 1000.0], False)])
def test_limits_beyond_the_beam_are_said(limits, doubted):
    content = copy.deepcopy(DOCUMENT)
    content["parts"][1]["limits_mm"] = limits
    said = [str(finding) for finding in vjm.check(content).findings]
    assert any("go beyond the beam 'bridge': it stops at 0 and 1000 mm" in one for one in said) == doubted
