"""Deflections of a robot whose model deflects: another unit is said where the size speaks for it."""

import pytest
from hidden_effects.poses import deflections
from hidden_effects.poses.robots import UR10, document

from vjm.io.files import toml_text
from vjm_updating import load_data

SHEET_COMPLIANCE, ROUGHLY = 1e-9, 2.6e-8
"""rad/(N mm) of the file, and what the injector's joints have in the mean."""


@pytest.mark.parametrize(
    ("factor", "words"), [(1.0, ""), (1 / 25.4, "displacements in inches"), (0.1, "displacements in cm")]
)
def test_another_unit_of_all_displacements_is_said_as_possible(factor, words, tmp_path):
    data, sheet = deflections.write(0, tmp_path)[1]
    stated = toml_text(document(UR10)).replace(str(SHEET_COMPLIANCE), str(ROUGHLY))
    (tmp_path / "model.toml").write_text(stated, encoding="utf-8")
    sheet.write_text(sheet.read_text().replace("rigid = true", ""), encoding="utf-8")
    header, *rows = data.read_text().splitlines()
    seen = [k for k, name in enumerate(header.split(",")) if name.startswith("target.d")]
    lines = [header]
    for row in rows:
        cells = row.split(",")
        for k in seen:
            cells[k] = repr(factor * float(cells[k]))
        lines.append(",".join(cells))
    data.write_text("\n".join(lines) + "\n", encoding="utf-8")
    said = [str(one) for one in load_data(data, sheet).considered() if "another unit" in str(one)]
    assert len(said) == bool(words)
    assert all(words in line for line in said)
