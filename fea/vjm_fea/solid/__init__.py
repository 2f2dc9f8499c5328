"""Parts as solids: from a drawing to a mesh of quadratic tetrahedra, linear elasticity, and a 6×6 compliance.

Needs the extra ``vjm-stiffness[solid]``. Nothing here loads gmsh, scikit-fem or a solver before it is used.
"""
