"""Causes in the joints of an arm, against the arm with the same built into its joints and against closed forms."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from helpers import linear_arm, template_machines
from scipy.optimize import minimize_scalar

from vjm.engines import VjmEngine
from vjm.io.model_file import build_chain, load_chain, read_document
from vjm.model.load_case import LoadCase
from vjm.model.parts import Joint, JointCoupling
from vjm_updating.mechanisms import joint_motions as joint_motions_module
from vjm_updating.mechanisms.catalogue import catalogue
from vjm_updating.mechanisms.drives import EXPONENT, ActuatorHardening, drives
from vjm_updating.mechanisms.effect import ExperimentContext
from vjm_updating.mechanisms.equilibrium_tables import HalfRay, tabulate
from vjm_updating.mechanisms.joint_motions import joint_motions, motions_of_readings
from vjm_updating.mechanisms.modified_chain import ModifiedMachine
from vjm_updating.mechanisms.series_elements import History, balance
from vjm_updating.poses.machine import PoseMachine

JOINTS = ("shoulder", "elbow")
SOFT = 5e-6
"""rad/(N mm) beyond 5e-7 and 1e-6 of the model."""
LENGTH = 500.0
"""mm of the longest link."""
UNIT = np.repeat([1.0, 900.0], 3)
"""Moments over the arm's length."""


def arm(change=lambda part: part):
    chain = load_chain("planar-2r")
    return ModifiedMachine(replace(chain, parts=tuple(change(part) for part in chain.parts)), VjmEngine(4))


def softer(joint, by):
    """The arm with a joint's own compliance larger in its model."""
    return arm(lambda part: replace(part, compliance=part.compliance + by) if part.name == joint else part)


def scene_of(machine, postures=("bent", "folded"), axis=0, force=300.0):
    rays = tuple((posture, tuple(np.eye(6)[axis])) for posture in postures)
    return ExperimentContext(machine.nominal, machine.engine, force, 1.0, rays=rays)


def effect_of(machine, label, **more):
    return next(effect for effect in catalogue(scene_of(machine, **more)) if effect.label == label)


def history_of(machine, posture, axis, u):
    n = len(u)
    lever = np.tile(machine.lever(posture), (n, 1))
    joints = motions_of_readings(
        machine, [posture] * len(u), [(posture, np.eye(6)[axis], np.eye(6)[axis], np.arange(len(u)), u[:, axis])]
    )
    return History(
        np.arange(float(n)), np.arange(n) == 0, np.tile(machine.line(posture), (n, 1)), lever, {}, *joints
    )


def look_of(machine, posture, axis, reach):
    """The machine's own wrench and stiffness on a ramp to one side."""
    table = tabulate(machine, HalfRay.of(posture, np.eye(6)[axis], 1.05 * reach), pulls=())

    def look(u):
        W, K = table.at(u[:, axis])
        return W + np.einsum("nij,nj->ni", K, u - np.outer(u[:, axis], np.eye(6)[axis])), K

    return look


def in_series(machine, effect, values, posture, axis, reach, n=9):
    u = np.outer(np.linspace(0.0, reach, n)[1:], np.eye(6)[axis])
    elements = effect.elements(machine, values)
    return u, balance(look_of(machine, posture, axis, reach), u, elements, history_of(machine, posture, axis, u))


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("posture", ["bent", "folded"])
@pytest.mark.parametrize("joint", JOINTS)
def test_a_soft_drive_in_series_is_the_joint_with_its_compliance(joint, posture, axis):
    machine, soft = arm(), softer(joint, SOFT)
    effect = effect_of(machine, f"actuator_compliance.{joint}")
    for reach in (1e-4, 0.1, 1.0):
        _, found = in_series(machine, effect, (SOFT,), posture, axis, reach)
        drawn, expected = (
            m.engine.trace(m.nominal, LoadCase(posture, reach, "xy"[axis], steps=8)).wrench[1:] / UNIT
            for m in (machine, soft)
        )
        size = np.abs(expected).max()
        assert np.abs(expected - drawn).max() > 3e-3 * size
        # rounding of small loads; of first order in what moves over the links' length it would be 1.7 at most, of
        # second 0.6 of a tenth, where joint and path are interpolated, and 0.22
        off = {1e-4: 1e-6, 0.1: 0.07 / LENGTH, 1.0: 0.3 / LENGTH}[reach]
        np.testing.assert_allclose(found.wrench / UNIT, expected, rtol=0.0, atol=off * size)


