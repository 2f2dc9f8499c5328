"""The solver that takes over where PARDISO's wheel is not there."""

import sys

import numpy as np
import pytest
import scipy.sparse
from helpers.solids import drawn, gmsh_or_skip, prism

from vjm_fea.solid.compliance import PartEnds, TipLoad, answer, factorized, solver_name
from vjm_fea.solid.drawing import drawing
from vjm_fea.solid.elasticity import ElasticSolid, IsotropicMaterial


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
