"""Settings that must be in place before numpy and matplotlib are imported, and the paper's chain."""

import os

import pytest

# One BLAS thread, for the reason given in the Makefile, and figures without a display.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
os.environ.setdefault("MPLBACKEND", "Agg")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark as slow what ``quick_cases`` does not keep: of a test's cases as many, evenly spread over their list."""
    cases = {}
    for item in items:
        if item.get_closest_marker("quick_cases"):
            cases.setdefault((item.path, item.cls, item.originalname), []).append(item)
    for group in cases.values():
        (number,) = group[0].get_closest_marker("quick_cases").args
        kept = {round(k * (len(group) - 1) / max(number - 1, 1)) for k in range(number)}
        for index, item in enumerate(group):
            if index not in kept:
                item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def chain():
    # imported late: the settings above come first
    from vjm.io.model_file import load_chain

    return load_chain("orthoglide-chain")


@pytest.fixture(scope="session")
def rendering():
    """A machine that renders off the screen; what needs one is skipped elsewhere."""
    from vjm_output.optional_drawing import why_not_rendered

    if reason := why_not_rendered():
        pytest.skip(f"this machine cannot render: {reason}")
