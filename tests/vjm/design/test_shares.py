"""Compliance shares: by hand for an arm, by differences for loops, and their sums."""

from dataclasses import replace

import numpy as np
import pytest

import vjm
from vjm.design.linear_state import loaded_posture, state_of
from vjm.design.shares import shares
from vjm.engines import VjmEngine, engine_by_name
from vjm.model.load_case import Load
from vjm.model.machine import Machine
from vjm.model.parameters import compliance_factor
from vjm.model.parts import Joint, PointSpring, RigidOffset
from vjm.rotations import rotate_matrix6, shift_compliance, translation

WRENCH = (30.0, -20.0, -50.0, 900.0, 1500.0, -700.0)
EXACT = 1e-12
"""Of sums: rounding of some hundred terms."""


def placed(chain, label):
    """Frames before and behind every part of an open chain, by products of its own transforms."""
    T, frames = chain.base, {}
    for part in chain.at(label).parts:
        own = np.eye(4)
        if hasattr(part, "held_at"):
            own = part.motion(part.held_at)
        elif hasattr(part, "tip"):
            own = translation(part.tip)
        else:
            own = part.transform
        frames[part.name] = (T, T @ own)
        T = T @ own
    return frames, T


def test_an_arm_of_six_joints_by_hand(six_joints):
    found = shares(six_joints, "bent", wrench=WRENCH, engine=VjmEngine())
    frames, end = placed(six_joints, "bent")
    F = np.array(WRENCH)
    by_hand = {}
    for part in six_joints.parts:
        _, behind = frames[part.name]
        if hasattr(part, "lateral"):
            axis = behind[:3, :3] @ part.axis
            J = np.concatenate([np.cross(axis, end[:3, 3] - behind[:3, 3]), axis])
            by_hand[part.name, "joint"] = part.compliance * J * (J @ F)
            if any(part.lateral):
                # across y: z and x, see `joint_axes`
                total = np.zeros(6)
                for c, column in zip(part.lateral, (2, 0), strict=True):
                    across = behind[:3, column]
                    J = np.concatenate([np.cross(across, end[:3, 3] - behind[:3, 3]), across])
                    total += c * J * (J @ F)
                by_hand[part.name, "bearing"] = total
        elif hasattr(part, "section"):
            at_tip = rotate_matrix6(part.section.compliance(part.length), behind[:3, :3])
            by_hand[part.name, "beam"] = shift_compliance(at_tip, end[:3, 3] - behind[:3, 3]) @ F
    assert {(row.part, row.kind) for row in found.rows} == set(by_hand)
    size = np.abs(found.deflection)
    for row in found.rows:
        np.testing.assert_array_less(np.abs(row.deflection - by_hand[row.part, row.kind]) / size, 1e-11)


MACHINES = {
    "arm": ("ur10", {"posture": "stretched", "wrench": WRENCH}),
    "arm with beams": ("planar-2r", {"wrench": (0.0, -10.0, 2.0, 50.0, 0.0, 0.0)}),
    "platform": ("orthoglide", {"wrench": (30.0, -20.0, -50.0, 90.0, 150.0, -70.0)}),
    "hexapod": ("hexapod", {"wrench": WRENCH}),
    "loop under weight": ("palletiser", {"wrench": (10.0, 5.0, 0.0, 0.0, 0.0, 0.0), "gravity": (0.0, 0.0, -9.81)}),
    "held chain": ("orthoglide-chain", {"displacement": (-0.1, 0.05, 0.02, 0.0, 0.0, 1e-4)}),
}


@pytest.mark.parametrize(("name", "asked"), MACHINES.values(), ids=MACHINES)
def test_shares_add_up(name, asked):
    found = shares(vjm.load(name), **asked)
    unit = np.repeat([1.0, found.length], 3)
    total = sum(row.deflection for row in found.rows)
    assert np.abs((total - found.deflection) * unit).max() < EXACT * np.abs(found.deflection * unit).max()
    # the work of the loads: of a wrench alone the strain energy is half of it
    if "gravity" not in asked:
        energy = sum(row.energy for row in found.rows)
        assert energy == pytest.approx(0.5 * found.wrench @ found.deflection, rel=1e-9)


@pytest.mark.parametrize("name", ["planar-2r", "orthoglide", "hexapod", "palletiser"])
def test_the_whole_is_the_compliance_times_the_wrench(name):
    machine, F = vjm.load(name), np.array([3.0, -2.0, 1.0, 5.0, 4.0, -6.0])
    found = shares(machine, wrench=F)
    loaded = vjm.stiffness(machine, found.posture, wrench=(0.0,) * 6)
    if loaded.unloaded_compliance is not None:
        expected = loaded.unloaded_compliance @ F
    else:
        expected = np.linalg.solve(loaded.unloaded, F)
    np.testing.assert_allclose(found.deflection, expected, rtol=1e-7, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("name", "part"), [("orthoglide", "y/link"), ("hexapod", "c/strut"), ("double-pantograph", "b-low")]
)
def test_a_share_in_a_loop_is_the_derivative_by_its_compliance(name, part):
    """``u_p = ∂C/∂ln c_p F``: by differences of the compliance that the compiled kernel gives."""
    machine = vjm.load(name)
    wrench, label = np.array([1.0, -0.7, 0.4, 2.0, -1.0, 3.0]), next(iter(machine.postures))
    found = shares(machine, label, wrench=wrench)
    parameter, engine = compliance_factor(machine, part), engine_by_name("vjm", chain=machine)

    def compliance(factor):
        changed = parameter.apply(machine, factor)
        return vjm.stiffness(changed, label, wrench=(0.0,) * 6, engine=engine).unloaded_compliance

    h = 1e-2
    wide, near = ((compliance(1.0 + s) - compliance(1.0 - s)) / (2.0 * s) for s in (h, 0.5 * h))
    slope = (4.0 * near - wide) / 3.0 @ wrench
    (row,) = (row for row in found.rows if row.part == part)
    # of Richardson's extrapolation h⁴ is left, and of rounding 1e-12 over h
    unit = np.repeat([1.0, found.length], 3)
    assert np.abs((slope - row.deflection) * unit).max() < 1e-7 * np.abs(row.deflection * unit).max()


