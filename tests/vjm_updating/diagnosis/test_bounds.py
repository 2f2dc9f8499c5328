"""How far nuisances may be from the sheet's values before they are something else."""

from __future__ import annotations

import pytest

from vjm_updating.experiment import read_measurement
from vjm_updating.inference.forward import observe_ramps
from vjm_updating.inference.parameters import SHARE, nuisance_coordinates


@pytest.mark.parametrize("tolerance", [0.01, 0.2, 2.0])
def test_a_tight_sheet_does_not_keep_a_wrong_length_from_being_found(make, tmp_path, monkeypatch, tolerance):
    files = make.made_up(tmp_path, {}, 1, monkeypatch, per=6, postures=("A",))
    files.sheet.write_text(files.sheet.read_text().replace("link_length_mm = 0.2", f"link_length_mm = {tolerance}"))
    observed = observe_ramps(read_measurement(files.data, files.sheet))
    (length,) = [c for c in nuisance_coordinates(observed) if c.kind == "length"]
    (whole,) = [b.length for b in observed.measurement.chain.beams if b.name == length.subject]
    # in mm; sixty of the sheet's sigmas where that is more
    assert length.high * length.scale == pytest.approx(max(SHARE * whole, 60.0 * tolerance))
    assert length.low == -length.high
