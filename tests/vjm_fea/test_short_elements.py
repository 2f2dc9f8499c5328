"""Sway columns whose end springs are very short beams: rounding of positions beside their stiffness."""

import numpy as np
import pytest
from scipy.optimize import brentq

from vjm.continuation.path import EventKind
from vjm.model.load_case import COMPONENTS, Load, LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Section
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_validation.exact.columns import Column, transfer

EI, EA, LENGTH, SPRING = 1e9, 2e8, 1000.0, 5e6


def column(short):
    """Base and end turn against springs of 5 EI/L; the end may sway."""

    def beam(name, length, bending):
        return Beam(name, length, section=Section(EA=EA, GJ=bending, EIy=20.0 * bending, EIz=bending))

    parts = (beam("base", short, SPRING * short), beam("bar", LENGTH, EI), beam("end", short, SPRING * short))
    return Machine("sway", parts, postures={"drawn": np.zeros(0)})


def exact(short):
    """Critical load by transfer matrices: no shear force anywhere, and no turn at the far end."""
    spring = Column(length=short, EI=SPRING * short, EA=EA)
    pieces = (spring, Column(length=LENGTH, EI=EI, EA=EA), spring)

    def turn(load):
        T = np.eye(4)
        for piece in pieces:
            T = transfer(piece, load, piece.length) @ T
        return T[1, 3]

    return brentq(turn, 4000.0, 6000.0, xtol=1e-9)


def path(short, elements, to=6000.0):
    case = LoadCase("drawn", to, axis="load", free=("x", "y"), loads=(Load((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)),))
    return ExudynEngine(elements=elements).trace(column(short), case)


@pytest.mark.slow
# of fourth order: 9.3e-4 with four elements, a sixteenth of it with eight
@pytest.mark.parametrize(("short", "elements", "error"), [(0.1, 4, 2e-3), (1.0, 8, 1e-4)])
def test_a_column_goes_through_its_critical_load_on_very_short_springs(short, elements, error):
    found = path(short, elements)
    assert not found.stopped
    event = found.events[0]
    assert event.kind is EventKind.BIFURCATION
    assert event.switched
    assert event.force == pytest.approx(exact(short), rel=error)


def test_what_rounding_hides_is_undecided_and_no_event():
    found = path(0.01, 4)
    assert not found.events
    assert "undecided: rounding leaves the critical value uncertain" in found.stopped
    assert "Take fewer elements" in found.stopped


def test_a_column_that_is_soft_in_shear_is_followed_where_rounding_is_large():
    # curved, a shift across it meets the axial stiffness, 6e5 times that in shear: rounding of positions with it
    section = Section(EA=1e9, GJ=1e8, EIy=1e8, EIz=4e6, GAy=1600.0, GAz=1600.0)
    chain = Machine("soft", (Beam("bar", 100.0, section=section),), postures={"drawn": np.zeros(0)})
    load = Load((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    case = LoadCase("drawn", 1000.0, axis="load", free=COMPONENTS, loads=(load,), control="limit")
    found = ExudynEngine(elements=8).trace(chain, case)
    assert not found.stopped
    # P (1 + P/GA - P/EA) = π² EI / 4 L²; of second order where shear counts: 2.0e-3 with eight elements
    euler = np.pi**2 * 4e6 / (4.0 * 100.0**2)
    flexible = 1.0 / 1600.0 - 1e-9
    exact = (np.sqrt(1.0 + 4.0 * euler * flexible) - 1.0) / (2.0 * flexible)
    assert found.events[0].force == pytest.approx(exact, rel=1e-2)
