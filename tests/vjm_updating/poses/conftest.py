"""What several files of tests share."""

import pytest
from helpers.from_files import prepared
from helpers.weighed_arm import compliant, drawn, files, measured

from vjm_updating.poses.state import Hypothesis


@pytest.fixture(scope="module")
def springs(tmp_path_factory):
    q = drawn(8)
    where = files(tmp_path_factory.mktemp("springs"), q, measured(compliant(), q))
    measurement, study = prepared(*where)
    return where, measurement, study, study.gauss_newton(Hypothesis(("actuator_compliance",)))
