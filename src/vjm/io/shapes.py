"""Cross-sections as shapes: the one place that knows what a shape is, from its stiffness to its fibres.

A section's axes are x along the beam, y and z across it. A rectangle's width lies along z and its thickness
along y, so that it bends softly about z, deflecting along y.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Union

import numpy as np
from pydantic import AfterValidator, Discriminator, Field, Tag, field_validator, model_validator

from vjm.io import saint_venant
from vjm.io.errors import ModelFileError, printed, validated
from vjm.io.fields import Density, LengthMM, StiffnessSection, Table, tags_of
from vjm.io.saint_venant import Empty, PolygonConstants, Quarter, Ring
from vjm.model import parts
from vjm.rotations import Array

# --- The material of a shape in a model file: moduli, yield stress, density ---------------------------------------


def _plausible_modulus(modulus: float) -> float:
    # the most compliant rubber in shear to diamond
    if not 0.1 <= modulus <= 2e6:
        raise ValueError(
            f"= {printed(modulus)} is outside 0.1 to 2e6 MPa: is it in Pa or GPa? Write it in MPa (steel 2.1e5)"
        )
    return modulus


class Material(Table):
    """An isotropic solid; where its shear modulus is given, one that bends and shears as two different ones."""

    source: str = ""
    youngs_modulus_MPa: Annotated[float, AfterValidator(_plausible_modulus)]  # noqa: N815
    poissons_ratio: float | None = Field(None, gt=-1.0, le=0.5)
    shear_modulus_MPa: Annotated[float, AfterValidator(_plausible_modulus)] | None = None  # noqa: N815
    yield_stress_MPa: float | None = Field(None, gt=0.0)  # noqa: N815
    density_kg_per_m3: Density | None = None

    @model_validator(mode="after")
    def _material(self) -> Material:
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

    @property
    def isotropic_ratio(self) -> float:
        """Poisson's ratio; where a shear modulus is given, that of an isotropic solid nearest to both moduli."""
        if self.poissons_ratio is not None:
            return self.poissons_ratio
        return min(max(0.5 * self.youngs_modulus_MPa / self.shear_modulus - 1.0, -0.7), 0.5)


GAUSS = np.polynomial.legendre.leggauss(100)
"""Places and weights of the fibres over a band's depth, from −1 to 1."""
STRAIGHT = 1e-3
"""Product of inertia over the second moments, and shear centre over the size, up to which a profile is straight."""
COMPUTED = "computed"
"""In place of a shear factor: the shape's own shear areas."""


