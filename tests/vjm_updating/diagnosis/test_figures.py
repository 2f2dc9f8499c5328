"""The figures of a diagnosis draw each ramp over what was imposed on it."""

import numpy as np
import pytest
from helpers.command import validate
from helpers.file_texts import instruments_text, table_text
from helpers.small_machines import clamped_bar

from vjm_updating import load_data
from vjm_updating.diagnosis import figures
from vjm_updating.diagnosis.kinds import kind_of

EI, LENGTH = 1e9, 400.0
SHEET = (
    table_text("test", model="bar.toml", control="force")
    + instruments_text(fy_N=(0.05,), fz_N=(0.05,), uy_mm=(0.002,), uz_mm=(0.002,))
    + table_text("tolerance", modulus_rel=0.02)
)
WAY = np.concatenate([np.linspace(0.1, 1.0, 10), np.linspace(0.9, -1.0, 19), np.linspace(-0.9, -0.1, 9)])
FY, FZ = 30.0 * WAY, 80.0 * WAY


@pytest.fixture
def two_ramps(tmp_path):
    """A bar loaded along y, then along z: it deflects by F L³ / (3 EI), 1.3 times that along z, which is soft."""
    still = np.zeros(len(WAY))
    fy, fz = np.concatenate([FY, still]), np.concatenate([still, FZ])
    slope, rng = LENGTH**3 / (3.0 * EI), np.random.default_rng(2)
    uy, uz = (slope * by * force + 0.002 * rng.standard_normal(len(fy)) for by, force in ((1.0, fy), (1.3, fz)))
    rows = ["posture,fy_N,fz_N,uy_mm,uz_mm", *(f"bench,{a},{b},{c},{d}" for a, b, c, d in zip(fy, fz, uy, uz))]  # noqa: B905
    (tmp_path / "bar.toml").write_text(clamped_bar(LENGTH, EI))
    (tmp_path / "sheet.toml").write_text(SHEET)
    (tmp_path / "readings.csv").write_text("\n".join(rows) + "\n")
    return tmp_path / "readings.csv", tmp_path / "sheet.toml"


def test_each_ramp_has_a_panel_over_its_own_load(two_ramps):
    measurement = load_data(*two_ramps).test
    observed = kind_of(measurement).observe(measurement)
    y, z = figures.panels_of(observed)
    assert (y.driven, observed.columns[y.read]) == ("fy_N", "uy_mm")
    assert (z.driven, observed.columns[z.read]) == ("fz_N", "uz_mm")
    np.testing.assert_allclose(observed.readings.values["fy_N"][y.on], FY)
    np.testing.assert_allclose(observed.readings.values["fz_N"][z.on], FZ)


@pytest.mark.slow
def test_no_row_is_drawn_at_a_load_of_zero(two_ramps, tmp_path, monkeypatch):
    """As the page draws them: the deflections of a ramp over the load that made them."""
    drawn = []
    kept = figures.drawing_of

    def seen(fig):
        for ax in fig.axes:
            for line in ax.get_lines():
                if line.get_label() in ("measured", "nominal model"):
                    drawn.append((line.get_label(), ax.get_xlabel(), ax.get_ylabel(), line.get_xydata().copy()))
        return kept(fig)

    monkeypatch.setattr(figures, "drawing_of", seen)
    out = tmp_path / "out"
    words = ["--sheet", str(two_ramps[1]), "--out", str(out), "--only", "link_compliance", "instrument_scale"]
    validate("diagnose", two_ramps[0], *words)
    panels = {(label, x, y): data for label, x, y, data in drawn}
    for force, axis, by in ((FY, "y", 1.0), (FZ, "z", 1.3)):
        data = panels["measured", f"f{axis}, N", f"u{axis}, mm"]
        np.testing.assert_allclose(np.sort(data[:, 0]), np.sort(force))
        # within five standard deviations of its noise
        np.testing.assert_allclose(data[:, 1], LENGTH**3 / (3.0 * EI) * by * data[:, 0], atol=0.01)
        nominal = panels["nominal model", f"f{axis}, N", f"u{axis}, mm"]
        np.testing.assert_allclose(nominal[:, 1], LENGTH**3 / (3.0 * EI) * nominal[:, 0], atol=0.01)
    assert len(panels) == 4
