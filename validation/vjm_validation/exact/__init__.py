"""Exact reference solutions for the verification hierarchy.

Every figure here is computed to 1e-10 or better by a route that shares nothing with the solvers under test:
closed forms, elliptic integrals, roots of characteristic equations, spectral collocation and high-order
integration of the rod's own differential equation. A published figure is quoted where it confirms one.
"""
