"""Who computes a compliance from a drawing that is not kept yet; light: the command registers it at its start."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

Compute = Callable[[Path, Any], Any]
"""From a drawing, its `vjm.io.solid_compliance.SolidTable` to its `SolidResult`."""

_computers: list[Compute] = []


def provide(compute: Compute) -> None:
    """Register who computes; the last one counts."""
    _computers[:] = [compute]


def provided() -> Compute | None:
    """Who computes, if anybody."""
    return _computers[-1] if _computers else None
