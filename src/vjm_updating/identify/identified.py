"""A part's compliance and the beam behind it, as a result in Python."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vjm.model.load_case import COMPONENTS
from vjm.model.machine import Machine
from vjm.outcome import Outcome
from vjm.rotations import Array
from vjm_updating.identify.command import identify_matrix, identify_part
from vjm_updating.identify.report import IdentificationDocument


@dataclass(frozen=True)
class Identification(Outcome):
    """What virtual experiments or a matrix say of a part.

    Attributes:
        found: every figure, as the JSON document of `validate identify` has it.

    Example:
        >>> import vjm_updating
        >>> vjm_updating.identified(matrix="foot-19").compliance.shape
        (6, 6)
    """

    found: IdentificationDocument

    @property
    def compliance(self) -> Array:
        """``(6, 6)`` mm/N, 1/N, rad/(N mm)."""
        return np.array(self.found.compliance)

    def table(self) -> list[dict[str, Any]]:
        """The compliance, a row for each component of the motion."""
        rows = zip(COMPONENTS, self.found.compliance, strict=True)
        return [{"motion": name, **dict(zip(COMPONENTS, row, strict=True))} for name, row in rows]

    def to_dict(self) -> dict[str, Any]:
        """As the JSON document."""
        return self.found.model_dump(mode="json")


def identified(
    machine: Machine | None = None, part: str = "", *, matrix: str | Path | None = None
) -> Identification:
    """A part's 6×6 compliance from virtual experiments, or of a matrix the uniform beam behind it.

    Args:
        machine: see `vjm.load`.
        part: name of one of its parts, or ``first..last`` for parts in series without passive joints.
        matrix: a matrix of the library or a file instead.

    Raises:
        ValueError: neither or both are given, no such part, or one that cannot be meshed.
        NoConvergenceError: a finite element solution was not found.
        ImportError: experiments need the extra ``fea``.

    Example:
        >>> import vjm_updating
        >>> found = vjm_updating.identified(matrix="foot-19")
        >>> found.compliance.shape
        (6, 6)
    """
    if (machine is None) == (matrix is None) or (matrix is not None and part):
        raise ValueError("give either a machine with one of its parts, or a matrix")
    if matrix is not None:
        return Identification(identify_matrix(matrix))
    assert machine is not None
    if not part:
        raise ValueError(f"part: which one? {machine.name} has {', '.join(beam.name for beam in machine.beams)}")
    return Identification(identify_part(machine, part))
