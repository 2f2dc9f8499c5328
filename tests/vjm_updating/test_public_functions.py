"""What `vjm_updating` offers in Python is what the commands do: maps, simulated tests, identified parts."""

from __future__ import annotations

import doctest
import importlib
import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

import vjm
import vjm_updating
from vjm_updating.simulate import DATA, SHEET, simulate

EXAMPLES = Path(str(files("vjm_validation"))) / "examples"
PUSH = (0.0, -10.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "module", ["vjm_updating.maps.run", "vjm_updating.identify.command", "vjm_updating.simulate"]
)
def test_examples_in_docstrings_hold(module):
    result = doctest.testmod(importlib.import_module(module))
    assert result.attempted >= 2
    assert result.failed == 0


def test_a_map_says_what_single_calls_say(tmp_path):
    arm, told = vjm.load("planar-2r"), []
    angles = [0.5, 1.0, 2.0]
    found = vjm_updating.workspace_map(
        arm, {"elbow": angles}, "deflection", wrench=PUSH, posture="bent", folder=tmp_path / "map",
        progress=lambda done, total: told.append((done, total)),
    )  # fmt: skip
    assert told[-1] == (3, 3)
    for angle, row in zip(angles, found.table(), strict=True):
        one = vjm.stiffness(arm, {"shoulder": 0.5, "elbow": angle}, wrench=PUSH, engine="vjm-4")
        # both solvers stop at 1e-8 mm
        assert row["u_mm"] == pytest.approx(float(np.linalg.norm(one.displacement[:3])), abs=1e-7)
        assert row["elbow"] == angle
    again = vjm_updating.workspace_map(arm, "elbow=0.5:1:2", "deflection", wrench=PUSH, posture="bent")
    np.testing.assert_array_equal(again.values, found.values[:2])
    assert json.loads(json.dumps(found.to_dict()))["points"][0]["status"] == "ok"
    assert found.plot().get_xlabel() == "elbow"
    with pytest.raises(ValueError, match="holds another map"):
        vjm_updating.workspace_map(arm, {"elbow": angles}, "frequency", folder=tmp_path / "map")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"grid": {"elbow": [0.5]}, "quantity": "shares"}, "needs a load"),
        ({"grid": {"elbow": [0.5]}, "quantity": "critical", "wrench": PUSH}, "leave wrench out"),
        ({"grid": {"elbow": [0.5]}, "wrench": (1.0,)}, "six finite numbers"),
        ({"grid": {"elbow": [1.0, 0.5]}}, "run upwards"),
        ({"grid": {"elbwo": [1.0]}}, "x, y, z or a joint"),
        ({"grid": {"elbow": [0.5]}, "quantity": "mass"}, "'mass' is not a valid"),
    ],
)
def test_a_map_that_makes_no_sense_is_refused(words, said):
    with pytest.raises(ValueError, match=said):
        vjm_updating.workspace_map(vjm.load("planar-2r"), **words)


def test_a_simulated_test_in_memory_is_that_of_the_files(tmp_path):
    sheet = EXAMPLES / "soft-springs/sheet.toml"
    options = {"hide": ["link_bow=1.0"], "seed": 7, "ramps": ["A:-1"]}
    made = vjm_updating.simulated("orthoglide-chain", sheet, **options)
    truth = simulate("orthoglide-chain", sheet, tmp_path, **options)
    assert truth == made.truth
    for name in (DATA, SHEET):
        assert (tmp_path / name).read_bytes() == made.files[name]
    read = vjm_updating.load_data(tmp_path / DATA, tmp_path / SHEET)
    assert dict(read.columns) == dict(made.data.columns)
    assert made.to_dict()["seed"] == 7


def test_an_identified_matrix_is_plain_python():
    found = vjm_updating.identified(matrix="foot-19")
    assert json.loads(json.dumps(found.to_dict()))["compliance"] == found.compliance.tolist()
    assert found.table()[0]["x"] == found.compliance[0, 0]
    for words, said in (({}, "either a machine"), ({"machine": vjm.load("planar-2r")}, "which one")):
        with pytest.raises(ValueError, match=said):
            vjm_updating.identified(**words)