class Shape(Material):
    """A shape and its material: all that is known of a section; shear is neglected without a ``shear_factor``.

    A shape says its outer sides, area, second moments of area, torsion and warping constants, shear areas and
    fibres here, and nowhere else. But for polygons they are symmetric about both axes.
    """

    shear_factor: float | str | None = Field(
        None,
        description="shear area over area; 'computed': of each axis from the shape and Poisson's ratio",
        json_schema_extra={"anyOf": [{"type": "number", "exclusiveMinimum": 0.0, "maximum": 1.0},
                                     {"const": COMPUTED}, {"type": "null"}]},
    )  # fmt: skip

    rounded: ClassVar[bool] = False
    """Whether the largest stresses of the two bendings lie at no common corner."""

    @field_validator("shear_factor")
    @classmethod
    def _factor(cls, value: float | str | None) -> float | str | None:
        if value is None or value == COMPUTED or (isinstance(value, float) and 0.0 < value <= 1.0):
            return value
        given = printed(value) if isinstance(value, float) else repr(value)
        raise ValueError(f"must be above 0 and at most 1, or '{COMPUTED}', got {given}")

    @property
    @abstractmethod
    def geometry(self) -> saint_venant.Geometry:
        """What follows from its sizes."""

    @property
    def sides(self) -> tuple[float, float]:
        """Outer lengths along y and along z, mm."""
        return self.geometry.sides

    @property
    def area(self) -> float:
        """In mm²."""
        return self.geometry.area

    @property
    def inertias(self) -> tuple[float, float]:
        """Second moments of area about y and about z, mm⁴."""
        return self.geometry.inertias

    @property
    def torsion_constant(self) -> float:
        """Saint-Venant's, mm⁴."""
        return self.geometry.torsion

    @property
    def warping_constant(self) -> float:
        """About the shear centre, mm⁶."""
        return self.geometry.warping

    @property
    def shear_areas(self) -> tuple[float, float]:
        """For deflection along y and along z, mm²; see `vjm.io.saint_venant`."""
        geometry = self.geometry
        if isinstance(geometry, PolygonConstants):
            return geometry.shear_areas
        return geometry.shear_areas(self.isotropic_ratio)

    def fibres(self) -> tuple[Array, Array]:
        """Distances ``(k,)`` in mm from the axis z over the half ``y > 0``, and the areas in mm² that lie there."""
        steps, width = self.geometry.steps, self.geometry.width
        places = [low + 0.5 * (high - low) * (GAUSS[0] + 1.0) for low, high in pairwise(steps)]
        areas = [0.5 * (b - a) * GAUSS[1] * width(y) for (a, b), y in zip(pairwise(steps), places, strict=True)]
        return np.concatenate(places), np.concatenate(areas)

    @property
    def section_moduli(self) -> tuple[float, float]:
        """Elastic section moduli of bending about y and about z, mm³: the moment over its largest stress."""
        (Iy, Iz), (far_y, far_z) = self.inertias, self.geometry.farthest
        return Iy / far_z, Iz / far_y

    @property
    def warping_length(self) -> float:
        """``√(E I_w/(G J))`` in mm: how far from a clamped end torsion is stiffer, as the end cannot warp."""
        E, G = self.youngs_modulus_MPa, self.shear_modulus
        return math.sqrt(E * self.warping_constant / (G * self.torsion_constant))

    def stiffness(self) -> parts.Section:
        """The section's stiffness, N and N mm²; torsion with ends that are free to warp."""
        E, G, area, (Iy, Iz) = self.youngs_modulus_MPa, self.shear_modulus, self.area, self.inertias
        if self.shear_factor is None:
            shear = (math.inf, math.inf)
        elif isinstance(self.shear_factor, str):
            shear = self.shear_areas
        else:
            shear = (area * self.shear_factor, area * self.shear_factor)
        # kg/m³ are 1e-9 kg/mm³
        mass = 1e-9 * area * (self.density_kg_per_m3 or 0.0)
        return parts.Section(E * area, G * self.torsion_constant, E * Iy, E * Iz, G * shear[0], G * shear[1], mass)


class Rectangle(Shape):
    """A solid rectangle, ``width_mm`` along the section's z and ``thickness_mm`` along its y."""

    shape: Literal["rectangle"]
    width_mm: LengthMM = Field(description="along the section's z axis")
    thickness_mm: LengthMM = Field(description="along the section's y axis")

    @property
    def geometry(self) -> Quarter:
        """The quarter ``y, z ≥ 0``."""
        return Quarter((0.0, 0.5 * self.thickness_mm), (0.0, 0.5 * self.width_mm), Empty.NOTHING)


class SquareTube(Shape):
    """A square tube of outer ``width_mm`` with sharp corners."""

    shape: Literal["square_tube"]
    width_mm: LengthMM = Field(description="outer width")
    wall_mm: LengthMM

    @model_validator(mode="after")
    def _hollow(self) -> SquareTube:
        _check_hole(self.wall_mm, self.width_mm, "width_mm", "rectangle")
        _check_walls({"wall_mm": self.wall_mm}, self.width_mm)
        return self

    @property
    def geometry(self) -> Quarter:
        """The quarter ``y, z ≥ 0``."""
        ends = (0.5 * self.width_mm - self.wall_mm, 0.5 * self.width_mm)
        return Quarter(ends, ends, Empty.CORE)


