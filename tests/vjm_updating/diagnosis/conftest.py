"""The maker of made-up tests, which stands beside and is no package."""

import importlib.util
import sys
from pathlib import Path

import pytest

_spec = importlib.util.spec_from_file_location("diagnosis_made_up", Path(__file__).with_name("made_up.py"))
_module = importlib.util.module_from_spec(_spec)
sys.modules[_spec.name] = _module
_spec.loader.exec_module(_module)


@pytest.fixture(scope="session")
def make():
    return _module
