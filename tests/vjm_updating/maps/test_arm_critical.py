"""Maps of the smallest critical force of arms, and their command."""

import json

import pytest
from helpers.maps import mapped

import vjm
from vjm.engines import VjmEngine
from vjm.machine.critical_force import CriticalForce
from vjm_updating.maps.evaluate import MapQuantity
from vjm_validation.cli.main import run


def test_a_map_of_critical_forces_and_its_command(tmp_path, capsys):
    found = mapped(vjm.load("planar-2r"), VjmEngine(2), MapQuantity.CRITICAL, "elbow=0.4:2.8:3", "bent")
    assert list(found.why) == ["ok", "ok", "out of reach: elbow = 2.8 exceeds its limit 2.6 by 0.2 rad"]
    model = VjmEngine(2).model(vjm.load("planar-2r"))
    for q, row in zip(found.map.points.q[:2], found.values[:2], strict=True):
        alone = CriticalForce(model, 0, 20_000.0).weakest(q)
        assert row == pytest.approx([alone.force, *alone.direction])
    words = ["map", "planar-2r", "--posture", "bent", "--grid", "elbow=0.4:1.6:2", "--quantity", "critical"]
    assert run([*words, "--engine", "vjm-2", "--out", str(tmp_path / "map"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["columns"][0] == "F_cr_N"
    assert document["values"][0] == pytest.approx(found.values[0].tolist())
    assert (tmp_path / "map" / "map.png").stat().st_size > 5000
