"""The parts of a chain as geometrically nonlinear beams, solved by finite elements."""

from vjm_fea.exudyn.engine import ExudynEngine

__all__ = ["ExudynEngine"]
