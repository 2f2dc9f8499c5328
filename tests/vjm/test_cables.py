"""A platform that springs between points hold alone, such as cables: against its energy."""

import numpy as np
import pytest
from helpers.command import validate
from helpers.laws import begun
from helpers.virtual_work import turned
from scipy.optimize import root

import vjm
from vjm.analysis import force_closed
from vjm.io.files import toml_text

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
    assert "cable 'cable2' is taut" in held.out
    assert "cable 'cable2' is slack: 0 N" in validate("stiffness", str(file), "--wrench", "0,0,-9000,0,0,0").out
    path = validate(
        "curve", str(file), "--axis", "load", "--load", "0,0,-1", "--to", "9000", "--free", "x,y,z,rx,ry,rz"
    )  # fmt: skip
    assert "cable 'cable2' is slack" in path.out
    cable_robot(1, file, cable=False)
    assert "slack" not in validate("stiffness", str(file), "--wrench", "0,0,-9000,0,0,0").out


CUBE = np.array([[a, b, c] for a in (-1.0, 1.0) for b in (-1.0, 1.0) for c in (-1.0, 1.0)])


def spatial_robot(seed, stretched):
    """A platform of 8 kg on eight cables that cross, and its energy by ``(x, y, z, rx, ry, rz)``."""
    rng = np.random.default_rng(seed)
    anchors = CUBE * [1000.0, 800.0, 600.0] + rng.uniform(-80.0, 80.0, (8, 3))
    # of each cable the other side, so that they hold turns, too
    points = CUBE * [-90.0, 120.0, 70.0] + rng.uniform(-10.0, 10.0, (8, 3))
    k, free = rng.uniform(10.0, 40.0, 8), np.linalg.norm(anchors - points, axis=1) - stretched
    law = [vjm.OneSided(stiffness, 1e-3) for stiffness in k.tolist()]
    parts = [
        *(vjm.Joint(axis, vjm.axis(axis), slides=True, passive=True) for axis in "xyz"),
        *(vjm.Joint(f"r{axis}", vjm.axis(axis), passive=True) for axis in "xyz"),
        vjm.RigidOffset("plate", np.eye(4), 8.0, np.zeros(3)),
    ]
    springs = [
        vjm.PointSpring(f"c{i}", ("", "plate"), np.array([a, p]), free_length=length, law=own)
        for i, (a, p, length, own) in enumerate(zip(anchors, points, free.tolist(), law, strict=True))
    ]

    def energy(y):
        (a, b, c), shift = y[3:], y[:3]
        turn = turned([1, 0, 0], a) @ turned([0, 1, 0], b) @ turned([0, 0, 1], c)
        way = shift + points @ turn.T - anchors
        over = np.sqrt(np.sum(way * way, axis=1)) - free
        return np.sum(k * begun(over, 1e-3)) + 8.0 * 9.81 * shift[2]

    return vjm.build("spatial", parts, point_springs=springs), energy


@pytest.mark.parametrize(("seed", "stretched", "loose"), [(0, 3.0, 0), (1, 0.3, 2), (2, 0.1, 2)])
def test_eight_cables_in_space_stand_where_their_energy_is_least(seed, stretched, loose):
    machine, energy = spatial_robot(seed, stretched)
    force = np.array([30.0, -20.0, -60.0])
    found = vjm.stiffness(machine, wrench=(*force, 0.0, 0.0, 0.0), gravity=(0.0, 0.0, -9.81))

    def slope(y):
        steps = y + 1e-30j * np.eye(6)
        return np.array([energy(row).imag for row in steps]) / 1e-30 - [*force, 0.0, 0.0, 0.0]

    # from the same state, as a platform may hang in several; angles are its rotation vector but for their squares
    there = root(slope, found.displacement, tol=1e-13).x
    assert np.abs(slope(there)).max() < 1e-6
    # both solve to rounding of forces of some 100 N over stiffnesses of some 10 N/mm
    np.testing.assert_allclose(found.displacement[:3], there[:3], atol=1e-8)
    slack = [line for line in found.laws if " is slack: 0 N" in line]
    assert len(slack) >= loose
    assert f"{8 - len(slack)} of 8 cables are taut" in found.laws[-1]
    h = 1e-6 * np.array([1.0, 1.0, 1.0, 1e-2, 1e-2, 1e-2])
    H = np.array([(slope(there + a) - slope(there - a)) / (2.0 * a.sum()) for a in np.diag(h)])
    C = np.linalg.inv(H)[:3, :3]
    # differences over 1e-6 mm: rounding of 100 N
    np.testing.assert_allclose(found.loaded_compliance[:3, :3], C, atol=1e-5 * np.abs(C).max())


def test_stiffness_is_that_of_the_lines_and_their_pulls():
    """``K = Σ k u uᵀ + t/l (1 − u uᵀ)`` of point-like ends (Behzadipour and Khajepour 2006)."""
    anchors, k, stretched = np.array([[-900.0, 0.0], [700.0, 500.0], [600.0, -700.0]]), 20.0, 4.0
    parts = [vjm.Joint(axis, vjm.axis(axis), slides=True, passive=True) for axis in "xy"]
    parts.append(vjm.RigidOffset("point", np.eye(4)))
    lengths = np.linalg.norm(anchors, axis=1)
    springs = [
        vjm.PointSpring(f"c{i}", ("", "point"), np.array([[*a, 0.0], [0.0, 0.0, 0.0]]),
                        free_length=length - stretched, law=vjm.OneSided(k, 1e-3))
        for i, (a, length) in enumerate(zip(anchors, lengths.tolist(), strict=True))
    ]  # fmt: skip
    star = vjm.build("star", parts, point_springs=springs)
    found = vjm.stiffness(star, wrench=(5.0, 3.0, 0.0, 0.0, 0.0, 0.0))
    way = anchors - found.displacement[:2]
    length = np.linalg.norm(way, axis=1)
    K = np.zeros((2, 2))
    for u, now, first in zip(way / length[:, None], length, lengths, strict=True):
        along = np.outer(u, u)
        K += k * along + k * (now - first + stretched) / now * (np.eye(2) - along)
    np.testing.assert_allclose(np.linalg.inv(found.loaded_compliance[:2, :2]), K, rtol=1e-9, atol=1e-9)
    assert "3 of 3 cables are taut, and force-closed" in found.laws[-1]


@pytest.mark.parametrize(
    ("directions", "closed"),
    [
        ([0.0, 120.0, 240.0], True),
        ([0.0, 90.0, 180.0], False),
        ([0.0, 90.0], False),
        ([10.0, 100.0, 200.0, 260.0], True),
    ],
)
def test_wrench_closure(directions, closed):
    angles = np.deg2rad(directions)
    assert force_closed(np.array([np.cos(angles), np.sin(angles)])) is closed


def test_an_engine_that_does_not_examine_stability_says_so():
    done = validate("stiffness", "planar-2r", "--engine", "vjm-linear", "--wrench", "0,0,-1,0,0,0")
    assert "its stability is not examined by this engine" in done.out
