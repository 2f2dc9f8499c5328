"""Equilibrium paths: load stepping, arc length, branches, imperfections.

- `lumped_problem`: a machine under a load case, as a problem that can be followed.
- `load_stepping` follows the stable path by its ramp, `arc_length` any path by its arc.
- `load_grid`: a path on a given grid.
- `events`: what lies between two points. `branch_shape`: which way a branch leaves a bifurcation.
- `path`: what comes out. `one_path` and `limits_along` ask a path that is there.
"""
