"""The options of ``validate identify --solid`` that describe the part."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from vjm.rotations import Array
from vjm_fea.solid.compliance import RootSupport
from vjm_fea.solid.elasticity import IsotropicMaterial
from vjm_fea.solid.identify import ACCURACY, LARGEST, SolidTask

FACE = "by number, name, a point on it (x,y,z) or a box around it (x,y,z:x,y,z), mm; repeat for more faces"


@Parameter(name="*", group="A solid part")
@dataclass(frozen=True)
class SolidOptions:
    """A part as a drawing."""

    solid: Annotated[
        Path | None, Parameter(help="A drawing: STEP, BREP, closed STL or gmsh mesh; needs vjm-stiffness[solid].")
    ] = None
    youngs: Annotated[float | None, Parameter(help="Young's modulus, MPa.")] = None
    poisson: Annotated[float | None, Parameter(help="Poisson's ratio.")] = None
    density: Annotated[float | None, Parameter(help="kg/m³, for the mass.")] = None
    base: Annotated[tuple[str, ...], Parameter(help=f"Faces that are held, {FACE}.", negative="")] = ()
    tip: Annotated[tuple[str, ...], Parameter(help="Faces that are loaded, in the same way.", negative="")] = ()
    at: Annotated[
        str | None,
        Parameter(help="Point x,y,z in mm at which the compliance is read; else the tip's centre of area."),
    ] = None
    base_held: Annotated[
        RootSupport, Parameter(help="clamped: no point of the base moves; mean: it is still in the mean only.")
    ] = RootSupport.CLAMPED
    unit_mm: Annotated[float, Parameter(help="mm of one unit of the drawing; STEP says its unit itself.")] = 1.0
    bonded: Annotated[
        bool, Parameter(negative="", help="Bodies that touch are meant to be one, of one material.")
    ] = False
    accuracy: Annotated[float, Parameter(help="Half-interval in percent at which the refinement ends.")] = (
        100.0 * ACCURACY
    )
    largest: Annotated[int, Parameter(help="Unknowns of the finest mesh at most.")] = LARGEST

    wrench: Annotated[
        str | None, Parameter(help="fx,fy,fz,mx,my,mz in N and N mm at the tip: says the von Mises stress.")
    ] = None
    yield_stress: Annotated[float | None, Parameter(help="MPa; says at how many times the wrench it yields.")] = (
        None
    )
    pictures: Annotated[
        Path | None, Parameter(help="Folder for pictures of stress and deflected shape under each unit wrench.")
    ] = None

    def loads(self) -> Array | None:
        """The wrench ``(6,)`` that was given.

        Raises:
            ValueError: it is none.
        """
        if self.yield_stress is not None and not 0.0 < self.yield_stress < 1e4:
            raise ValueError(
                f"--yield-stress: {self.yield_stress:g} MPa is no solid's: give MPa, 250 for mild steel"
            )
        if self.wrench is None:
            if self.yield_stress is not None:
                raise ValueError("--yield-stress: goes with --wrench")
            return None
        return numbers(self.wrench, 6, "--wrench", "fx,fy,fz,mx,my,mz in N and N mm")

    def task(self) -> SolidTask:
        """The part to be identified.

        Raises:
            ValueError: an option is missing or no number that it may be.
        """
        assert self.solid is not None
        for name, value in (("--youngs", self.youngs), ("--poisson", self.poisson)):
            if value is None:
                raise ValueError(f"{name}: a solid needs its material: give --youngs MPa and --poisson")
        for name, faces in (("--base", self.base), ("--tip", self.tip)):
            if not faces:
                raise ValueError(f"{name}: which face? `validate show {self.solid}` draws them numbered")
        if not 1e-3 <= self.accuracy <= 20.0:
            raise ValueError(f"--accuracy: {self.accuracy:g} % must be from 0.001 to 20")
        if not 1e-6 <= self.unit_mm <= 1e6:
            raise ValueError(f"--unit-mm: {self.unit_mm:g} must be above 0: 1000 for metres, 25.4 for inches")
        if self.largest < 3000:
            raise ValueError(f"--largest: {self.largest} unknowns are no mesh: give 3000 or more")
        assert self.youngs is not None
        assert self.poisson is not None
        return SolidTask(
            path=self.solid,
            material=IsotropicMaterial(self.youngs, self.poisson, 1e-9 * (self.density or 0.0)),
            base=self.base,
            tip=self.tip,
            at=None if self.at is None else numbers(self.at, 3, "--at", "x,y,z in mm"),
            held=self.base_held,
            unit_mm=self.unit_mm,
            accuracy=0.01 * self.accuracy,
            largest=self.largest,
        )

    @property
    def others_given(self) -> bool:
        """Whether options of a part are given that only go with ``--solid``."""
        return bool(self.youngs or self.poisson or self.base or self.tip)


def numbers(text: str, count: int, option: str, form: str) -> Array:
    """Numbers ``(count,)`` from a text with commas.

    Raises:
        ValueError: they are none, or another count.
    """
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (count,) or not np.isfinite(values).all():
        raise ValueError(f"{option}: '{text}' is not {form}")
    return values
