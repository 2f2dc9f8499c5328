"""A platform that springs between points hold alone, such as cables: against its energy."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.command import validate
from scipy.optimize import root

import vjm
from vjm.io.toml_text import toml_text

POINTS = np.array([[-100.0, 60.0], [100.0, 60.0], [100.0, -60.0], [-100.0, -60.0]])


def cable_robot(seed, file, cable=True):
    """A planar platform on four cables, and the slopes ``(3,)`` of its energy by ``(x, z, ry)``."""
    rng = np.random.default_rng(seed)
    anchors = np.array([[-1000.0, 800.0], [1000.0, 800.0], [1000.0, -800.0], [-1000.0, -800.0]])
    anchors += rng.uniform(-100.0, 100.0, (4, 2))
    k, stretched = rng.uniform(10.0, 30.0, 4), rng.uniform(2.0, 6.0, 4)
    free = np.linalg.norm(anchors - POINTS, axis=1) - stretched

    def slope(pose):
        s, c = np.sin(pose[2]), np.cos(pose[2])
        # about y a turn takes z to x
        arm = np.stack([c * POINTS[:, 0] + s * POINTS[:, 1], c * POINTS[:, 1] - s * POINTS[:, 0]], axis=1)
        way = pose[:2] + arm - anchors
        length = np.linalg.norm(way, axis=1, keepdims=True)
        pull = k[:, None] * (length - free[:, None]) * way / length
        turning = np.sum(pull[:, 0] * arm[:, 1] - pull[:, 1] * arm[:, 0])
        return np.array([*pull.sum(axis=0), turning])

    content = {
        "format": 1, "kind": "bodies", "name": "cables", "title": "a platform on cables", "source": "made up",
        "units": {"length": "mm", "force": "N", "angle": "rad"},
        "end": {"body": "plate", "at_mm": [0.0, 0.0, 0.0]},
        "bodies": [{"name": "cx"}, {"name": "cz"}, {"name": "plate"}],
        "joints": [
            {"name": "x", "between": ["ground", "cx"], "at_mm": [0.0, 0.0, 0.0], "axis": "x", "motion": "slides"},
            {"name": "z", "between": ["cx", "cz"], "at_mm": [0.0, 0.0, 0.0], "axis": "z", "motion": "slides"},
            {"name": "ry", "between": ["cz", "plate"], "at_mm": [0.0, 0.0, 0.0], "axis": "y"},
        ],
        "point_springs": [
            {"name": f"cable{i}", "between": ["ground", "plate"], "stiffness_N_per_mm": float(k[i]),
             "points_mm": [[float(a[0]), 0.0, float(a[1])], [float(p[0]), 0.0, float(p[1])]],
             "free_length_mm": float(free[i]), "cable": cable}
            for i, (a, p) in enumerate(zip(anchors, POINTS, strict=True))
        ],
    }  # fmt: skip
    file.write_text(toml_text(content), encoding="utf-8")
    return slope


@pytest.mark.parametrize("seed", range(3))
def test_it_stands_where_its_energy_has_no_slope(seed, tmp_path):
    slope = cable_robot(seed, tmp_path / "cables.toml")
    force = np.random.default_rng(100 + seed).uniform(-40.0, 40.0, 2)
    found = vjm.stiffness(vjm.load(tmp_path / "cables.toml"), wrench=(force[0], 0.0, force[1], 0.0, 0.0, 0.0))
    there = root(lambda y: slope(y) - [*force, 0.0], np.zeros(3), tol=1e-13).x
    # both solve to rounding of forces of some 100 N, over stiffnesses of some 10 N/mm
    np.testing.assert_allclose(found.displacement[[0, 2, 4]], there, atol=1e-9)
    h = np.diag([1e-4, 1e-4, 1e-7])
    H = np.array([(slope(there + a) - slope(there - a)) / (2.0 * a.sum()) for a in h])
    C = found.loaded_compliance[np.ix_([0, 2, 4], [0, 2, 4])]
    scale = np.sqrt(np.diag(np.linalg.inv(H)))
    # differences: rounding of 100 N over 1e-4 mm, and of 1e-7 rad
    np.testing.assert_allclose(C / scale / scale[:, None], np.linalg.inv(H) / scale / scale[:, None], atol=1e-6)
    # cables of unequal pull move it without a load
    assert np.abs(root(slope, np.zeros(3), tol=1e-13).x).max() > 1e-3


def test_a_slack_cable_is_named(tmp_path):
    file = tmp_path / "cables.toml"
    cable_robot(1, file)
    held = validate("stiffness", str(file), "--wrench", "0,0,-10,0,0,0")
    assert "springs between points pull with, N: cable0 " in held.out
    assert "slack" not in held.out
    assert "spring 'cable2' is taut" in held.out
    loaded = validate("stiffness", str(file), "--wrench", "0,0,-9000,0,0,0")
    assert "spring 'cable2' is slack: 0 N" in loaded.out
    path = validate(
        "curve", str(file), "--axis", "load", "--load", "0,0,-1", "--to", "9000", "--free", "x,y,z,rx,ry,rz"
    )  # fmt: skip
    assert "spring 'cable2' is slack" in path.out
    cable_robot(1, file, cable=False)
    assert "slack" not in validate("stiffness", str(file), "--wrench", "0,0,-9000,0,0,0").out


def test_an_engine_that_does_not_examine_stability_says_so():
    done = validate("stiffness", "planar-2r", "--engine", "vjm-linear", "--wrench", "0,0,-1,0,0,0")
    assert "its stability is not examined by this engine" in done.out