class RectangularTube(Shape):
    """A rectangular tube, sharp corners, ``width_mm`` along the section's z and ``thickness_mm`` along its y."""

    shape: Literal["rectangular_tube"]
    width_mm: LengthMM = Field(description="outer, along the section's z axis")
    thickness_mm: LengthMM = Field(description="outer, along the section's y axis")
    wall_mm: LengthMM

    @model_validator(mode="after")
    def _hollow(self) -> RectangularTube:
        _check_hole(self.wall_mm, min(self.width_mm, self.thickness_mm), "its smaller side", "rectangle")
        _check_walls({"wall_mm": self.wall_mm}, max(self.width_mm, self.thickness_mm))
        return self

    @property
    def geometry(self) -> Quarter:
        """The quarter ``y, z ≥ 0``."""
        y, z = 0.5 * self.thickness_mm, 0.5 * self.width_mm
        return Quarter((y - self.wall_mm, y), (z - self.wall_mm, z), Empty.CORE)


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
        _check_walls({"flange_mm": self.flange_mm, "web_mm": self.web_mm}, max(self.width_mm, self.height_mm))
        return self

    @property
    def geometry(self) -> Quarter:
        """The quarter ``y, z ≥ 0``."""
        y, z = 0.5 * self.height_mm, 0.5 * self.width_mm
        return Quarter((y - self.flange_mm, y), (0.5 * self.web_mm, z), Empty.SIDES)


class Round(Shape):
    """A round bar or tube."""

    diameter_mm: LengthMM = Field(description="outer diameter")

    rounded: ClassVar[bool] = True

    @property
    def bore(self) -> float:
        """Inner diameter, mm."""
        return 0.0

    @property
    def geometry(self) -> Ring:
        """The circles."""
        return Ring(self.diameter_mm, self.bore)


class RoundBar(Round):
    """A solid round bar."""

    shape: Literal["round_bar"]


class RoundTube(Round):
    """A round tube of outer ``diameter_mm``."""

    shape: Literal["round_tube"]
    wall_mm: LengthMM

    @model_validator(mode="after")
    def _hollow(self) -> RoundTube:
        _check_hole(self.wall_mm, self.diameter_mm, "diameter_mm", "round_bar")
        return self

    @property
    def bore(self) -> float:
        """Inner diameter, mm."""
        return self.diameter_mm - 2.0 * self.wall_mm


class Polygon(Shape):
    """A polygon with holes, whose axes y and z are principal ones and whose shear centre is its centroid.

    Beams here bend about two axes of their own and twist about their centre line. A profile of another kind, such
    as an angle or a channel, has constants of its own, see `vjm.io.saint_venant`, but is no section of a beam.
    """

    shape: Literal["polygon"]
    outline_mm: list[tuple[float, float]] = Field(description="corners [y, z] in their order along the border")
    holes_mm: list[list[tuple[float, float]]] = Field([], description="likewise of each hole")

    rounded: ClassVar[bool] = True

    @field_validator("outline_mm", "holes_mm", mode="before")
    @classmethod
    def _pairs(cls, value: object) -> object:
        """Lists of a file as tuples, and whole numbers as numbers."""
        if not isinstance(value, list | tuple):
            return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
        inner = [cls._pairs(each) for each in value]
        return tuple(inner) if all(isinstance(each, float) for each in inner) and inner else inner

    @model_validator(mode="after")
    def _bordered(self) -> Polygon:
        self.geometry  # noqa: B018 - what is no polygon, or too slender, is said with the file
        return self

    @property
    def loops(self) -> tuple[saint_venant.Loop, ...]:
        """The outline and the holes."""
        return (tuple(self.outline_mm), *(tuple(hole) for hole in self.holes_mm))

    @property
    def geometry(self) -> PolygonConstants:
        """All that is known of it, about its centroid."""
        return saint_venant.polygon_constants(self.loops, self.isotropic_ratio)

    def stiffness(self) -> parts.Section:
        """The section's stiffness, N and N mm².

        Raises:
            ValueError: its axes are no principal ones, or its shear centre is not its centroid.
        """
        constants, size = self.geometry, math.sqrt(self.area)
        turned = 0.5 * math.atan2(-2.0 * constants.product, constants.inertias[0] - constants.inertias[1])
        if abs(constants.product) > STRAIGHT * sum(constants.inertias):
            raise ValueError(
                f"its principal axes are turned by {turned:.4g} rad. Beams bend about y and z: "
                "turn the points, or give EA_N, GJ_Nmm2, EIy_Nmm2 and EIz_Nmm2 of the beam"
            )
        apart = math.hypot(*constants.shear_centre)
        if apart > STRAIGHT * size:
            raise ValueError(
                f"its shear centre lies {apart:.4g} mm beside its centroid. Beams twist about their "
                "centre line: give EA_N, GJ_Nmm2, EIy_Nmm2 and EIz_Nmm2 of the beam"
            )
        return super().stiffness()


