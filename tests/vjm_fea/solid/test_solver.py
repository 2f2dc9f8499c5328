"""The solver that takes over where PARDISO's wheel is not there, and calls that can be interrupted."""

import os
import signal
import sys
import threading
import time

import numpy as np
import pytest
import scipy.sparse
from helpers.solids import drawn, gmsh_or_skip, prism

from vjm_fea.solid.compliance import PartEnds, TipLoad, answer
from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import ElasticSolid, IsotropicMaterial
from vjm_fea.solid.libraries import interruptible, left_running
from vjm_fea.solid.solver import factorized, solver_name


def test_superlu_says_what_pardiso_says(tmp_path, monkeypatch):
    gmsh_or_skip()
    pytest.importorskip("pypardiso", reason="there is no other solver to compare with")
    path = drawn(tmp_path / "prism.step", prism)
    with drawing(path) as opened:
        solid = ElasticSolid(opened.mesh(12.0), IsotropicMaterial(70000.0, 0.3))

    def solved():
        return [answer(solid, PartEnds((1,), (2,)), tip).compliance for tip in TipLoad]

    assert solver_name() == "pardiso"
    theirs = solved()
    monkeypatch.setitem(sys.modules, "pypardiso", None)
    assert solver_name() == "superlu"
    for ours, other in zip(solved(), theirs, strict=True):
        scale = np.sqrt(np.outer(np.diag(other), np.diag(other)))
        # both are exact up to rounding, which the matrix's condition of some 1e5 enlarges
        assert np.max(np.abs(ours - other) / scale) < 1e-9


def test_a_floating_part_is_refused_by_superlu(monkeypatch):
    monkeypatch.setitem(sys.modules, "pypardiso", None)
    singular = scipy.sparse.csr_matrix(np.diag([1.0, 0.0, 1.0]))
    with pytest.raises(ValueError, match="the stiffness matrix cannot be factorized"):
        factorized(singular)


def test_what_a_call_raises_is_handed_on():
    with pytest.raises(ZeroDivisionError):
        interruptible(lambda: 1 / 0)
    assert interruptible(lambda: 7) == 7


def test_an_interrupt_is_answered_while_a_library_works():
    """At once, and what still works is known: nobody may free it."""
    release = threading.Event()
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    started = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            interruptible(lambda: release.wait(30.0))
        assert time.monotonic() - started < 15.0
        assert left_running()
    finally:
        release.set()
        signal.signal(signal.SIGINT, before)
    deadline = time.monotonic() + 10.0
    while left_running() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not left_running()
