"""The root finder against closed forms and against SciPy's, step by step."""

import math

import pytest
from scipy.optimize import brentq

from vjm.continuation.events import root_between

CASES = {
    "square root": (lambda x: x * x - 2.0, 0.0, 2.0, math.sqrt(2.0)),
    "cosine": (lambda x: math.cos(x) - x, 0.0, 1.0, 0.7390851332151607),
    # flat on one side, where interpolation alone creeps
    "steep exponential": (lambda x: math.expm1(40.0 * (x - 0.3)), 0.0, 1.0, 0.3),
    # a triple root, at which derivatives vanish
    "cube": (lambda x: (x - 0.7) ** 3, 0.0, 1.0, 0.7),
    "a jump": (lambda x: 1.0 if x > 0.25 else -1.0, 0.0, 1.0, 0.25),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("backwards", [False, True])
def test_the_root_lies_within_the_tolerance(name, backwards):
    function, a, b, root = CASES[name]
    asked = []

    def counted(x):
        asked.append(x)
        return function(x)

    ends = (b, a) if backwards else (a, b)
    found = root_between(counted, *ends, 1e-9)
    assert abs(found - root) <= 1e-9
    known = []
    brentq(lambda x: known.append(x) or function(x), *ends, xtol=1e-9, rtol=1e-12)
    assert asked == known


def test_a_root_at_an_end_is_taken_and_equal_signs_are_refused():
    assert root_between(lambda x: x - 1.0, 1.0, 2.0, 1e-9) == 1.0
    assert root_between(lambda x: x - 2.0, 1.0, 2.0, 1e-9) == 2.0
    with pytest.raises(ValueError) as refusal:
        root_between(lambda x: x * x + 1.0, -1.0, 1.0, 1e-9)
    assert "no change of sign between -1 and 1" in str(refusal.value)
