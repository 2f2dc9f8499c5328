"""Tables of a model file, lengths and densities that a part can have, and sections known by their stiffness.

A section's axes are x along the beam, y and z across it.
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from vjm.io.errors import printed
from vjm.model import parts

SHORTEST_MM, LONGEST_MM = 0.1, 1e5
"""Lengths outside are taken for another unit: a link of 0.1 mm or of 100 m is no robot's."""


def _plausible_length(length: float) -> float:
    if length <= 0.0:
        raise ValueError(f"must be above 0, got {printed(length)}")
    if length < SHORTEST_MM:
        raise ValueError(f"= {printed(length)} is below {SHORTEST_MM} mm: is it in metres? Write it in mm")
    if length > LONGEST_MM:
        raise ValueError(f"= {printed(length)} is above {printed(LONGEST_MM)} mm: is it in µm? Write it in mm")
    return length


def _plausible_density(density: float) -> float:
    # foam to osmium
    if not 10.0 <= density <= 25000.0:
        raise ValueError(
            f"= {printed(density)} is outside 10 to 25000 kg/m³: is it in g/cm³? Write it in kg/m³ (steel 7850)"
        )
    return density


Density = Annotated[float, AfterValidator(_plausible_density)]
"""kg/m³."""


LengthMM = Annotated[float, AfterValidator(_plausible_length), Field(description="mm, 0.1 to 1e5")]
"""A length in mm that a robot's part can have."""

Stiffness = Annotated[float, Field(ge=1e-3, le=1e18)]
"""N or N mm²: from a thread to a block of steel of one metre."""


class Table(BaseModel):
    """A TOML table: no unknown keys, no silent conversion, no nan or inf.

    What checks it is built at its first use: a file has few of the tables that there are.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True, defer_build=True)


class StiffnessSection(Table):
    """A section known by its stiffness; shear is neglected where no GA is given."""

    source: str = ""
    EA_N: Stiffness = Field(description="axial")
    GJ_Nmm2: Stiffness = Field(description="torsion")
    EIy_Nmm2: Stiffness = Field(description="bending about y, deflecting along z")
    EIz_Nmm2: Stiffness = Field(description="bending about z, deflecting along y")
    GAy_N: Stiffness | None = Field(None, description="shear for deflection along y")
    GAz_N: Stiffness | None = Field(None, description="shear for deflection along z")

    def stiffness(self) -> parts.Section:
        """The section's stiffness, N and N mm²."""
        return parts.Section(
            EA=self.EA_N,
            GJ=self.GJ_Nmm2,
            EIy=self.EIy_Nmm2,
            EIz=self.EIz_Nmm2,
            GAy=math.inf if self.GAy_N is None else self.GAy_N,
            GAz=math.inf if self.GAz_N is None else self.GAz_N,
        )
