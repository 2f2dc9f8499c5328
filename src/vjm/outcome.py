"""What all results share: a table of their figures, as plain Python, and as a data frame."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from vjm.notebook import DataFrame


class Outcome(ABC):
    """A result that shows itself as a table.

    Example:
        >>> import vjm
        >>> found = vjm.sweep("planar-2r", {"tool.mass_kg": [1.0]}, ["mass"])
        >>> isinstance(found, vjm.Outcome), len(found.table())
        (True, 1)
    """

    @abstractmethod
    def table(self) -> list[dict[str, Any]]:
        """The figures, one row each of columns by name; the names say the units."""

    def to_dict(self) -> dict[str, Any]:
        """All that was found by the names of the attributes, as dictionaries, lists, texts and numbers."""
        result: dict[str, Any] = plain(self)
        return result

    def to_frame(self) -> DataFrame:
        """`table` as a pandas DataFrame.

        Raises:
            ImportError: pandas is not installed.
        """
        from vjm.notebook import frame_of

        return frame_of(self.table())


def plain(value: object) -> Any:  # noqa: ANN401
    """A value as dictionaries, lists, texts and numbers; complex numbers as real and imaginary part.

    Example:
        >>> plain({("A", "x"): np.array([1.0, 2.0]), "b": 3j})
        {'A, x': [1.0, 2.0], 'b': [0.0, 3.0]}
    """
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, Enum | str):
        return str(value)
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {", ".join(name) if isinstance(name, tuple) else str(name): plain(v) for name, v in value.items()}
    if isinstance(value, Collection):
        return [plain(each) for each in value]
    if is_dataclass(value):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value)}
    return str(value)
