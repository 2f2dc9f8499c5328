"""A compliance from a drawing in a model file: what is kept, when it is computed again, what is refused."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from vjm.io import solid_provider
from vjm.io.model_file import ModelFileError, load_chain
from vjm.io.solid_compliance import SolidResult

EXAMPLES = Path(__file__).parents[3] / "validation/vjm_validation/examples/parts"
FORM = np.diag([1e-4, 1e-2, 1e-2, 1e-5, 1e-5, 1e-5])[np.triu_indices(6)].tolist()
C = np.diag([1e-5, 4e-5, 4e-5, 1e-9, 1e-9, 1e-9])


@pytest.fixture
def folder(tmp_path):
    for name in ("bracket-arm.toml", "l-bracket.step"):
        shutil.copy(EXAMPLES / name, tmp_path)
    return tmp_path


@pytest.fixture
def calls(monkeypatch):
    """Stands for the finite elements, and counts."""
    made = []

    def compute(path, table):
        made.append((path.name, table.tip_moves))
        return SolidResult(
            drawing=path.name, compliance=C.tolist(), interval=np.zeros((6, 6)).tolist(),
            reach_mm=[-95.0, 0.0, 65.0], unknowns=1, bodies=1, buckling_N=None,
            volume_mm3=34000.0, centre_of_mass_mm=[-60.0, 0.0, 15.0],
            thickness_mm=9.0, stress_at_mm=[[-50.0, 0.0, 0.0]], stress_forms=[FORM],
        )  # fmt: skip

    monkeypatch.setattr(solid_provider, "_computers", [compute])
    return made


def change(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


def test_computed_once_and_kept_by_content(folder, calls):
    for _ in range(2):
        (beam,) = load_chain(folder / "bracket-arm.toml").beams
        assert beam.compliance == pytest.approx(C)
    assert calls == [("l-bracket.step", "rigid")]
    # what the matrix does not depend on
    shutil.copy(folder / "l-bracket.step", folder / "copy.step")
    change(folder / "bracket-arm.toml", 'title = "A', 'title = "The')
    load_chain(folder / "bracket-arm.toml")
    assert len(calls) == 1
    # and what it does: a setting, the drawing
    change(folder / "bracket-arm.toml", "poissons_ratio = 0.33", "poissons_ratio = 0.3")
    load_chain(folder / "bracket-arm.toml")
    assert len(calls) == 2
    change(folder / "l-bracket.step", "l-bracket", "m-bracket")
    load_chain(folder / "bracket-arm.toml")
    assert len(calls) == 3


def test_a_spoilt_file_is_computed_again(folder, calls):
    load_chain(folder / "bracket-arm.toml")
    (kept,) = folder.glob("l-bracket.step.*.json")
    kept.write_text(json.dumps(json.loads(kept.read_text()) | {"key": "another"}))
    load_chain(folder / "bracket-arm.toml")
    kept.write_text("{")
    load_chain(folder / "bracket-arm.toml")
    assert len(calls) == 3


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('from = "l-bracket.step"', 'from = "absent.step"', "part 'bracket': compliance: from = 'absent.step'"),
        ("poissons_ratio = 0.33", "poissons_ratio = 0.5", "poissons_ratio"),
        (
            "poissons_ratio = 0.33",
            "poisons_ratio = 0.3",
            "unknown key 'poisons_ratio'; did you mean 'poissons_ratio'?",
        ),
        ("length_mm = 95.0", "length_mm = 90.0", "the drawing's tip lies at [-95, 0, 65] mm from its base"),
    ],
)
def test_bad_tables(folder, calls, old, new, words):
    change(folder / "bracket-arm.toml", old, new)
    with pytest.raises(ModelFileError) as caught:
        load_chain(folder / "bracket-arm.toml")
    assert words in str(caught.value)
    assert str(caught.value).startswith("bracket-arm.toml: ")


def test_without_anybody_to_compute(folder, monkeypatch):
    monkeypatch.setattr(solid_provider, "_computers", [])
    with pytest.raises(ModelFileError, match="run `validate check` on this file"):
        load_chain(folder / "bracket-arm.toml")
