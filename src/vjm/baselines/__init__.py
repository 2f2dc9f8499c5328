"""Conventional stiffness models to compare with: linear (5), frozen Jacobians, matrix structural analysis."""

from vjm.baselines.linear import LinearEngine, UnloadedJacobianEngine
from vjm.baselines.msa import MsaEngine

__all__ = ["LinearEngine", "MsaEngine", "UnloadedJacobianEngine"]
