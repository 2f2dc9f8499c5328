"""A derivative beside a difference: what agrees, what does not, and what cannot be told."""

import numpy as np
import pytest

from vjm.design import sensitivity as module
from vjm.design.sensitivity import verified
from vjm.model.machine import Machine
from vjm.model.parameters import joint_compliance
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES


@pytest.mark.parametrize("centre", [1e-8, 0.7, 3e5])
@pytest.mark.parametrize("wrong", [0.0, 1e-2, -0.8])
def test_a_wrong_derivative_is_told_from_a_right_one(centre, wrong):
    found = verified(lambda p: (p / centre) ** 3, 1.0, centre, 3.0 / centre * (1.0 + wrong))
    # x³: the difference errs by the square of its step
    assert found.difference == pytest.approx(3.0 / centre, rel=1e-6)
    assert found.doubtful == bool(wrong)


def test_at_a_corner_any_slope_between_the_two_agrees():
    assert not verified(lambda p: abs(p - 1.0), 0.0, 1.0, 0.5).doubtful
    assert verified(lambda p: abs(p - 1.0), 0.0, 1.0, 1.5).doubtful


def test_what_cannot_be_solved_again_says_why():
    def none(_):
        raise ValueError("no such machine")

    found = verified(none, 1.0, 1.0, 1.0)
    assert (found.difference, found.why, found.doubtful) == (None, "no such machine", False)
    assert "zero" in verified(none, 1.0, 0.0, 1.0).why


def arm() -> Machine:
    tube = Section(1e8, 1e12, 1e12, 1e12)
    parts = (Joint("drive", AXES["z"], fixed=True, compliance=1e-6), Beam("link", 400.0, section=tube))
    return Machine("arm", parts, postures={"home": np.zeros(0)})


def test_every_row_is_verified_and_a_wrong_one_is_doubtful(monkeypatch):
    drive = joint_compliance(arm(), "drive")
    load = (0.0, 10.0, 0.0, 0.0, 0.0, 0.0)
    (row,) = module.sensitivity(arm(), [drive], "deflection", along="y", wrench=load).rows
    # δ = F L² c of a small angle of 4e-3, whose square is what linear theory leaves out
    assert row.verification.difference == pytest.approx(10.0 * 400.0**2, rel=1e-4)
    assert not row.verification.why
    right = module.derivative_at
    monkeypatch.setattr(module, "derivative_at", lambda *asked: 0.2 * right(*asked))
    (row,) = module.sensitivity(arm(), [drive], "deflection", along="y", wrench=load).rows
    assert row.verification.doubtful
