"""What every engine is: something that traces the path of a chain under a load case."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from vjm.continuation.path import Path
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine


class Engine(Protocol):
    """A way to compute load paths; comparisons never ask which one they hold.

    Attributes:
        label: the name under which results are filed, such as ``vjm-16f16`` or ``exudyn``.
    """

    @property
    def label(self) -> str: ...  # noqa: D102

    def trace(self, chain: Machine, load_case: LoadCase, progress: Callable[[float], None] | None = None) -> Path:
        """Take the chain through the load case, staying on the stable path.

        Args:
            chain: the machine; the engine splits or meshes its beams as it needs.
            load_case: what is done to it.
            progress: called with the fraction done.

        Raises:
            ValueError: the chain lacks something that the engine needs, such as a beam's section.
        """
