"""The kinds of test that a diagnosis knows."""

from __future__ import annotations

from vjm_updating.diagnosis.column_kind import ColumnTest
from vjm_updating.diagnosis.joint_kind import JointTest
from vjm_updating.diagnosis.load_kind import LoadTest
from vjm_updating.diagnosis.ramp_kind import RampTest
from vjm_updating.experiment import Measurement

KINDS: tuple[RampTest, ...] = (JointTest(), ColumnTest(), LoadTest(), RampTest())
"""Each is asked in turn whether a test is of its kind; the last one takes every test."""


def kind_of(measurement: Measurement) -> RampTest:
    """The kind of a test."""
    return next(kind for kind in KINDS if kind.applies(measurement))
