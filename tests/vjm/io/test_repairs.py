"""What no machine can have in a robot's file: repaired and said, left out, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.urdf_arm import arm, imported, joint, link, refusal
from scipy.optimize import minimize

from vjm.io.inertia import inertia_matrix, inertia_values, is_of_a_body, nearest_of_a_body
from vjm.rotations import rotation_from_vector

REVERSED = {"j2": joint("j2", "l1", "l2", more='<limit lower="1.5" upper="-2"/>')}


def part(found, name):
    return next(one for one in found.document["parts"] if one["name"] == name)


# --- moments of inertia ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(8))
def test_the_nearest_moments_are_nearer_than_any_other(seed):
    """Against a search over masses in space, Σ = L L', of the tensors tr(Σ) 1 − Σ that bodies have."""
    rng = np.random.default_rng(seed)
    R = rotation_from_vector(rng.normal(size=3))
    moments = rng.uniform(-0.5, 3.0, 3)
    moments[0] = np.abs(moments[1:]).sum() + rng.uniform(0.2, 3.0)
    given = R @ np.diag(moments) @ R.T
    assert not is_of_a_body(inertia_values(given))

    def off(entries):
        L = np.zeros((3, 3))
        L[np.tril_indices(3)] = entries
        spread = L @ L.T
        return float(np.sum((np.trace(spread) * np.eye(3) - spread - given) ** 2))

    starts = (rng.normal(size=6) for _ in range(20))
    least = min(minimize(off, start, method="BFGS", options={"gtol": 1e-10}).fun for start in starts)
    nearest = nearest_of_a_body(given)
    assert is_of_a_body(inertia_values(nearest), rounded=1e-12)
    # squares of what is not zero: a search ends at the square root of rounding
    assert np.sum((nearest - given) ** 2) == pytest.approx(least, rel=1e-6)


@pytest.mark.parametrize("moments", [(1.0, 1.0, 2.0), (3.0, 2.0, 4.0), (0.0, 1.0, 1.0)])
def test_moments_that_a_body_has_stay(moments):
    given = np.diag(moments)
    assert np.abs(nearest_of_a_body(given) - given).max() < 1e-14


def test_impossible_moments_of_a_urdf_become_the_nearest(tmp_path):
    """About turned axes, and said with the principal moments before and after."""
    odd = link("l2", inertia='<inertia ixx="1" iyy="1" izz="3"/>').replace('0.02"/>', '0.02" rpy="0.3 0.2 0.1"/>')
    found = imported(tmp_path, arm(l2=odd))
    moments = np.linalg.eigvalsh(inertia_matrix(part(found, "l2-mass")["inertia_kg_mm2"]))
    assert moments == pytest.approx([4e6 / 3, 4e6 / 3, 8e6 / 3], rel=1e-12)
    assert (
        "link 'l2': principal moments of inertia 1, 1, 3 kg m², which no body has, became 1.333, 1.333, 2.667, the "
        "nearest ones"
    ) in found.notes.changed


@pytest.mark.parametrize("inertia", ['<inertia ixx="1" iyy="1" izz="3"/>', '<inertia ixx="-1" iyy="1" izz="1"/>'])
def test_impossible_moments_are_left_out_or_refused_where_that_is_asked(tmp_path, inertia):
    text = arm(l2=link("l2", inertia=inertia))
    found = imported(tmp_path, text, repairs="left out")
    assert "inertia_kg_mm2" not in part(found, "l2-mass")
    assert "link 'l2' has moments of inertia that no body has: left out" in found.notes.doubtful
    said = refusal(tmp_path, text, repairs="refused")
    assert "line 5: link 'l2' has moments of inertia that no body has: correct them" in said


# --- limits, masses, bases ------------------------------------------------------------------------------------


def test_reversed_limits_are_exchanged_left_out_or_refused(tmp_path):
    found = imported(tmp_path, arm(**REVERSED))
    assert part(found, "j2")["limits_rad"] == [-2.0, 1.5]
    assert "joint 'j2' has the limits 1.5 to -2 rad, reversed: they were exchanged" in found.notes.changed
    found = imported(tmp_path, arm(**REVERSED), repairs="left out")
    assert "limits_rad" not in part(found, "j2")
    assert "joint 'j2' has the limits 1.5 to -2 rad, reversed: taken as none" in found.notes.doubtful
    assert "1.5 to -2 rad, reversed: give lower below upper" in refusal(
        tmp_path, arm(**REVERSED), repairs="refused"
    )


def test_a_mass_of_twenty_tonnes_is_read_and_doubted(tmp_path):
    found = imported(tmp_path, arm(l2=link("l2", "20000")))
    assert part(found, "l2-mass")["mass_kg"] == 20000.0
    assert "link 'l2' has a mass of 20000 kg, above 10000 kg: is it in g?" in found.notes.doubtful


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_a_floating_base_is_fixed_where_that_is_asked(tmp_path, kind):
    text = arm(j1=joint("j1", "base", "l1", kind))
    assert f"joint 'j1' is {kind}, and a machine stands on its base: --fix-base" in refusal(tmp_path, text)
    found = imported(tmp_path, text, fix_base=True)
    assert f"joint 'j1' is {kind}: it holds 'l1' where it is" in found.notes.changed
    fixed = imported(tmp_path, arm(j1=joint("j1", "base", "l1", "fixed")))
    assert found.document == fixed.document
