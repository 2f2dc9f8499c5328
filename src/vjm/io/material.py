"""The material of a shape in a model file: moduli, yield stress, density."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from vjm.io.errors import printed
from vjm.io.sections import Density, Table


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
