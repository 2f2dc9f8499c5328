"""Derivatives of natural frequencies: against differences, and in closed form where modes are equal."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vjm.design.changes import posed
from vjm.design.linear_state import question, state_of
from vjm.design.modes import eigenmodes, frequency_rates
from vjm.engines import VjmEngine
from vjm.io.file_parameters import MachineFiles
from vjm.model.parameters import section_value

STEP = 1e-4
"""Of a parameter, for differences of frequencies: their error is its square, 1e-8, and rounding over it."""


@pytest.mark.parametrize(
    ("model", "keys", "gravity"),
    [
        ("ur10", ("elbow.compliance_rad_per_Nmm", "link-2.mass_kg", "link-3.translation_mm.1"), True),
        ("planar-2r", ("upper.section.wall_mm", "tool.mass_kg", "upper.length_mm"), True),
        ("hexapod", ("ups-strut.slide.compliance_mm_per_N", "ups-strut.strut.length_mm"), False),
    ],
)
def test_rates_are_those_of_differences(model, keys, gravity):
    files = MachineFiles.read(model)
    machine = files.machine()
    posture = next(iter(machine.postures))
    asked = question(machine, posture, gravity=(0.0, 0.0, -9.81) if gravity else None, engine=VjmEngine(4))
    state = state_of(asked)
    values, motions = eigenmodes(state, 4)
    parameters = [files.parameter(key, posture) for key in keys]
    rates = frequency_rates(state, parameters, values, motions)
    for parameter, rate in zip(parameters, rates.T, strict=True):
        ends = []
        for sign in (1.0, -1.0):
            there = posed(asked, parameter, parameter.value * (1.0 + sign * STEP))
            ends.append(np.sqrt(eigenmodes(state_of(replace(asked, machine=there)), 4)[0]) / (2.0 * np.pi))
        differences = (ends[0] - ends[1]) / (2.0 * STEP)
        np.testing.assert_allclose(rate * parameter.value, differences, rtol=1e-6, atol=1e-6 * np.sqrt(values[0]))


def test_equal_frequencies_part(cantilever):
    """A round rod that is made stiffer about one axis: of each pair one mode follows √EI, the other one stays."""
    chain = cantilever()
    asked = question(chain, "", engine=VjmEngine(8))
    state = state_of(asked)
    values, motions = eigenmodes(state, 4)
    frequency = np.sqrt(values) / (2.0 * np.pi)
    stiff = section_value(chain, "rod", "EIz")
    rates = frequency_rates(state, [stiff], values, motions)[:, 0] * stiff.value
    # rotary inertia, which follows EI/EA, is made a millionth of a rod's (d/L)²
    np.testing.assert_allclose(rates[[1, 3]], 0.5 * frequency[[1, 3]], rtol=1e-6)
    np.testing.assert_allclose(rates[[0, 2]], 0.0, atol=1e-6 * frequency[0])
