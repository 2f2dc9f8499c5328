"""Who computes a compliance from a drawing that is not kept yet; light: the command registers it at its start."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vjm.io.solid_compliance import SolidResult, SolidTable

    Compute = Callable[[Path, SolidTable, str], SolidResult]
    """From a drawing, its table and its key."""

_computers: list[Compute] = []


def provide(compute: Compute) -> None:
    """Register who computes; the last one counts."""
    _computers[:] = [compute]


def provided() -> Compute | None:
    """Who computes, if anybody."""
    return _computers[-1] if _computers else None
