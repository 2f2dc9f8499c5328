"""Cross-sections in a model file: stiffness values, or a shape and its material.

A section's axes are x along the beam, y and z across it. A rectangle's width lies along z and its thickness
along y, so that it bends softly about z, deflecting along y.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag, model_validator

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


def _plausible_modulus(modulus: float) -> float:
    # the softest rubber in shear to diamond
    if not 0.1 <= modulus <= 2e6:
        raise ValueError(
            f"= {printed(modulus)} is outside 0.1 to 2e6 MPa: is it in Pa or GPa? Write it in MPa (steel 2.1e5)"
        )
    return modulus


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
    """A TOML table: no unknown keys, no silent conversion, no nan or inf."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


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


class Shape(Table):
    """What every shape says of its material; shear is neglected where no ``shear_factor`` is given."""

    source: str = ""
    youngs_modulus_MPa: Annotated[float, AfterValidator(_plausible_modulus)]  # noqa: N815
    poissons_ratio: float | None = Field(None, gt=-1.0, le=0.5)
    shear_modulus_MPa: Annotated[float, AfterValidator(_plausible_modulus)] | None = None  # noqa: N815
    shear_factor: float | None = Field(
        None, gt=0.0, le=1.0, description="shear area over area (5/6 for a rectangle)"
    )
    yield_stress_MPa: float | None = Field(None, gt=0.0)  # noqa: N815
    density_kg_per_m3: Density | None = None

    @model_validator(mode="after")
    def _material(self) -> Shape:
        E = self.youngs_modulus_MPa
        if self.yield_stress_MPa is not None and self.yield_stress_MPa > 0.1 * E:
            raise ValueError(
                f"has yield_stress_MPa = {printed(self.yield_stress_MPa)}, above a tenth of "
                f"youngs_modulus_MPa = {printed(E)}: is one of them in another unit? Write both in MPa"
            )
        if (self.poissons_ratio is None) == (self.shear_modulus_MPa is None):
            raise ValueError("needs either poissons_ratio or shear_modulus_MPa, and not both")
        if self.poissons_ratio is not None and self.poissons_ratio < -0.7:
            # the re-entrant foams that have been made reach -0.7
            raise ValueError(f"has poissons_ratio = {printed(self.poissons_ratio)}: it is negative (steel 0.3)")
        return self

    @property
    def shear_modulus(self) -> float:
        """Shear modulus, MPa; from Poisson's ratio where that is given."""
        if self.shear_modulus_MPa is not None:
            return self.shear_modulus_MPa
        assert self.poissons_ratio is not None
        return self.youngs_modulus_MPa / (2.0 * (1.0 + self.poissons_ratio))

    def _stiffness(self, area: float, J: float, Iy: float, Iz: float) -> parts.Section:
        E, G = self.youngs_modulus_MPa, self.shear_modulus
        GA = math.inf if self.shear_factor is None else G * area * self.shear_factor
        # kg/m³ are 1e-9 kg/mm³
        mass = 1e-9 * area * (self.density_kg_per_m3 or 0.0)
        return parts.Section(E * area, G * J, E * Iy, E * Iz, GA, GA, mass)


class Rectangle(Shape):
    """A solid rectangle, ``width_mm`` along the section's z and ``thickness_mm`` along its y."""

    shape: Literal["rectangle"]
    width_mm: LengthMM = Field(description="along the section's z axis")
    thickness_mm: LengthMM = Field(description="along the section's y axis")

    def stiffness(self) -> parts.Section:
        """The section's stiffness, N and N mm²."""
        w, t = self.width_mm, self.thickness_mm
        return self._stiffness(w * t, rectangle_torsion(w, t), t * w**3 / 12.0, w * t**3 / 12.0)


class SquareTube(Shape):
    """A square tube of outer ``width_mm`` with sharp corners."""

    shape: Literal["square_tube"]
    width_mm: LengthMM = Field(description="outer width")
    wall_mm: LengthMM

    @model_validator(mode="after")
    def _hollow(self) -> SquareTube:
        _check_hole(self.wall_mm, self.width_mm, "width_mm", "rectangle")
        return self

    def stiffness(self) -> parts.Section:
        """The section's stiffness, N and N mm²."""
        w, t = self.width_mm, self.wall_mm
        hole = w - 2.0 * t
        inertia = (w**4 - hole**4) / 12.0
        return self._stiffness(w**2 - hole**2, square_tube_torsion(w, t), inertia, inertia)


class RoundBar(Shape):
    """A solid round bar."""

    shape: Literal["round_bar"]
    diameter_mm: LengthMM

    def stiffness(self) -> parts.Section:
        """The section's stiffness, N and N mm²."""
        d = self.diameter_mm
        inertia = math.pi * d**4 / 64.0
        return self._stiffness(math.pi * d**2 / 4.0, 2.0 * inertia, inertia, inertia)


class RoundTube(Shape):
    """A round tube of outer ``diameter_mm``."""

    shape: Literal["round_tube"]
    diameter_mm: LengthMM = Field(description="outer diameter")
    wall_mm: LengthMM

    @model_validator(mode="after")
    def _hollow(self) -> RoundTube:
        _check_hole(self.wall_mm, self.diameter_mm, "diameter_mm", "round_bar")
        return self

    def stiffness(self) -> parts.Section:
        """The section's stiffness, N and N mm²."""
        d, hole = self.diameter_mm, self.diameter_mm - 2.0 * self.wall_mm
        inertia = math.pi * (d**4 - hole**4) / 64.0
        return self._stiffness(math.pi * (d**2 - hole**2) / 4.0, 2.0 * inertia, inertia, inertia)


