"""What a command cannot write is said before it computes anything, and nothing is left behind."""

from __future__ import annotations

import importlib

import pytest

from vjm.io import solid_provider
from vjm_validation.cli.main import run

ARM, WRENCH = "planar-2r", ["--wrench", "0,-50,0,0,0,0"]
LATER = "computed all the same"
COMMANDS = {
    "curve": ("vjm.engines.VjmEngine.trace", ["curve", "orthoglide-chain", "--to", "-1"], ("--csv", "--report")),
    "buckling": ("vjm.engines.VjmEngine.trace", ["buckling", "orthoglide-chain"], ("--plot", "--report")),
    "stiffness": ("vjm.analysis.under_wrench", ["stiffness", ARM, *WRENCH], ("--plot", "--report")),
    "modes": ("vjm.design.modes.eigenmodes", ["modes", ARM], ("--plot", "--report")),
    "sensitivity": (
        "vjm_validation.cli.design.sensitivities",
        ["sensitivity", ARM, "--posture", "bent", *WRENCH],
        ("--plot", "--report"),
    ),
    "sweep": (
        "vjm_validation.cli.design._computed",
        ["sweep", ARM, "--vary", "upper.length_mm=400:600:2", *WRENCH],
        ("--csv", "--report"),
    ),
    "optimise": (
        "vjm_validation.cli.design.best_machine",
        ["optimise", ARM, "--minimise", "mass", "--vary", "upper.length_mm=400:600"],
        ("--out",),
    ),
    "compensate": (
        "vjm_validation.cli.equilibrium.compensation",
        ["compensate", ARM, "PATH"],
        ("--out", "--report"),
    ),
    "map": ("vjm_validation.cli.map.run_map", ["map", ARM, "--grid", "elbow=0:1:2"], ("--plot", "--report")),
    "show": ("vjm_validation.report.machine_view.geometry", ["show", ARM], ("--out",)),
    "export": ("vjm.io.robot_text.urdf_text", ["export", "ur10"], ("--urdf", "--mjcf")),
}
"""What a command computes, its words, and options that name files."""
ENDINGS = {"--csv": "csv", "--plot": "png", "--report": "html", "--urdf": "urdf", "--mjcf": "xml"}
OUT = {"optimise": "toml", "compensate": "csv", "show": "html"}


def never(*_: object, **__: object) -> object:
    raise AssertionError(LATER)


@pytest.fixture
def quiet(monkeypatch):
    def without(command):
        place = COMMANDS[command][0]
        owner, name = place.rsplit(".", 1)
        try:
            module = importlib.import_module(owner)
        except ImportError:
            package, kind = owner.rsplit(".", 1)
            module = getattr(importlib.import_module(package), kind)
        monkeypatch.setattr(module, name, never)

    return without


@pytest.mark.parametrize("command", COMMANDS)
def test_files_that_cannot_be_written_are_refused_first(command, tmp_path, capsys, quiet):
    quiet(command)
    _, words, options = COMMANDS[command]
    (tmp_path / "file").write_text("no folder")
    (tmp_path / "path.csv").write_text("x_mm,y_mm,z_mm\n600,300,0\n")
    words = [str(tmp_path / "path.csv") if word == "PATH" else word for word in words]
    for option in options:
        ending = ENDINGS.get(option, OUT.get(command))
        below, folder = tmp_path / "file" / f"x.{ending}", tmp_path / f"folder.{ending}"
        folder.mkdir(exist_ok=True)
        for place, said in ((below, "a folder is needed there"), (folder, "give the name of a file")):
            more = ["--force"] if command == "export" else []
            assert run([*words, f"{option}={place}", *more]) == 2, (option, place)
            error = capsys.readouterr().err
            assert said in error
            assert LATER not in error
    # one file is not two
    if len(options) == 2 and "--csv" not in options:
        ending = "html" if command == "export" else "png"
        twice = [f"{option}={tmp_path / f'x.{ending}'}" for option in options]
        if command not in ("compensate",):
            assert run([*words, *twice]) == 2
            assert "give another name" in capsys.readouterr().err
    left = {path.name for path in tmp_path.iterdir()} - {f"folder.{e}" for e in (*ENDINGS.values(), "toml")}
    assert left == {"file", "path.csv"}


@pytest.mark.parametrize("command", ["calibrate", "diagnose", "simulate"])
def test_the_folder_of_a_test_is_tried_before_its_files_are_read(command, tmp_path, capsys):
    (tmp_path / "file").write_text("no folder")
    out = ["--out", str(tmp_path / "file" / "out")]
    missing = str(tmp_path / "missing.csv")
    words = (
        [ARM, "--test", missing, "--hide", "link_bow"] if command == "simulate" else [missing, "--sheet", missing]
    )
    assert run([command, *words, *out]) == 2
    assert "a folder is needed there" in capsys.readouterr().err
    # and a folder that can be made is not made for a test that is refused
    assert run([command, *words, "--out", str(tmp_path / "new")]) == 2
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("key", ["source", "title", "name", "units", "postures"])
def test_a_model_without_a_key_is_refused_before_its_drawing_is_computed(key, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(solid_provider, "_computers", [never])
    lines = {
        "format": "format = 1",
        "name": 'name = "bracket"',
        "title": 'title = "bracket"',
        "source": 'source = "test"',
        "units": 'units = { length = "mm", force = "N", angle = "rad" }',
        "postures": "postures = { home = [] }",
    }
    part = (
        '[[parts]]\nkind = "beam"\nname = "foot"\nlength_mm = 95.0\n'
        'compliance = { from = "foot.step", youngs_modulus_MPa = 7e4, poissons_ratio = 0.33, '
        'base = "a", tip = "b" }\n'
    )
    (tmp_path / "foot.step").write_text("a drawing")
    model = tmp_path / "bracket.toml"
    model.write_text("\n".join(line for name, line in lines.items() if name != key) + "\n" + part)
    for words in (["check"], ["stiffness"], ["sensitivity", "--of", "mass"], ["modes"]):
        assert run([words[0], str(model), *words[1:]]) == 2
        said = capsys.readouterr().err
        assert f"{key} is missing: add it" in said
        assert "bracket.toml" in said
