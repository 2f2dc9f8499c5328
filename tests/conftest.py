"""Settings that must be in place before numpy and matplotlib are imported, and the paper's chain."""

import os

import pytest

# One BLAS thread, for the reason given in the Makefile, and figures without a display.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
os.environ.setdefault("MPLBACKEND", "Agg")


@pytest.fixture(scope="session")
def chain():
    # imported late: the settings above come first
    from vjm.io.model_file import load_chain

    return load_chain("orthoglide-chain")
