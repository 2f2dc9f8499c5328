"""The parts of a chain as corotational beams, solved with OpenSees; an optional extra of the project."""

from vjm_fea.opensees.beams import available
from vjm_fea.opensees.engine import OpenSeesEngine

__all__ = ["OpenSeesEngine", "available"]
