"""What every engine is: something that walks a chain through a programme and returns its path."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from vjm.chain import Chain
from vjm.paths import Path
from vjm.programme import Programme


class Engine(Protocol):
    """A way to compute load paths; comparisons never ask which one they hold.

    Attributes:
        label: the name under which results are filed, such as ``vjm-16f16`` or ``exudyn``.
    """

    @property
    def label(self) -> str: ...  # noqa: D102

    def walk(self, chain: Chain, programme: Programme, progress: Callable[[float], None] | None = None) -> Path:
        """Take the chain through the programme, staying on the stable path.

        Args:
            chain: the machine; the engine splits or meshes its beams as it needs.
            programme: what is done to it.
            progress: called with the fraction done.

        Raises:
            ValueError: the chain lacks something that the engine needs, such as a beam's section.
        """
