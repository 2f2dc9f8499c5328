"""A small test of the library's chain that every test here takes apart: its readings are the model's own."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from helpers.file_texts import instruments_text, table_text

from vjm.continuation.load_grid import trace_grid
from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm_updating.experiment import Measurement, read_measurement

SHEET = (
    table_text("test", title="two postures pushed", model="orthoglide-chain")
    + table_text("model", link_segments=8)
    + table_text("postures", A=[0.0, 0.0, 0.0, 0.0], B=[0.0, 0.5235987755982988, -0.5235987755982988, 0.0])
    + instruments_text(ux_mm=(0.001, 0.002, 0.001), fx_N=(2.0, 3.0, 0.003), mx_Nmm=(50.0,))
    + table_text("tolerance", link_length_mm=0.2, modulus_rel=0.02)
)
HEADER = "time_s,posture,ux_mm,fx_N,mx_Nmm"
REACH = {"A": 2.0, "B": 6.0}


@cache
def table() -> tuple[tuple[str, ...], ...]:
    """Cells of twelve readings a posture, squeezed."""
    rows = []
    for posture, reach in REACH.items():
        problem = VjmEngine(8).problem(load_chain("orthoglide-chain"), LoadCase(posture, -reach))
        found = trace_grid(problem, np.linspace(0.0, reach, 13))
        for s, wrench in zip(found.s, found.wrench, strict=True):
            cells = (f"{float(len(rows))}", posture, f"{-s:.4f}", f"{wrench[0]:.3f}", f"{wrench[3]:.2f}")
            rows.append(cells)
    return tuple(rows)


@dataclass
class Draft:
    """A data file and a sheet, to be spoilt before they are read."""

    folder: Path
    header: list[str]
    rows: list[list[str]]
    sheet: str = SHEET

    def column(self, name: str, change: Callable[[str], str], posture: str = "") -> None:
        """Change the cells of a column, of one posture or of all."""
        at = self.header.index(name)
        for row in self.rows:
            if not posture or row[self.header.index("posture")] == posture:
                row[at] = change(row[at])

    def write(self) -> tuple[Path, Path]:
        """The two files."""
        data, sheet = self.folder / "data.csv", self.folder / "sheet.toml"
        lines = [",".join(cells) for cells in [self.header, *self.rows]] if self.header else []
        data.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")
        sheet.write_text(self.sheet, encoding="utf-8")
        return data, sheet

    def read(self) -> Measurement:
        """What the files say."""
        return read_measurement(*self.write())

    def refused(self) -> str:
        """Why the files are refused."""
        with pytest.raises(ValueError) as caught:
            self.read()
        message = str(caught.value)
        assert "\n" not in message
        return message


@pytest.fixture
def draft(tmp_path: Path) -> Draft:
    return Draft(tmp_path, HEADER.split(","), [list(row) for row in table()])


def times(factor: float) -> Callable[[str], str]:
    """A cell in another unit."""
    return lambda cell: repr(float(cell) * factor)