class RectangularTube(Shape):
    """A rectangular tube, sharp corners, ``width_mm`` along the section's z and ``thickness_mm`` along its y."""

    shape: Literal["rectangular_tube"]
    width_mm: LengthMM = Field(description="outer, along the section's z axis")
    thickness_mm: LengthMM = Field(description="outer, along the section's y axis")
    wall_mm: LengthMM

    @model_validator(mode="after")
    def _hollow(self) -> RectangularTube:
        _check_hole(self.wall_mm, min(self.width_mm, self.thickness_mm), "its smaller side", "rectangle")
        return self

    def stiffness(self) -> parts.Section:
        """The section's stiffness, N and N mm²; torsion as for a square tube, `square_tube_torsion`."""
        w, t, s = self.width_mm, self.thickness_mm, self.wall_mm
        a, b = w - 2.0 * s, t - 2.0 * s
        round_, across = (w - s) + (t - s), (w - s) * (t - s)
        J = 2.0 * s * across**2 / round_ + 2.0 / 3.0 * round_ * s**3
        return self._stiffness(w * t - a * b, J, (t * w**3 - b * a**3) / 12.0, (w * t**3 - a * b**3) / 12.0)


class IBeam(Shape):
    """An I of two flanges, ``width_mm`` along the section's z, and a web along its y, ``height_mm`` over all."""

    shape: Literal["i_beam"]
    width_mm: LengthMM = Field(description="of the flanges, along the section's z axis")
    height_mm: LengthMM = Field(description="over all, along the section's y axis")
    flange_mm: LengthMM
    web_mm: LengthMM

    @model_validator(mode="after")
    def _open(self) -> IBeam:
        if 2.0 * self.flange_mm >= self.height_mm or self.web_mm >= self.width_mm:
            raise ValueError("has flanges or a web that leave nothing open: thin them, or give shape = 'rectangle'")
        return self

    def stiffness(self) -> parts.Section:
        """The section's stiffness, N and N mm²; torsion is that of its three strips, without warping."""
        b, h, f, w = self.width_mm, self.height_mm, self.flange_mm, self.web_mm
        web = h - 2.0 * f
        J = 2.0 * rectangle_torsion(b, f) + rectangle_torsion(web, w)
        Iy = (2.0 * f * b**3 + web * w**3) / 12.0
        Iz = (b * h**3 - (b - w) * web**3) / 12.0
        return self._stiffness(2.0 * b * f + web * w, J, Iy, Iz)


def _check_hole(wall: float, across: float, key: str, solid: str) -> None:
    if wall >= 0.5 * across:
        raise ValueError(
            f"has wall_mm = {printed(wall)}, which leaves no hole in {key} = {printed(across)}: "
            f"give a thinner wall, or shape = '{solid}'"
        )


def rectangle_torsion(width: float, thickness: float) -> float:
    """Saint-Venant torsion constant of a solid rectangle, mm⁴ for sides in mm, by its exact series.

    ``J = a b³/3 (1 − 192/π⁵ · b/a · Σ tanh(n π a/2b)/n⁵)`` over odd n, a ≥ b (Timoshenko and Goodier,
    *Theory of Elasticity*, §109).
    """
    a, b = max(width, thickness), min(width, thickness)
    # terms fall as n⁻⁵: the first one left out is 3e-17 of the sum
    n = np.arange(1.0, 2000.0, 2.0)
    series = float(np.sum(np.tanh(0.5 * np.pi * n * a / b) / n**5))
    return a * b**3 / 3.0 * (1.0 - 192.0 / np.pi**5 * (b / a) * series)


def square_tube_torsion(width: float, wall: float) -> float:
    """Torsion constant of a square tube, mm⁴, outer width and wall in mm.

    Bredt's closed cell of the walls' middle line, ``4 A²/∮ds/t = (w − t)³ t``, and the walls' own torsion,
    ``∮ds t³/3``, which Bredt's formula leaves out: 15 % of it at a wall of a quarter of the width. Together
    they are low by at most 6.5 %, against a finite difference solution of Saint-Venant's problem.
    """
    middle = width - wall
    return middle**3 * wall + 4.0 / 3.0 * middle * wall**3


SHAPES: dict[str, type[Shape]] = {
    "rectangle": Rectangle,
    "square_tube": SquareTube,
    "rectangular_tube": RectangularTube,
    "round_bar": RoundBar,
    "round_tube": RoundTube,
    "i_beam": IBeam,
}
"""The shapes by what a file says in ``shape``. One more is written here and in `AnySection`."""


def _kind_of_section(raw: object) -> str:
    shape = raw.get("shape", "stiffness") if isinstance(raw, dict) else getattr(raw, "shape", "stiffness")
    return str(shape)


AnySection = Annotated[
    Annotated[StiffnessSection, Tag("stiffness")]
    | Annotated[Rectangle, Tag("rectangle")]
    | Annotated[SquareTube, Tag("square_tube")]
    | Annotated[RectangularTube, Tag("rectangular_tube")]
    | Annotated[RoundBar, Tag("round_bar")]
    | Annotated[RoundTube, Tag("round_tube")]
    | Annotated[IBeam, Tag("i_beam")],
    Discriminator(
        _kind_of_section,
        custom_error_type="unknown_shape",
        custom_error_message=(
            f"has an unknown shape: write {', '.join(map(repr, [*SHAPES][:-1]))} or '{[*SHAPES][-1]}', "
            "or no shape but EA_N, GJ_Nmm2, EIy_Nmm2 and EIz_Nmm2"
        ),
    ),
]
"""Stiffness values or a shape; the key ``shape`` tells."""