def test_springs_between_points_and_mounts_have_shares():
    """A lever on a hinge spring, a stay at right angles to it, on a mount that slides: statics by hand."""
    parts = (
        Joint("frame", np.array([0.0, 0.0, 1.0]), slides=True, passive=True, fixed=True, compliance=1e-3),
        Joint("hinge", np.array([0.0, 1.0, 0.0]), passive=True, compliance=1e-05),
        RigidOffset("lever", translation((100.0, 0.0, 0.0))),
    )
    stay = PointSpring("stay", ("", "lever"), np.array([[50.0, 0.0, -40.0], [50.0, 0.0, 0.0]]), 20.0, 40.0)
    chain = Machine(
        "lever", parts, postures={"level": np.zeros(0)}, held={"level": {"hinge": 0.0}}, point_springs=(stay,)
    )
    found = shares(chain, "level", wrench=(0.0, 0.0, -10.0, 0.0, 0.0, 0.0))
    # unknowns: sink w of the frame, turn a of the hinge about y (down at the tip): k_f w + k_s (w + 50 a) = 10,
    # k_h a + 50 k_s (w + 50 a) = 1000
    A = np.array([[1e3 + 20.0, 1e3], [1e3, 1e5 + 5e4]])
    w, a = np.linalg.solve(A, [10.0, 1000.0])
    unit = np.linalg.solve(A, [1.0, 100.0])
    uz = {row.part: row.deflection[2] for row in found.rows}
    assert uz["frame"] == pytest.approx(-1e3 * unit[0] * w, rel=EXACT)
    assert uz["hinge"] == pytest.approx(-1e5 * unit[1] * a, rel=EXACT)
    assert uz["stay"] == pytest.approx(-20.0 * (unit[0] + 50.0 * unit[1]) * (w + 50.0 * a), rel=EXACT)
    assert {row.part: row.kind for row in found.rows} == {"frame": "mount", "hinge": "spring", "stay": "spring"}


def test_large_deflections_are_said(six_joints):
    small, large = (
        shares(six_joints, "bent", wrench=tuple(f * v for v in WRENCH), engine=VjmEngine()) for f in (1e-3, 3.0)
    )
    assert small.nonlinearity < 1e-3 < 1e-2 < large.nonlinearity
    np.testing.assert_allclose(small.energies, small.energies_loaded, atol=1e-3)
    assert np.abs(large.energies - large.energies_loaded).max() > 1e-3
    np.testing.assert_allclose(small.energies, large.energies, atol=1e-12)


def test_the_energy_of_a_large_load_is_its_work(six_joints):
    """Strain energies of the loaded equilibrium add up to ``∫ F du`` along the load."""
    steps = np.polynomial.legendre.leggauss(8)
    force = np.array([60.0, -40.0, -100.0, 0.0, 0.0, 0.0])
    found = shares(six_joints, "bent", wrench=force)
    # ∫ F du = F u − ∫ u dF with F = s · force
    area = sum(
        0.5 * weight * force @ state_of(loaded_posture(six_joints, "bent", wrench=0.5 * (1.0 + s) * force)).moved
        for s, weight in zip(*steps, strict=True)
    )
    work = force @ found.deflection_loaded - area
    assert found.nonlinearity > 1e-3
    assert sum(row.energy_loaded for row in found.rows) == pytest.approx(work, rel=1e-9)


def test_a_load_that_strains_nothing_has_no_shares():
    found = shares(vjm.load("ur10"), "upright", wrench=(0.0, 0.0, -100.0, 0.0, 0.0, 0.0))
    assert np.isnan(found.nonlinearity)
    assert not found.deflection.any()
    assert np.isnan(found.energies).all()


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({}, "nothing loads it"),
        ({"wrench": (1.0, 0.0)}, "wrench must be six finite numbers"),
        ({"wrench": (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)}, "its end moves without straining a spring"),
        ({"displacement": (0.0,) * 6}, "a displacement of zero has no shares"),
        ({"displacement": (1.0,) * 6, "loads": [Load((1.0,) * 6)]}, "displacement holds the end"),
        ({"wrench": (1.0,) * 6, "end": "hand"}, "has no end frame 'hand'"),
    ],
)
def test_what_has_no_shares_is_refused(asked, words):
    with pytest.raises(ValueError, match=words):
        shares(vjm.load("orthoglide-chain"), "A", **asked)


def test_passive_joints_of_a_held_chain_move_and_store_nothing():
    """Their motion closes the sum of a held chain; the springs have all of its energy."""
    found = shares(vjm.load("orthoglide-chain"), "A", displacement=(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    motion = next(row for row in found.rows if row.kind == "motion")
    assert motion.energy == 0.0
    assert np.abs(motion.deflection).max() > 1.0
    # (5) of the chain is what the wrench is
    K = vjm.stiffness(vjm.load("orthoglide-chain"), "A").unloaded
    np.testing.assert_allclose(found.wrench[0], -K[0, 0], rtol=1e-8)


def test_a_rigid_joint_has_no_share(six_joints):
    rigid = replace(
        six_joints,
        parts=tuple(replace(part, compliance=0.0) if part.name == "elbow" else part for part in six_joints.parts),
    )
    assert "elbow" not in {row.part for row in shares(rigid, "bent", wrench=WRENCH).rows}
