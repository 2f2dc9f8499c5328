"""Commands on arms and trees: free ends under weight and loads, and postures in which no stiffness exists."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vjm_validation.cli.main import run

LINK = '[[parts]]\nkind = "link"\nname = "{0}"\ntranslation_mm = [{1}, 0.0, 0.0]\nmass_kg = {2}\n'
LINK += "centre_of_mass_mm = [{3}, 0.0, 0.0]\n"
JOINT = '[[parts]]\nkind = "actuated"\nname = "{0}"\naxis = "z"\ncompliance_rad_per_Nmm = {1}\n'
HEAD = 'format = 1\nname = "planar"\ntitle = "three hinges"\nsource = "a test"\n'
HEAD += '[units]\nlength = "mm"\nforce = "N"\nangle = "rad"\n'
C = (1e-8, 2e-8, 4e-8)
L = (300.0, 200.0, 100.0)


@pytest.fixture
def validate(capsys):
    """The command in this process: what it prints; its status must be the one expected."""

    def command(*words, status=0):
        capsys.readouterr()
        found = run([str(word) for word in words])
        printed = capsys.readouterr()
        assert found == status, printed.err
        return printed

    return command


@pytest.fixture
def planar(tmp_path):
    """Three hinges about z in a row, the links along x."""
    parts = [JOINT.format(f"j{i}", C[i]) + LINK.format(f"l{i}", L[i], 2.0, 0.5 * L[i]) for i in range(3)]
    file = tmp_path / "planar.toml"
    file.write_text(HEAD + "".join(parts) + "[postures]\nstraight = { j0 = 0.0, j1 = 0.0, j2 = 0.0 }\n")
    return file


def test_a_posture_without_a_stiffness_has_a_compliance(validate, planar):
    """The force on the tip turns each hinge by its own lever; three hinges move it in three directions only."""
    force = 0.5
    found = json.loads(validate("stiffness", planar, "--wrench", f"0,{force},0,0,0,0", "--json").out)
    levers = np.array([600.0, 300.0, 100.0])
    # the second order of the turn, 2e-5 rad squared, over some ten
    assert list(found["torques"].values()) == pytest.approx(-force * levers, rel=1e-9)
    assert found["displacement"][1] == pytest.approx(force * float(np.array(C) @ levers**2), rel=1e-9)
    assert found["stiffness_loaded"] is None
    assert found["stiffness_unloaded"] is None
    # linear: rounding only
    assert np.array(found["compliance_unloaded"])[1, 1] == pytest.approx(float(np.array(C) @ levers**2), rel=1e-12)
    # in the straight posture no hinge moves x, which makes four directions with z, rx and ry
    unloaded = np.linalg.matrix_rank(np.array(found["compliance_unloaded"]), tol=1e-14)
    assert unloaded == 2
    straight = json.loads(validate("stiffness", planar, "--wrench", "0,0,0,0,0,0", "--json").out)
    assert np.linalg.matrix_rank(np.array(straight["rigid"])) == 4
    # where the load has deflected the arm, its hinges move x too, however little
    assert np.linalg.matrix_rank(np.array(found["rigid"])) == 3


def test_weight_and_a_load_on_a_part_bend_an_arm(validate, planar):
    words = ("--gravity", "0,-9.81,0", "--load", "l1@0.5:0,-20,0", "--json")
    found = json.loads(validate("stiffness", planar, *words).out)
    torques = [9.81 * 2.0 * (150 + 400 + 550) + 20.0 * 400, 9.81 * 2.0 * (100 + 250) + 20.0 * 100, 9.81 * 2.0 * 50]
    # the lever arms shorten by the turn squared, 2e-4 rad
    assert list(found["torques"].values()) == pytest.approx(torques, rel=1e-6)
    assert found["gravity"] == [0.0, -9.81, 0.0]
    assert found["residual"] < 1e-12


def test_every_posture_of_the_ur10_has_an_answer(validate):
    """Its first posture is singular: only the compliance exists there."""
    shown = validate("stiffness", "ur10", "--wrench", "0,0,-100,0,0,0").out
    assert "no 6×6 stiffness where a wrench moves nothing" in shown
    assert "held by" in shown
    assert "not moved by" in validate("stiffness", "ur10", "--posture", "upright").out
    assert "K^F loaded" in validate("stiffness", "ur10", "--posture", "work", "--gravity", "0,0,-9.81").out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("ur10", "--end", "hand"), "ur10 has no end frame 'hand'"),
        (("ur10", "--gravity", "0,9"), "--gravity: '0,9' is not three numbers"),
        (("ur10", "--load", "hand:1,0,0"), "no part 'hand' with points on it"),
        (
            ("orthoglide-chain", "--gravity", "0,0,-9.81"),
            "gravity, loads and an end frame are for",
        ),
    ],
)
def test_what_no_arm_takes_is_refused(validate, words, said):
    result = validate("stiffness", *words, status=2)
    assert said in result.err
    # a chain whose parts have no mass is doubted under gravity before it is refused
    assert len([line for line in result.err.splitlines() if "warning:" not in line]) == 1


def test_weight_and_a_load_change_what_a_bent_arm_bears(validate):
    """The load on a part stays while the force grows, so that the stiffness at the beginning is another."""
    words = (
        "planar-2r",
        "--posture",
        "bent",
        "--force",
        "--to",
        "200",
        "--free",
        "x,y,z,rx,ry,rz",
        "--direction=-",
        "--json",
    )
    plain, loaded = (
        json.loads(validate("buckling", *words, *more).out)["chain"]["bent"]["compression"]["vjm-16"]["K0"]
        for more in ((), ("--gravity", "0,-9.81,0", "--load", "upper@0.5:0,-400,0"))
    )
    # 50 N and 400 N turn the joints by up to a tenth of a radian
    assert 1e-3 < abs(loaded / plain - 1.0) < 0.2
