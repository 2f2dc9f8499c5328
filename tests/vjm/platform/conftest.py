"""The library's manipulators, loaded once."""

from collections.abc import Callable
from functools import cache

import pytest

from vjm.io.manipulator_file import load_manipulator
from vjm.platform.manipulator import Manipulator


@pytest.fixture(scope="session")
def robot() -> Callable[[str], Manipulator]:
    return cache(load_manipulator)
