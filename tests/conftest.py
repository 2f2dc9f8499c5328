"""Settings that must be in place before numpy and matplotlib are imported."""

import os

import pytest

# One BLAS thread, for the reason given in the Makefile, and figures without a display.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
os.environ.setdefault("MPLBACKEND", "Agg")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep together, where processes share the tests, what shares a run of `validate all`, or else a file."""
    for item in items:
        shared = "whole_run" in getattr(item, "fixturenames", ())
        item.add_marker(pytest.mark.xdist_group("whole run" if shared else str(item.path)))
