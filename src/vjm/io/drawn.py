"""What a drawing says of a part beyond its compliance: its walls, its stress, and the beam that is nearest."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from pydantic import Field

from vjm.io.fields import VectorMM
from vjm.io.sections import LengthMM, Table
from vjm.model.parts import Beam, Section
from vjm.rotations import Array, rotate_matrix6, shift_compliance

UPPER = np.triu_indices(6)
Form = Annotated[list[float], Field(min_length=21, max_length=21)]


class DrawnTable(Table):
    """What is kept of a drawing in a model document; `vjm.io.solid_compliance` fills it in."""

    file: str
    thickness_mm: LengthMM = Field(description="twice the volume over the surface: of a plate, its thickness")
    bodies: int = Field(1, ge=1, description="that the drawing holds; they are bonded where they touch")
    bonded: bool = Field(False, description="whether that is meant")
    buckling_N: float | None = Field(  # noqa: N815
        None, gt=0.0, description="compression that buckles it as a column of its own sections, free at its tip"
    )
    yield_stress_MPa: float | None = Field(None, gt=0.0)  # noqa: N815
    stress_at_mm: list[VectorMM] = Field(description="own axes, from where the part begins: of every matrix below")
    stress_forms: list[Form] = Field(
        description="upper triangles, row by row, of matrices Q, in own axes, N, N mm, MPa. The highest von Mises "
        "stress under a wrench w at the tip is √(max wᵀQw)."
    )

    def forms(self) -> Array:
        """The matrices ``(k, 6, 6)``."""
        result = np.zeros((len(self.stress_forms), 6, 6))
        result[:, UPPER[0], UPPER[1]] = self.stress_forms
        upper = np.triu(result, 1)
        return result + np.swapaxes(upper, 1, 2)


@dataclass(frozen=True)
class Likeness:
    """The uniform beam in a part's own geometry that is nearest to its compliance.

    Attributes:
        section: of the beam.
        worst: the largest difference of the two compliances over √(c_ii c_jj).
        entry: where, counted from one.
        length: of the beam, mm.
    """

    section: Section
    worst: float
    entry: tuple[int, int]
    length: float

    @property
    def gyration(self) -> float:
        """The larger radius of gyration, mm."""
        return float(np.sqrt(max(self.section.EIy, self.section.EIz) / self.section.EA))


def nearest_beam(part: Beam) -> Likeness:
    """The beam that has a part's length, axes and end offset, and the diagonal of its compliance at the middle.

    There a uniform beam's compliance is diagonal. Where it shears less than none, shear is left out.
    """
    assert part.compliance is not None
    L = part.length
    at_end = rotate_matrix6(shift_compliance(part.compliance, -part.end_offset), part.section_frame.T)
    a, y, z, t, cy, cz = np.diag(shift_compliance(at_end, [-0.5 * L, 0.0, 0.0])).tolist()
    shear = [float(one) for one in (y - L**2 * cz / 12.0, z - L**2 * cy / 12.0)]
    section = Section(L / a, L / t, L / cy, L / cz, *(L / one if one > 0.0 else float("inf") for one in shear))
    theory = replace(part, section=section, compliance=None, count=1).beam_compliance()
    scale = np.sqrt(np.outer(np.diag(part.compliance), np.diag(part.compliance)))
    miss = np.abs(theory - part.compliance) / scale
    i, j = sorted(int(k) for k in np.unravel_index(np.argmax(miss), (6, 6)))
    return Likeness(section, float(miss[i, j]), (i + 1, j + 1), L)