def _check_hole(wall: float, across: float, key: str, solid: str) -> None:
    if wall >= 0.5 * across:
        raise ValueError(
            f"has wall_mm = {printed(wall)}, which leaves no hole in {key} = {printed(across)}: "
            f"give a thinner wall, or shape = '{solid}'"
        )


def _check_walls(walls: dict[str, float], side: float) -> None:
    for key, wall in walls.items():
        if wall < saint_venant.THINNEST * side:
            raise ValueError(
                f"has {key} = {printed(wall)}, below a ten-thousandth of its side of {printed(side)} mm. "
                "Its torsion and shear cannot be computed: give EA_N, GJ_Nmm2, EIy_Nmm2 and EIz_Nmm2"
            )


SHAPES: dict[str, type[Shape]] = {
    tags_of(kind, "shape")[0]: kind
    for kind in (Rectangle, SquareTube, RectangularTube, RoundBar, RoundTube, IBeam, Polygon)
}
"""The shapes by what a file says in ``shape``."""

STEEL = {"youngs_modulus_MPa": 2.1e5, "poissons_ratio": 0.3, "density_kg_per_m3": 7850.0}
"""Of a shape without a modulus."""


def shape(name: str, /, **sizes: Any) -> Shape:  # noqa: ANN401
    """A cross-section by its shape, with all that is known of it: area, second moments, torsion, warping, shear.

    Args:
        name: ``round_tube``, ``square_tube``, ``round_bar``, ``rectangle`` and the others of a model file.
        sizes: keys that the shape has in a model file, such as ``diameter_mm=60.0, wall_mm=3.0``. Steel, where no
            ``youngs_modulus_MPa`` is among them.

    Raises:
        ModelFileError: no such shape or key, or a size that makes no section.

    Example:
        >>> import vjm
        >>> tube = vjm.shape("round_tube", diameter_mm=60.0, wall_mm=3.0)
        >>> round(tube.area, 2), f"{tube.stiffness().EA:.4g}"
        (537.21, '1.128e+08')
    """
    given = {key: float(value) if isinstance(value, int) else value for key, value in sizes.items()}
    return checked_shape({"shape": name} | ({} if "youngs_modulus_MPa" in given else STEEL) | given, name)


def checked_shape(table: Mapping[str, Any], where: str) -> Shape:
    """The shape of a section's table.

    Raises:
        ModelFileError: no such shape or key, or a size that makes no section.
    """
    kind = SHAPES.get(table["shape"])
    if kind is None:
        raise ModelFileError(f"{where}: shape = '{table['shape']}' is none of {', '.join(SHAPES)}")
    return validated(kind, table, where)


def _kind_of_section(raw: object) -> str:
    shape = raw.get("shape", "stiffness") if isinstance(raw, dict) else getattr(raw, "shape", "stiffness")
    return str(shape)


if TYPE_CHECKING:
    AnySection = StiffnessSection | Shape
else:
    AnySection = Annotated[
        Union[  # noqa: UP007  (of as many tables as there are shapes)
            tuple(Annotated[kind, Tag(name)] for name, kind in {"stiffness": StiffnessSection, **SHAPES}.items())
        ],
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
