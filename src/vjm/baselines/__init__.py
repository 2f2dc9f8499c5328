"""Conventional stiffness models to compare with: linear (5), frozen Jacobians, matrix structural analysis."""

from vjm.baselines.linear import LinearEngine
from vjm.baselines.msa import MsaEngine
from vjm.baselines.unloaded_jacobian import UnloadedJacobianEngine

__all__ = ["LinearEngine", "MsaEngine", "UnloadedJacobianEngine"]
