"""Equilibrium paths: load stepping, arc length, branch switching, imperfections."""