def test_where_second_order_is_not_known_the_motion_is_that_of_the_displaced_machine(monkeypatch):
    """As on a ray with a bifurcation; the machine's arm under load is not its unloaded one."""
    monkeypatch.setattr(joint_motions_module, "_by_turns", lambda *_: {})
    machine, u = arm(), np.outer([0.5, 1.0], np.eye(6)[1])
    history = history_of(machine, "bent", 1, u)
    unloaded = joint_motions(machine, "bent")
    for joint in JOINTS:
        loaded = history.loaded[joint]
        assert np.array_equal(loaded.motion, history.joints[joint])
        assert np.abs(loaded.motion[-1] - unloaded[joint]).max() > 0.1
        assert not loaded.bend.any()
        assert not loaded.lever.any()


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
@pytest.mark.parametrize("kind", ["slides", "matrix", "sprung", "coupled", "as commanded"])
def test_every_kind_of_joint_is_a_drive(kind, axis):
    """Motion by what the model's end-effector does if the joint's compliance is ten times as large."""
    axis = np.array(axis)
    made = {
        "slides": lambda c: Joint("elbow", axis, slides=True, compliance=1e-5 + c),
        "matrix": lambda c: Joint(
            "elbow", axis, matrix=1e-6 * np.eye(6) + c * np.outer(np.r_[0, 0, 0, axis], np.r_[0, 0, 0, axis])
        ),
        "sprung": lambda c: Joint("elbow", axis, passive=True, compliance=1e-6 + c),
        "coupled": lambda c: Joint(
            "elbow", axis, compliance=1e-6 + c, coupling=JointCoupling((("shoulder", 2.0),))
        ),
        "as commanded": lambda c: Joint(
            "elbow", axis, compliance=1e-6 + c, coupling=JointCoupling((("shoulder", 2.0),), as_deflected=False)
        ),
    }[kind]

    def built(c):
        chain = arm(lambda part: made(c) if part.name == "elbow" else replace(part, compliance=0.0)
                    if part.name == "shoulder" else part).nominal  # fmt: skip
        held = {label: dict(values) for label, values in chain.held.items()}
        if kind in ("coupled", "as commanded"):
            held = {label: {"shoulder": values["shoulder"]} for label, values in held.items()}
        return ModifiedMachine(replace(chain, held=held), VjmEngine(4))

    machine, c = built(0.0), 1e-5
    effect = effect_of(machine, "actuator_compliance.elbow")
    assert effect.quantities()[0].name == ("compliance_mm_per_N" if kind == "slides" else "compliance_rad_per_Nmm")
    # compliance at the end-effector of the machine with more of it in the joint, less that of the machine as drawn
    stiff = [tabulate(m, HalfRay.of("bent", np.eye(6)[0], 1e-4), ()).stiffness[0] for m in (machine, built(c))]
    more = np.linalg.inv(stiff[1]) - np.linalg.inv(stiff[0])
    motion = joint_motions(machine, "bent")["elbow"]
    np.testing.assert_allclose(more, c * np.outer(motion, motion), atol=1e-6 * np.abs(more).max())
    np.testing.assert_allclose(
        tabulate(ModifiedMachine(effect.built(machine.nominal, (c,)), machine.engine),
                 HalfRay.of("bent", np.eye(6)[0], 1e-4), ()).stiffness[0], stiff[1], rtol=1e-9, atol=1e-6,
    )  # fmt: skip


def test_a_coupling_passes_on_what_bends():
    def with_belt(c):
        def change(part):
            if part.name == "elbow":
                return Joint("elbow", part.axis, coupling=JointCoupling((("shoulder", -1.0),)))
            return replace(part, compliance=c) if part.name == "shoulder" else part

        # no beam between the joints: a coupling across one is for another engine
        chain = arm(change).nominal
        parts = sorted(
            chain.parts, key=lambda part: ("shoulder", "elbow", "upper", "fore", "tool").index(part.name)
        )
        held = {label: {"shoulder": values["shoulder"]} for label, values in chain.held.items()}
        return ModifiedMachine(replace(chain, parts=tuple(parts), held=held), VjmEngine(4))

    motion = joint_motions(with_belt(0.0), "bent")["shoulder"]
    more = np.subtract(*(
        np.linalg.inv(tabulate(with_belt(c), HalfRay.of("bent", np.eye(6)[0], 1e-4), ()).stiffness[0])
        for c in (3e-6, 1e-6)
    ))  # fmt: skip
    np.testing.assert_allclose(more, 2e-6 * np.outer(motion, motion), atol=1e-12)
    # turned back by as much, and moved by nothing: both axes are one
    np.testing.assert_allclose(motion, 0.0, atol=1e-9)


