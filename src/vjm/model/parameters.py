"""The parameters of a chain that its behaviour can be differentiated by: compliances, stiffnesses, lengths.

A `Parameter` knows its present value and how to make the same chain with another one. The functions here make the
common ones from a chain; any other is a `Parameter` with an ``apply`` of one's own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from vjm.model.machine import Machine
from vjm.model.parts import Beam, Part

SECTION_VALUES = ("EA", "GJ", "EIy", "EIz", "GAy", "GAz")
"""Stiffnesses of a `vjm.model.parts.Section`."""


@dataclass(frozen=True)
class Parameter:
    """One number of a chain.

    Attributes:
        name: for people.
        unit: of the value; derivatives are per this unit.
        value: at present.
        scale: change that matters, in the same unit and positive: the value itself for most, a radian for an
            angle. Differences are taken over a small fraction of it.
        apply: makes the chain with another value; ``apply(chain, value)`` is the chain itself.
    """

    name: str
    unit: str
    value: float
    scale: float
    apply: Callable[[Machine, float], Machine]

    def __post_init__(self) -> None:
        if not np.isfinite(self.value) or not np.isfinite(self.scale) or self.scale <= 0.0:
            raise ValueError(
                f"parameter '{self.name}': value must be finite and scale positive, "
                f"not {self.value} and {self.scale}"
            )


def compliance_entry(chain: Machine, part: str, i: int, j: int) -> Parameter:
    """Entry (i, j) of the 6×6 compliance of one member of a beam, counted from one as printed, and (j, i) with it.

    It counts only where an engine uses the matrix: a beam that is split into springs has its section.
    """
    beam = _beam(chain, part)
    if beam.compliance is None:
        raise ValueError(f"part '{part}' has no compliance matrix of which ({i},{j}) could change")
    if not (1 <= i <= 6 and 1 <= j <= 6):
        raise ValueError(f"part '{part}': a compliance has the entries (1,1) to (6,6), not ({i},{j})")
    given, row, column = beam.compliance, i - 1, j - 1

    def apply(chain: Machine, value: float) -> Machine:
        now = _beam(chain, part)
        matrix = (given if now.compliance is None else now.compliance).copy()
        matrix[row, column] = matrix[column, row] = value
        return _with(chain, replace(now, compliance=matrix))

    unit = "mm/N" if i <= 3 and j <= 3 else "rad/(N mm)" if i > 3 and j > 3 else "rad/N"
    # an entry that is zero has no size of its own: that of its diagonal entries
    scale = float(np.sqrt(given[row, row] * given[column, column]))
    return Parameter(f"{part} compliance ({i},{j})", unit, float(given[row, column]), scale, apply)


def compliance_factor(chain: Machine, part: str) -> Parameter:
    """Factor on all compliances of a part: its compliance matrix, and one over its section's stiffnesses."""
    given = _beam(chain, part)

    def apply(chain: Machine, value: float) -> Machine:
        section = given.section
        if section is not None:
            section = replace(section, **{name: getattr(section, name) / value for name in SECTION_VALUES})
        compliance = None if given.compliance is None else given.compliance * value
        return _with(chain, replace(_beam(chain, part), compliance=compliance, section=section))

    return Parameter(f"{part} compliance factor", "1", 1.0, 1.0, apply)


def section_value(chain: Machine, part: str, name: str) -> Parameter:
    """A stiffness of the section of one member of a beam, one of `SECTION_VALUES`.

    It counts only where an engine uses the section: a beam that is one spring has its matrix, if it has any.
    """
    section = _beam(chain, part).section
    if section is None:
        raise ValueError(f"part '{part}' has no section of which {name} could change")
    if name not in SECTION_VALUES:
        raise ValueError(f"part '{part}': a section has {', '.join(SECTION_VALUES)}, not {name}")
    value = float(getattr(section, name))
    if not np.isfinite(value):
        raise ValueError(f"part '{part}': {name} is infinite: shear is neglected")

    def apply(chain: Machine, value: float) -> Machine:
        now = _beam(chain, part)
        return _with(chain, replace(now, section=replace(now.section or section, **{name: value})))

    return Parameter(f"{part} {name}", "N" if name in ("EA", "GAy", "GAz") else "N mm²", value, value, apply)


def beam_length(chain: Machine, part: str) -> Parameter:
    """Length of a beam in mm. What follows it moves along, the unloaded pose of every posture with it."""
    value = float(_beam(chain, part).length)

    def apply(chain: Machine, value: float) -> Machine:
        return _with(chain, replace(_beam(chain, part), length=value))

    return Parameter(f"{part} length", "mm", value, value, apply)


def _beam(chain: Machine, name: str) -> Beam:
    part = next((part for part in chain.parts if part.name == name), None)
    if part is None:
        raise ValueError(f"{chain.name}: no part '{name}'; it has {', '.join(part.name for part in chain.parts)}")
    if not isinstance(part, Beam):
        raise ValueError(f"part '{name}' is no beam")
    return part


def _with(chain: Machine, changed: Part) -> Machine:
    """The chain with the part of this name replaced."""
    return replace(chain, parts=tuple(changed if part.name == changed.name else part for part in chain.parts))
