"""Offsets of calibrated robots that lead along nearly parallel axes and back are read; other units are not."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from helpers.urdf_arm import arm, imported, joint, link, refusal, said

from vjm.analysis import stiffness
from vjm.io.model_file import build_chain

# rad, by which the axes of the two middle joints miss being parallel
APART = 2e-4
LIMITS = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'


def calibrated(away: float, back: float | None = None, masses: str = "c") -> str:
    """Three joints, of which the second is placed ``away`` m along its axis and the third back again."""
    back = -away if back is None else back
    links = "".join(link(name) if name in masses else f'<link name="{name}"/>' for name in ("base", "a", "b", "c"))
    lift = f'<origin xyz="0.0001 {-away!r} 0" rpy="{np.pi / 2!r} 0 0"/>'
    elbow = f'<origin xyz="-0.4249 0 {back!r}" rpy="{APART!r} 0 0"/>'
    return (
        '<robot name="calibrated">' + links
        + joint("pan", "base", "a", origin='<origin xyz="0 0 .0891"/>', axis="0 0 1", more=LIMITS)
        + joint("lift", "a", "b", origin=lift, axis="0 0 1", more=LIMITS)
        + joint("elbow", "b", "c", origin=elbow, axis="0 0 1", more=LIMITS)
        + "</robot>"
    )  # fmt: skip


def placed(folder: Path, text: str) -> tuple[np.ndarray, np.ndarray]:
    """Where the end goes under a wrench and its weight, and its compliance."""
    chain = build_chain(imported(folder, text).document, "m.toml")
    found = stiffness(
        chain, {"pan": 0.3, "lift": 0.4, "elbow": 1.0}, wrench=(10.0, 20.0, -30.0, 0.0, 0.0, 0.0),
        gravity=(0.0, 0.0, -9.81),
    )  # fmt: skip
    assert found.loaded_compliance is not None
    return found.displacement, found.loaded_compliance


@pytest.mark.parametrize("away", [0.2, 238.4172315, -150.0, 2000.0])
def test_offsets_that_cancel_along_parallel_axes_are_read(tmp_path, away):
    """The joint's frame may stand anywhere on its axis: the machine is the same wherever it does."""
    there, here = placed(tmp_path, calibrated(away)), placed(tmp_path, calibrated(0.0))
    for found, exact in zip(there, here, strict=True):
        # lengths up to 2e6 mm have 1e-10 mm of rounding, and angles 1e-16; compliances sum some ten of such terms
        assert np.abs(found - exact).max() < 1e-8 * np.abs(exact).max()


def test_a_calibrated_offset_is_read_from_a_model_file_too(tmp_path):
    document = imported(tmp_path, calibrated(238.0)).document
    assert build_chain(document, "m.toml").characteristic_length == pytest.approx(238e3, rel=1e-3)


def test_a_mass_that_is_left_far_away_is_doubted(tmp_path):
    near, far = (said(imported(tmp_path, calibrated(238.0, back))) for back in (None, 238.0))
    assert "lies 476" in far
    assert "do the offsets lead back?" in far
    assert "do the offsets lead back?" not in near


@pytest.mark.parametrize("origin", ["300 0 0", "0 300 0", "0 0 300", "150 150 0"])
@pytest.mark.parametrize("axis", ["0 0 1", "0 1 0"])
def test_a_file_in_millimetres_is_refused(tmp_path, origin, axis):
    """Its offsets lead away: across the axes, or along one to which the next is not parallel."""
    turned = joint("j2", "l1", "l2", origin=f'<origin xyz="{origin}" rpy="0.4 0.3 0"/>', axis=axis)
    assert "the origin of joint 'j2' is" in (text := refusal(tmp_path, arm(j2=turned)))
    assert re.search(r"(300|212\.\d+) m away, beyond 100 m: is it in mm\? Give metres", text)


def test_a_centre_of_mass_in_millimetres_is_refused(tmp_path):
    far = link("l2").replace("0.15 0.01 0.02", "150 10 20")
    assert "the centre of mass of link 'l2' is" in refusal(tmp_path, arm(l2=far))


@pytest.mark.parametrize("mass", ['<mass value="0"/>', ""])
def test_moments_of_inertia_without_a_mass_are_said_to_be_left_out(tmp_path, mass):
    light = link("l2").replace('<mass value="2"/>', mass)
    assert "left out: the moments of inertia of link 'l2', which has no mass" in said(
        imported(tmp_path, arm(l2=light))
    )
    assert "the moments of inertia of link" not in said(imported(tmp_path, arm()))