def test_joints_about_one_line_are_one_place():
    def twice(part):
        return (part, Joint("wrist", part.axis, value=None)) if part.name == "elbow" else (part,)

    chain = load_chain("planar-2r")
    parts = tuple(new for part in chain.parts for new in twice(part))
    held = {label: {**values, "wrist": 0.3} for label, values in chain.held.items()}
    machine = ModifiedMachine(replace(chain, parts=parts, held=held), VjmEngine(4))
    assert [one.part for one in drives(scene_of(machine))] == ["shoulder", "elbow or wrist"]


def test_sizes_follow_from_the_arms_lengths():
    (quantity,) = effect_of(arm(), "actuator_compliance.elbow").quantities()
    assert quantity.name == "compliance_rad_per_Nmm"
    # 2 % of the gear's own, which moves the longest link's end by more than 1 mm in 300 N does
    assert quantity.scale == pytest.approx(0.02 * 1e-6)
    (quantity,) = effect_of(softer("elbow", -1e-6), "actuator_compliance.elbow").quantities()
    assert quantity.scale == pytest.approx(0.02 / 300.0 / LENGTH**2)


def test_the_papers_chain_has_its_one_drive():
    machine = ModifiedMachine(load_chain("orthoglide-chain"), VjmEngine(8))
    (one,) = drives(ExperimentContext(machine.nominal, machine.engine, 300.0, 1.0))
    assert (one.part, one.joint, one.turns, one.lever) == ("", "", False, 1.0)


@pytest.mark.parametrize("joint", JOINTS)
def test_a_file_says_it(joint):
    machine = arm()
    document = copy.deepcopy(read_document("planar-2r").content)
    effect_of(machine, f"actuator_compliance.{joint}").write(document, machine.nominal, (SOFT,))
    written = build_chain(document, "soft.toml")
    found = {part.name: part.compliance for part in written.parts if part.name in JOINTS}
    drawn = {part.name: part.compliance for part in machine.nominal.parts if part.name in JOINTS}
    assert found == pytest.approx({name: c + SOFT * (name == joint) for name, c in drawn.items()}, rel=1e-12)


LINKS = linear_arm.arm("upper", "fore")


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("joint", ["j-upper", "j-fore"])
@pytest.mark.parametrize(
    ("cause", "values"), [("actuator_backlash", (1e-4, 0.1, 5000.0, 0.3)), ("actuator_hardening", (4.0, 2e-8, 1.0))]
)
def test_a_gears_law_is_that_of_its_moment(tmp_path, cause, values, joint, axis):
    """Against virtual work with nothing of the package in it, at loads at which the arm is linear."""
    angles, reach = (0.5, 0.9), 0.1
    file = tmp_path / "arm.toml"
    file.write_text(linear_arm.model([replace(link, gives=0.0) for link in LINKS], {"bent": angles}))
    machine = ModifiedMachine(load_chain(file), VjmEngine(8))
    truth = linear_arm.Arm([replace(link, gives=0.0) for link in LINKS], angles)
    effect = effect_of(machine, f"{cause}.{joint}", postures=("bent",), axis=axis, force=1000.0)
    u, found = in_series(machine, effect, values, "bent", axis, reach)
    largest = effect.drive.force * effect.drive.lever
    expected = truth.shifted(u, joint, lambda M: law_of(cause, values, M, largest))
    plain = np.linalg.solve(truth.compliance(), u.T).T
    size = np.abs(expected / UNIT).max()
    moved = np.abs((expected - plain) / UNIT).max()
    # the arm is linear up to some 1e-3 of the forces; what no moment turns has none
    np.testing.assert_allclose(found.wrench / UNIT, expected / UNIT, rtol=0.0, atol=1e-3 * size)
    felt = np.abs(plain @ truth.moves[joint]).max() > 1e-6 * np.abs(plain[:, 3:]).max()
    assert felt == (moved > 5e-3 * size)


def law_of(cause, values, moment, largest):
    """Turn in rad under a moment in N mm."""
    if cause == "actuator_backlash":
        gap, offset, contact, ends = values
        soft = ends * (moment / largest) * np.hypot(moment / largest, contact / largest) ** (-1.0 / 3.0)
        return gap * (0.5 * np.tanh(moment / contact) + offset + soft)
    ratio, c, m = values
    u = abs(moment) / largest
    return c * moment * (1.0 + (1.0 / ratio - 1.0) * u**m / (m + 1.0))


