"""Conventional stiffness models to compare with: linear (5), and matrix structural analysis."""

from vjm.baselines.linear import LinearEngine
from vjm.baselines.msa import MsaEngine

__all__ = ["LinearEngine", "MsaEngine"]
