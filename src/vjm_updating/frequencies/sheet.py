"""The sheet of a test of ``kind = "frequencies"``: the machine, its postures, how well frequencies are read."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from vjm.io.fields import VectorMM
from vjm.io.schema import Label
from vjm.io.sections import Table
from vjm_updating.constants import physical_bound
from vjm_updating.experiment.sheet import Sheet, read_sheet_of
from vjm_updating.experiment.source import SheetSource

MOST_MISSING = physical_bound(4)
"""Modes that may not have been seen: beyond it the pairing says more than the readings."""


class FrequencyTable(Table):
    """How frequencies were read; a standard deviation has a fixed part and one in proportion."""

    noise_Hz: Annotated[float, Field(gt=0.0, le=1e3)] = Field(  # noqa: N815
        description="1 sigma of a frequency whose column fK_std_Hz is blank or absent"
    )
    noise_rel: Annotated[float, Field(ge=0.0, le=0.1)] = Field(0.0, description="1 sigma more, of its value")
    missing: int = Field(
        0, ge=0, le=MOST_MISSING,
        description="modes below the highest one read that may not have been seen in a posture; "
        "0: column fK_Hz is mode K",
    )  # fmt: skip
    source: str = ""


class CarriedTable(Table):
    """A point mass that the machine carries in the test and the model does not have, such as the sensor."""

    on: Label | Literal[""] = Field("", description="part behind which it is; empty: the last one")
    position_mm: VectorMM = Field([0.0, 0.0, 0.0], description="in the frame behind that part")
    mass_kg: float = Field(0.0, ge=0.0, le=1e5, description="where the column payload_kg is absent")
    source: str = ""


class FrequencySheet(Sheet):
    """The sheet."""

    kind: Literal["frequencies"]
    frequencies: FrequencyTable
    payload: CarriedTable = CarriedTable()

    @model_validator(mode="after")
    def _without_loads(self) -> FrequencySheet:
        if self.test.control != "displacement" or self.test.held:
            raise ValueError("[test] control and held are for tests by loads: leave them out, the end is free")
        for name in ("instrument", "points", "lever"):
            if name in self.model_fields_set:
                raise ValueError(f"[{name}] is for tests by loads: leave it out, [frequencies] has the noise")
        return self


def read_frequency_sheet(sheet: SheetSource) -> FrequencySheet:
    """A sheet of frequencies from its file or its content.

    Raises:
        SheetError: no such file, no TOML, or no sheet of frequencies; one line.
    """
    return read_sheet_of(sheet, FrequencySheet)