def test_the_largest_moment_on_a_gear_is_that_of_the_test(tmp_path):
    machine = arm()
    for one in drives(scene_of(machine, ("bent",))):
        path = machine.engine.trace(machine.nominal, LoadCase("bent", 1e-3, "x", steps=4))
        moment = abs(path.wrench[-1] @ joint_motions(machine, "bent")[one.joint])
        expected = 300.0 * moment / np.linalg.norm(path.wrench[-1, :3])
        # a ramp's beginning: a micrometre over some hundred millimetres, of a difference of large moments
        assert one.force * one.lever == pytest.approx(expected, rel=1e-2)


# A drive's stiffness over its load.


LARGEST, COMPLIANCE = 2000.0, 5e-5


def deflection(N, values, compliance=0.0):
    """Extension beyond the model's own spring, and its slope."""
    machine = ModifiedMachine(load_chain("orthoglide-chain"), VjmEngine(4))
    (element,) = ActuatorHardening(LARGEST, compliance).elements(machine, values)
    nowhere = np.zeros((len(N), 3))
    return element.law(N, History(np.zeros(len(N)), np.zeros(len(N), dtype=bool), nowhere, nowhere))


@pytest.mark.parametrize(("ratio", "exponent"), [(0.3, 0.5), (0.3, 2.0), (4.0, 1.0), (4.0, 0.4)])
def test_the_ratio_is_that_of_the_tangents_and_the_tangent_that_of_the_curve(ratio, exponent):
    N = np.array([-1.5, -1.0, -0.4, 0.0, 0.2, 1.0, 1.5]) * LARGEST
    x, slope = deflection(N, (ratio, COMPLIANCE, exponent))
    assert slope[[1, 3, 5, 6]] == pytest.approx(COMPLIANCE * np.array([1.0 / ratio, 1.0, 1.0 / ratio, 1.0 / ratio]))
    assert x == pytest.approx(-deflection(-N, (ratio, COMPLIANCE, exponent))[0])
    h = 1e-3 * LARGEST
    steps = (
        deflection(N + h, (ratio, COMPLIANCE, exponent))[0] - deflection(N - h, (ratio, COMPLIANCE, exponent))[0]
    ) / (2.0 * h)
    smooth = [2, 4]
    # central differences miss m (m - 1)/6 (h/N)² of what the load adds: 8e-6 at most, at a fifth of it and m = 2
    assert slope[smooth] == pytest.approx(steps[smooth], rel=1e-5)


def test_the_models_own_spring_is_replaced():
    N = np.linspace(-LARGEST, LARGEST, 5)
    own, _ = deflection(N, (2.0, 1.0), compliance=COMPLIANCE)
    whole, _ = deflection(N, (2.0, COMPLIANCE, 1.0))
    assert own == pytest.approx(whole - COMPLIANCE * N)


@pytest.mark.parametrize("law", ["stiffness", "exponential"])
@pytest.mark.parametrize("ratio", [0.3, 0.5, 2.0, 3.0])
def test_other_laws_come_near(law, ratio):
    """Stiffness that grows, or falls, evenly or exponentially: to a part of what it changes."""
    N = np.linspace(0.0, LARGEST, 41)
    u, a = N / LARGEST, ratio - 1.0
    s = np.log(ratio)
    x = COMPLIANCE * LARGEST * (np.log1p(a * u) / a if law == "stiffness" else -np.expm1(-s * u) / s)

    def missed(exponent):
        ours = deflection(N, (ratio, COMPLIANCE, exponent))[0]
        return np.abs(ours - x).max() / np.abs(x - COMPLIANCE * N).max()

    best = minimize_scalar(missed, bounds=(EXPONENT.low, EXPONENT.high), method="bounded")
    # with both ends' tangents held, less than the tenth of its size that a search forgives a law
    assert best.fun < 0.08
    # and within what is thought usual
    assert abs(np.log(best.x / EXPONENT.usual)) < 2.0 * EXPONENT.spread


# What calibration and diagnosis say of a machine with a carriage.


def test_its_beam_has_no_bow_which_no_file_could_say():
    scene = ExperimentContext(template_machines.gantry(), VjmEngine(4), 100.0, 0.1)
    labels = {effect.label for effect in catalogue(scene)}
    assert {"link_compliance.bridge", "link_compliance.ram", "link_bow.ram"} <= labels
    assert "link_bow.bridge" not in labels


def test_a_test_of_poses_has_the_errors_of_its_frame_behind_it():
    machine = template_machines.boom()
    assert PoseMachine(machine, {}).joints == ("raise", "out")
    riding = PoseMachine(template_machines.axis(), {"tool": ("", np.zeros(3))})
    before = riding.tree.chain.predecessors
    assert before["x~shift-x"] == "x"
    assert before["table~root"] == "x~turn-y"
    # it stands on the ground at both ends
    assert not [spring for spring in riding.springs if spring.kind == "base"]
