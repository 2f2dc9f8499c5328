"""The library's manipulators, loaded once."""

from collections.abc import Callable
from functools import cache

import pytest

from vjm.io.machine_file import load_model
from vjm.model.chain import Chain


@pytest.fixture(scope="session")
def robot() -> Callable[[str], Chain]:
    return cache(load_model)
