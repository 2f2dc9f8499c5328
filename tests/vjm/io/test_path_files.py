"""Load paths as files: nothing is lost on the way, and a damaged file is refused by name."""

import re
from dataclasses import replace

import numpy as np
import pytest

from vjm.baselines import LinearEngine
from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.io.path_files import COLUMNS, curve_csv, load_path, read_curve, save_path, write_curve
from vjm.model.load_case import LoadCase

OBLIQUE = (0.6, 0.0, 0.8, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("posture", "to", "segments", "ramp"), [
    ("A", 2.0, None, {}), ("B", -4.0, 4, {"steps": 20}), ("D", 0.01, None, {"axis": "rz", "branch": -1}),
])  # fmt: skip
def test_curve_file_gives_back_what_it_shows(trace, tmp_path, posture, to, segments, ramp):
    path = trace(posture, to, segments, **ramp)
    file = tmp_path / "deep" / "curve.csv"
    write_curve(replace(path, model_sha256="a1b2"), file)
    back = read_curve(file)
    assert (back.engine, back.model, back.model_sha256) == (path.engine, path.model, "a1b2")
    assert back.load_case == path.load_case
    # twelve digits of every number, nine of the eigenvalue
    assert back.s == pytest.approx(path.s, rel=1e-11)
    assert back.displacement == pytest.approx(path.displacement, rel=1e-11)
    assert back.wrench == pytest.approx(path.wrench, rel=1e-11)
    assert back.tangent == pytest.approx(path.tangent, rel=1e-11)
    assert back.eigenvalue_relative == pytest.approx(path.eigenvalue_relative, rel=1e-8)
    assert np.array_equal(back.unstable, path.unstable)


def test_curve_file_has_its_head_and_columns(trace):
    lines = curve_csv(trace("A", 2.0)).splitlines()
    assert lines[0].startswith("# model=orthoglide-chain engine=vjm-paper version=")
    assert lines[1] == ",".join(COLUMNS)
    assert len(lines) == 2 + len(trace("A", 2.0).points)
    assert lines[2].split(",")[0] == "0"


def test_curve_of_a_model_without_stability_leaves_it_blank(chain, tmp_path):
    path = LinearEngine().trace(chain, LoadCase("A", 1.0))
    assert [row.split(",")[-3:] for row in curve_csv(path).splitlines()[2:]] == [["", "", "0"]] * 2
    write_curve(path, tmp_path / "c.csv")
    back = read_curve(tmp_path / "c.csv")
    assert np.all(back.unstable == -1)
    assert np.all(np.isnan(back.eigenvalue_relative))


def test_curve_of_an_oblique_ramp_can_be_read_back(chain, tmp_path):
    path = VjmEngine().trace(chain, LoadCase("A", 1.0, OBLIQUE, steps=4))
    write_curve(path, tmp_path / "c.csv")
    back = read_curve(tmp_path / "c.csv")
    assert back.load_case.direction == pytest.approx(path.load_case.direction, rel=1e-15)
    assert back.s == pytest.approx(path.s, rel=1e-11)
    assert back.force == pytest.approx(path.force, rel=1e-11)


@pytest.mark.parametrize(("posture", "to", "segments"), [("A", 2.0, None), ("D", -14.0, 4), ("C", -4.0, None)])
def test_record_gives_back_every_number(trace, tmp_path, posture, to, segments):
    path = trace(posture, to, segments)
    save_path(path, tmp_path / "path.npz")
    back = load_path(tmp_path / "path.npz")
    assert replace(back, points=(), events=()) == replace(path, points=(), events=())
    assert len(back.points) == len(path.points)
    pairs = list(zip(path.points, back.points, strict=True))
    for mine, theirs in zip(path.events, back.events, strict=True):
        assert replace(mine, point=None) == replace(theirs, point=None)
        assert isinstance(theirs.kind, EventKind)
        pairs.append((mine.point, theirs.point))
    for mine, theirs in pairs:
        for name in ("displacement", "wrench", "shape", "state", "stiffness"):
            assert np.array_equal(getattr(mine, name), getattr(theirs, name)), name
        for name in ("s", "tangent", "eigenvalue", "unstable", "iterations", "residual"):
            assert getattr(mine, name) == getattr(theirs, name), name
            assert isinstance(getattr(theirs, name), int | float), name


