"""Parameters of machines: what is none is refused."""

import pytest

from vjm.model.parameters import Parameter, beam_length, compliance_entry, section_value


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
