"""The library's manipulators, loaded once."""

from collections.abc import Callable
from functools import cache

import pytest

from vjm.io.machine_file import load_model
from vjm.model.machine import Machine


@pytest.fixture(scope="session")
def robot() -> Callable[[str], Machine]:
    return cache(load_model)
