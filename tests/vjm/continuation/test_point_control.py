"""Paths that the displacement of a point controls: where they go on, and why they end where they do."""

import warnings

import numpy as np
import pytest

from vjm.continuation.path import EventKind
from vjm.engines import engine_by_name
from vjm.model.load_case import Load, LoadCase, PointControl
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import AXES, frame, turn

DOWN = (0.0, -1.0, 0.0, 0.0, 0.0, 0.0)


def lee():
    """Lee's frame in centimetres and newtons."""
    section = Section(EA=4.32e7, GJ=1.44e10, EIy=1.44e10, EIz=1.44e7)
    quarter = turn(AXES["z"], 0.5 * np.pi)
    parts = (
        Joint("base", AXES["z"], passive=True), Beam("column", 120.0, section=section),
        RigidOffset("corner", np.linalg.inv(quarter)), Beam("near", 24.0, section=section),
        Beam("far", 96.0, section=section), Joint("end", AXES["z"], passive=True),
    )  # fmt: skip
    return Machine("lee", parts, base=quarter, postures={"drawn": np.zeros(2)})


def toggle():
    """Half of a truss of 20 over 100 mm, its apex free to sink."""
    rise = turn(AXES["z"], float(np.arctan(0.2)))
    section = Section(EA=1e5, GJ=1e8, EIy=1e8, EIz=1e8)
    parts = (Joint("base", AXES["z"], passive=True), Beam("bar", float(np.hypot(100.0, 20.0)), section=section),
             Joint("apex", AXES["z"], passive=True))  # fmt: skip
    return Machine("toggle", parts, base=rise, postures={"drawn": np.zeros(2)})


def column():
    section = Section(EA=2e7, GJ=1e6, EIy=2e7, EIz=1e6)
    return Machine("column", (Beam("bar", 100.0, section=section),), base=frame(np.eye(3)),
                 postures={"drawn": np.zeros(0)})  # fmt: skip


def test_a_gauge_that_begins_with_the_load_squared_is_followed_to_the_limit():
    load = Load(DOWN, part="near", at=1.0)
    case = LoadCase("drawn", 90.0, axis="load", loads=(load,), control=PointControl("near", 1.0, (1.0, 0.0, 0.0)))
    path = engine_by_name("vjm-16").trace(lee(), case)
    limit = path.events[-1]
    assert limit.kind is EventKind.LIMIT
    # by shooting, see the verification case lee-frame; sixteen springs err by 3.7e-6
    assert limit.force == pytest.approx(18556.7275, rel=1e-5)
    assert "the controlled displacement is not held" in path.stopped


@pytest.mark.parametrize("steps", [None, 20])
def test_a_toggle_controlled_by_its_drop_goes_through_to_its_mirror_image(steps):
    case = LoadCase(
        "drawn", 40.0, axis="load", steps=steps, free=("y",), loads=(Load(DOWN, part="bar"),),
        control=PointControl("bar", 1.0, (0.0, -1.0, 0.0)),
    )  # fmt: skip
    path = engine_by_name("vjm-1").trace(toggle(), case)
    assert path.complete, path.stopped
    # of 148 N what rounding leaves, 3e-12
    assert path.points[-1].ramp == pytest.approx(0.0, abs=1e-8)
    limit = next(event for event in path.events if event.kind is EventKind.LIMIT)
    # the largest EA (1/l - 1/L) h over the apex' height h; fixed steps find its place to 4e-10
    assert limit.force == pytest.approx(148.02588, rel=1e-6)


def test_a_gauge_across_a_perfect_column_is_told_to_be_still():
    case = LoadCase(
        "drawn", -5.0, axis="load", free=("x", "y", "rz"), loads=(Load((1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),),
        control=PointControl("bar", 1.0, (0.0, 1.0, 0.0)),
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        path = engine_by_name("vjm-4").trace(column(), case)
    assert "the controlled displacement does not change along the path" in path.stopped
