"""Measured sets that are not redistributed: in ``../shared/measured`` of the checkout, or the test is skipped."""

from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[3] / "shared/measured"


def needed(name: str) -> Path:
    """A measured file; skips the test where it is not."""
    if not (FOLDER / name).exists():
        pytest.skip(f"{name} is not redistributed: put it into ../shared/measured beside the checkout")
    return FOLDER / name