def test_record_of_a_model_without_shapes_and_states(chain, tmp_path):
    path = LinearEngine().trace(chain, LoadCase("A", 1.0, steps=3))
    save_path(path, tmp_path / "p.npz")
    back = load_path(tmp_path / "p.npz")
    assert np.array_equal(back.force, path.force)
    assert back.points[1].shape.shape == (0, 3)
    assert back.points[1].state.shape == (0,)


def test_record_of_an_oblique_ramp_gives_back_the_same_load_case(chain, tmp_path):
    path = VjmEngine().trace(chain, LoadCase("A", 1.0, OBLIQUE, steps=4))
    save_path(path, tmp_path / "p.npz")
    assert load_path(tmp_path / "p.npz").load_case == path.load_case


def truncated(data):
    return data[: len(data) // 2]


def flipped(data):
    return data[:300] + bytes([data[300] ^ 0xFF]) + data[301:]


@pytest.mark.parametrize("damage", [
    truncated, flipped, lambda data: b"", lambda data: b"no archive at all",
], ids=["truncated", "a byte changed", "empty", "text"])  # fmt: skip
def test_damaged_record_is_refused_by_name(trace, tmp_path, damage):
    file = tmp_path / "path.npz"
    save_path(trace("A", 2.0), file)
    file.write_bytes(damage(file.read_bytes()))
    with pytest.raises(ValueError) as refusal:
        load_path(file)
    assert str(file) in str(refusal.value)


def test_missing_record_and_foreign_archive_are_refused_by_name(tmp_path):
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    for name in ("absent.npz", "other.npz"):
        with pytest.raises(ValueError) as refusal:
            load_path(tmp_path / name)
        assert name in str(refusal.value)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (
            lambda lines: [*lines[:6], re.sub(",[^,]+", ",", lines[6], count=1), ""],
            "line 7: column ux_mm: has no value",
        ),
        (lambda lines: [*lines[:6], lines[6] + ",1", ""], "line 7: has more cells than columns"),
        (lambda lines: [*lines[:6], lines[6][:30], ""], "line 7: column"),
        (lambda lines: [*lines[:6], "5,oops" + lines[6][lines[6].index(",", 2) :], ""], "'oops' is no number"),
        (lambda lines: [*lines[:6], lines[6][:-1]], "line 7: has no end"),
    ],
)
def test_a_damaged_row_of_a_curve_file_is_named_by_its_line(trace, tmp_path, damage, said):
    file = tmp_path / "curve.csv"
    file.write_text("\n".join(damage(curve_csv(trace("A", 2.0)).splitlines())), encoding="utf-8")
    with pytest.raises(ValueError) as refusal:
        read_curve(file)
    assert str(refusal.value).startswith(f"{file}, line 7: ")
    assert said in str(refusal.value)


@pytest.mark.parametrize("damage", [
    lambda lines: lines[1:],
    lambda lines: ["# model=x", *lines[1:]],
    lambda lines: [line.replace("fx_N", "gx_N") for line in lines],
    lambda lines: [*lines[:6], lines[6][:30]],
    lambda lines: [*lines[:6], "5,oops" + lines[6][lines[6].index(",", 2):]],
    lambda lines: lines[:1],
    lambda lines: [],
], ids=["no head", "half a head", "missing column", "cut row", "letters", "head only", "empty"])  # fmt: skip
def test_damaged_curve_file_is_refused_by_name(trace, tmp_path, damage):
    file = tmp_path / "curve.csv"
    file.write_text("\n".join(damage(curve_csv(trace("A", 2.0)).splitlines())), encoding="utf-8")
    with pytest.raises(ValueError) as refusal:
        read_curve(file)
    assert str(file) in str(refusal.value)
