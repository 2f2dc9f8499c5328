"""Derivatives by numbers of the file against differences of equilibria that are solved anew, and closed forms."""

from __future__ import annotations

import pytest

import vjm
from vjm.design.linear_state import question, state_of
from vjm.design.masses import total_mass
from vjm.design.modes import modes
from vjm.design.sensitivity import Quantity, sensitivity
from vjm.io.errors import ModelFileError
from vjm.io.file_parameters import file_parameter, parameter_keys
from vjm.io.model_file import build_chain, read_document
from vjm.machine.legs import machine_of
from vjm.model.parameters import beam_length, compliance_factor
from vjm.vjm_engine import VjmEngine

LOADS = {"wrench": (20.0, -50.0, 10.0, 300.0, 0.0, 0.0), "gravity": (0.0, -9.81, 0.0)}
KEYS = (
    "shoulder.compliance_rad_per_Nmm", "elbow.compliance_rad_per_Nmm", "upper.length_mm",
    "upper.section.width_mm", "fore.section.wall_mm", "fore.section.density_kg_per_m3", "tool.mass_kg",
)  # fmt: skip
DIFFERENCES = 1e-6
"""Of the largest relative derivative: of equilibria solved to 1e-11, over a step of 1e-3, and of h⁴."""


def same(chain):
    return chain


def solved(machine, quantity, along, label, loads):
    """The quantity of an equilibrium that is solved for."""
    if quantity is Quantity.FREQUENCY:
        return modes(machine, label, number=1, **loads).frequencies[0]
    state = state_of(question(machine, label, **loads))
    if quantity is Quantity.MASS:
        return total_mass(state)
    k = ["x", "y", "z", "rx", "ry", "rz"].index(along)
    if quantity is Quantity.DEFLECTION:
        return state.moved[k]
    found = vjm.stiffness(machine, label, engine=VjmEngine(16), **loads)
    return 1.0 / found.loaded_compliance[k, k]


def differenced(parameter, machine, *asked, step=1e-3):
    h = step * parameter.scale
    slopes = [
        (
            solved(parameter.apply(machine, parameter.value + s), *asked)
            - solved(parameter.apply(machine, parameter.value - s), *asked)
        )
        / (2.0 * s)
        for s in (h, 0.5 * h)
    ]
    return (4.0 * slopes[1] - slopes[0]) / 3.0


@pytest.mark.parametrize(
    ("quantity", "along"),
    [(Quantity.DEFLECTION, "y"), (Quantity.DEFLECTION, "rz"), (Quantity.STIFFNESS, "y"), (Quantity.FREQUENCY, ""),
     (Quantity.MASS, "")],
)  # fmt: skip
def test_derivatives_of_an_arm_are_its_differences(quantity, along):
    document = read_document("planar-2r")
    machine = build_chain(document.content, document.file)
    parameters = [file_parameter(document, key, same) for key in KEYS]
    found = sensitivity(machine, parameters, quantity, "bent", along=along, **LOADS)
    by_name = {row.parameter: row for row in found.rows}
    largest = max(abs(row.relative) for row in found.rows)
    assert largest > 0.1
    for parameter in parameters:
        slope = differenced(parameter, machine, quantity, along, "bent", LOADS)
        error = (by_name[parameter.name].derivative - slope) * parameter.value / found.value
        assert abs(error) < DIFFERENCES * largest, parameter.name


@pytest.mark.parametrize(
    ("name", "part"), [("orthoglide", "x/link"), ("hexapod", "c/strut"), ("palletiser", "rod")]
)
def test_derivatives_of_closed_loops_are_their_differences(name, part):
    model = vjm.load(name)
    machine = model if not hasattr(model, "legs") else machine_of(model)
    label, loads = next(iter(machine.postures)), {"wrench": (200.0, -100.0, -150.0, 0.0, 500.0, 200.0)}
    parameter = compliance_factor(machine, part)
    found = sensitivity(machine, [parameter], "deflection", label, along="x", **loads)
    # deflections of 0.01 mm are solved to 1e-13 mm: a step of 1e-2 leaves 1e-9 of them, and h⁴
    slope = differenced(parameter, machine, Quantity.DEFLECTION, "x", label, loads, step=1e-2)
    assert found.rows[0].derivative == pytest.approx(slope, rel=DIFFERENCES)


def test_a_cantilever_in_closed_form(cantilever):
    """Stiffness 3EI/L³: by its length −3, by its compliance −1; it is doubled by L/∛2."""
    chain = cantilever()
    parameters = [beam_length(chain, "rod"), compliance_factor(chain, "rod")]
    found = sensitivity(chain, parameters, "stiffness", along="y", factors=2)
    length, compliance = found.rows
    assert length.relative == pytest.approx(-3.0, rel=1e-9)
    assert compliance.relative == pytest.approx(-1.0, rel=1e-9)
    assert length.factor == pytest.approx(2.0 ** (-1.0 / 3.0), rel=1e-6)
    assert compliance.factor == pytest.approx(0.5, rel=1e-6)


def test_a_factor_halves_the_deflection():
    document = read_document("planar-2r")
    machine = build_chain(document.content, document.file)
    parameters = [file_parameter(document, key, same) for key in KEYS[:2]]
    loads = {"wrench": (0.0, -20.0, 0.0, 0.0, 0.0, 0.0)}
    found = sensitivity(machine, parameters, "deflection", "stretched", factors=2, **loads)
    first, second = found.rows
    assert first.parameter == "shoulder.compliance_rad_per_Nmm"
    parameter = next(p for p in parameters if p.name == first.parameter)
    halved = parameter.apply(machine, first.factor * parameter.value)
    moved = state_of(question(halved, "stretched", **loads)).moved
    assert moved[1] == pytest.approx(0.5 * found.value, rel=1e-5)
    # the elbow has 28 % of the deflection: without it 72 % are left
    assert second.parameter == "elbow.compliance_rad_per_Nmm"
    assert second.factor is None


def test_all_numbers_of_a_file_are_its_keys():
    keys = parameter_keys(read_document("planar-2r").content)
    assert set(KEYS) <= set(keys)
    assert not any("limits" in key for key in keys)
    # the centre of mass of the tool is zero
    assert "tool.centre_of_mass_mm.1" not in keys


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("shoulder.compliance", "'shoulder.compliance' is no number of a part"),
        ("nobody.length_mm", "'nobody.length_mm' is no number of a part"),
        ("upper.section.shape", "is no number of a part"),
        ("tool.centre_of_mass_mm.1", "is zero"),
    ],
)
def test_keys_that_are_no_numbers_are_refused(key, said):
    with pytest.raises(ModelFileError, match=said):
        file_parameter(read_document("planar-2r"), key, same)


def test_what_has_no_derivative_is_refused(cantilever):
    chain = cantilever()
    rod = [compliance_factor(chain, "rod")]
    with pytest.raises(ValueError, match="its deflection along z is zero"):
        sensitivity(chain, rod, "deflection", along="z", wrench=(0.0, 1.0, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="a mass has no component"):
        sensitivity(chain, rod, "mass", along="x")
    with pytest.raises(ValueError, match="component 'w' is none of"):
        sensitivity(chain, rod, "stiffness", along="w")
    machine = machine_of(vjm.load("orthoglide"))
    with pytest.raises(ValueError, match="its loops are open"):
        sensitivity(machine, [beam_length(machine, "x/link")], "deflection", wrench=(1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
