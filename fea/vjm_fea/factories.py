"""The finite element engines by the names of their entry points (see `vjm.engines`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from vjm.engines import EngineOptions
from vjm.model.machine import USUAL_SEGMENTS

if TYPE_CHECKING:
    from vjm_fea.exudyn.engine import ExudynEngine
    from vjm_fea.opensees.engine import OpenSeesEngine

EXUDYN_MISSING = "Exudyn is not installed: pip install 'vjm-stiffness[fea]'"


def exudyn(options: EngineOptions) -> ExudynEngine:
    """Geometrically exact beams, foot and bars.

    Raises:
        ImportError: Exudyn is not installed.
    """
    return _exudyn(options, foot_spring=False)


def exudyn_footspring(options: EngineOptions) -> ExudynEngine:
    """The same with the foot as its 6×6 spring.

    Raises:
        ImportError: Exudyn is not installed.
    """
    return _exudyn(options, foot_spring=True)


def opensees(options: EngineOptions) -> OpenSeesEngine:
    """OpenSees' mixed beams."""
    from vjm_fea.opensees import OpenSeesEngine

    return OpenSeesEngine(elements=options.segments or USUAL_SEGMENTS)


def _exudyn(options: EngineOptions, *, foot_spring: bool) -> ExudynEngine:
    try:
        import exudyn as _  # noqa: F401
    except ModuleNotFoundError as error:
        if error.name != "exudyn":
            raise
        raise ImportError(EXUDYN_MISSING) from None
    from vjm_fea.exudyn.engine import ExudynEngine

    return ExudynEngine(foot_spring=foot_spring, elements=options.segments or USUAL_SEGMENTS)
