"""The two finite element engines, for tests that hold for either; OpenSees is an optional extra."""

import pytest

from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.opensees import OpenSeesEngine, available

needs_opensees = pytest.mark.skipif(not available(), reason="OpenSeesPy, an optional extra, is not installed")
either = pytest.mark.parametrize(
    "engine",
    [
        pytest.param(lambda n: ExudynEngine(elements=n), id="exudyn"),
        pytest.param(lambda n: OpenSeesEngine(n), id="opensees", marks=needs_opensees),
    ],
)
"""By a function of the number of elements of a beam."""
