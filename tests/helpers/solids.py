"""Solids for tests: drawings made by gmsh, and displacements; skips where the extra is not installed."""

import numpy as np
import pytest
import scipy.sparse

from vjm_fea.solid.drawing import gmsh_session


def gmsh_or_skip():
    """Skips, and says why, where gmsh does not load."""
    pytest.importorskip("skfem", reason="the extra 'solid' is not installed")
    try:
        import gmsh  # noqa: F401
    except (ImportError, OSError) as error:
        pytest.skip(f"gmsh does not load: {error}")


def drawn(path, draw):
    """Write what `draw(occ)` makes with gmsh's geometry kernel to a file; returns the path."""
    gmsh_or_skip()
    with gmsh_session() as gmsh:
        draw(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        if path.suffix in (".stl", ".msh"):
            gmsh.option.setNumber("Mesh.MeshSizeMax", 8.0)
            gmsh.model.mesh.generate(2 if path.suffix == ".stl" else 3)
        gmsh.write(str(path))
    return path


def prism(occ, length=100.0, height=20.0, width=10.0):
    """Along x, height along y, width along z, the middle of its base at the origin."""
    occ.addBox(0.0, -0.5 * height, -0.5 * width, length, height, width)


def solved(solid, F, held):
    """Displacements ``(n,)`` mm of a solid under nodal forces ``F`` (n,) N, the unknowns ``held`` at zero."""
    # the solver is of the extra
    from vjm_fea.solid.compliance import factorized

    free = np.setdiff1d(np.arange(solid.mesh.unknowns), held)
    K = scipy.sparse.csr_matrix(solid.stiffness()[free][:, free])
    K.sort_indices()
    factors = factorized(K)
    u = np.zeros(solid.mesh.unknowns)
    u[free] = factors.solve(F[free, None])[:, 0]
    factors.free()
    return u
