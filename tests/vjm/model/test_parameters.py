"""Parameters of chains: their present values, other ones one after another, and what is refused."""

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.model.machine import Machine
from vjm.model.parameters import (
    Parameter,
    beam_length,
    compliance_entry,
    compliance_factor,
    section_value,
)


@pytest.fixture(scope="module")
def soft(chain) -> Machine:
    """The paper's chain with the actuator compliance that a fit to Table II gives."""
    return chain.with_actuator_compliance(2e-6)


def one_of_each(chain: Machine, segments: int | None) -> list[Parameter]:
    """Every kind of parameter that this engine sees."""
    parameters = [
        compliance_entry(chain, "foot", 1, 1),
        compliance_entry(chain, "foot", 3, 5),
        compliance_factor(chain, "foot"),
        compliance_factor(chain, "link"),
        beam_length(chain, "link"),
    ]
    if segments is None:
        # (1,2) is zero as printed: a coupling of the pull with the soft bending
        return [*parameters, *(compliance_entry(chain, "link", *ij) for ij in ((2, 2), (2, 6), (1, 2)))]
    return [*parameters, *(section_value(chain, "link", name) for name in ("EA", "GJ", "EIy", "EIz"))]


def test_parameters_know_their_present_value(soft):
    for parameter in one_of_each(soft, None) + one_of_each(soft, 4):
        same = parameter.apply(soft, parameter.value)
        at = VjmEngine(4).model(same).kinematics(np.zeros(VjmEngine(4).model(same).size))
        before = VjmEngine(4).model(soft).kinematics(np.zeros(VjmEngine(4).model(soft).size))
        assert np.array_equal(at.end, before.end), parameter.name
        assert np.array_equal(VjmEngine().model(same).stiffness, VjmEngine().model(soft).stiffness), parameter.name
        assert np.array_equal(same.posture("B"), soft.posture("B")), parameter.name


def test_parameters_are_set_one_after_the_other(soft):
    first, second = beam_length(soft, "link"), section_value(soft, "link", "EA")
    third = compliance_entry(soft, "link", 1, 1)
    link = third.apply(second.apply(first.apply(soft, 300.0), 1e6), 1e-5).beams[1]
    assert (link.length, link.section.EA, link.compliance[0, 0]) == (300.0, 1e6, 1e-5)


@pytest.mark.parametrize(("make", "said"), [
    (lambda c: beam_length(c, "q1"), "no beam"),
    (lambda c: beam_length(c, "arm"), "no part 'arm'"),
    (lambda c: compliance_entry(c, "foot", 0, 7), "(1,1) to (6,6)"),
    (lambda c: section_value(c, "foot", "GAy"), "infinite"),
    (lambda c: section_value(c, "foot", "E"), "not E"),
    (lambda c: Parameter("p", "1", 0.0, 0.0, lambda c, v: c), "scale positive"),
])  # fmt: skip
def test_what_is_no_parameter_is_refused(chain, make, said):
    with pytest.raises(ValueError) as refusal:
        make(chain)
    assert said in str(refusal.value)
