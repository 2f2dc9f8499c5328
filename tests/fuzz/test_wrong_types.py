"""A value of another type at any key of any file: one line that names the file and the key, and status 2."""

import copy
import re
import tomllib
from collections.abc import Callable, Iterator
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pydantic
import pytest
from helpers.command import refused
from helpers.file_texts import instruments_text, model_text, part_text, section_of, stiffness_of, table_text

from fuzz.harness import prepare
from vjm.io import solid_provider
from vjm.io.file_parameters import MachineFiles
from vjm.io.files import toml_text
from vjm.io.machine_file import load_model
from vjm.io.model_file import parsed
from vjm.io.model_plausibility import findings_of
from vjm_output.terminal import one_line
from vjm_updating import load_data
from vjm_updating.identify.experiments import build_path
from vjm_validation.verification.library import read_case

Place = tuple[str | int, ...]

# what stands behind @ is written without quotes: TOML has dates, and no file here has
VALUES: dict[str, Any] = {
    "table": {"a": 1},
    "empty table": {},
    "list": ["x"],
    "text": "word",
    "number": -7.25,
    "huge": 10**400,
    "true": True,
    "date": "@2026-01-01",
}

MODELS = resources.files("vjm").joinpath("models")
EXAMPLES = resources.files("vjm_validation").joinpath("examples")
TEMPLATES = resources.files("vjm_validation").joinpath("cli", "templates")
CASES = resources.files("vjm_validation").joinpath("cases")

ARM = model_text(
    "arm",
    part_text("actuated", "drive", axis="z", compliance_rad_per_Nmm=1e-8),
    part_text("beam", "boom", length_mm=500.0, section=section_of("square_tube", 60.0, 4.0, density=2700.0)),
    postures={"A": {"drive": 0.0}, "B": {"drive": 1.0}},
)

TEST = '[test]\ntitle = "a test"\nmodel = "arm.toml"\nsource = "bench"\n'
CHANNELS = (
    table_text("model", link_segments=2)
    + table_text("postures", A={"drive": 0.0}, C={"drive": 0.5})
    + table_text("points.mid", body="boom", at=0.5, source="dial")
    + table_text("tolerance", link_length_mm=0.1, modulus_rel=0.02, source="drawing")
)
INSTRUMENTS = table_text(
    "instrument.ux_mm", noise=0.001, zero=0.001, scale=0.001, source="dial"
) + instruments_text(uy_mm=(0.001,), fy_N=(0.1,), temperature_C=(0.1,))
MARKERS = table_text("joints", q="drive") + table_text(
    "markers.m", on="boom", position_mm=[0.0, 0.0, 10.0], sigma_mm=5.0, source="drawing"
)
PATH = model_text(
    "path",
    table_text(
        "[pieces]",
        length_mm=100.0,
        source="drawing",
        turns=[{"turn_about": "z", "angle_deg": 30.0}],
        section=stiffness_of(1e7, 1e9, 1e9, 1e9),
        end_section=stiffness_of(2e7, 2e9, 2e9, 2e9),
    ),
)
STEPS = range(8)
SHEETS = {
    "ramps": (
        TEST + 'control = "displacement"\n' + CHANNELS + INSTRUMENTS,
        ["posture,ux_mm,uy_mm,fy_N,temperature_C", *(f"A,0,{0.01 * k:.3f},{2.9 * k:.2f},20" for k in STEPS)],
    ),
    "loads": (
        TEST + 'control = "force"\nheld = ["rx"]\ngravity = [0.0, 0.0, -9.81]\n' + CHANNELS + INSTRUMENTS,
        ["posture,ux_mm,uy_mm,fy_N,temperature_C", *(f"A,0,{0.01 * k:.3f},{2.9 * k:.2f},20" for k in STEPS)],
    ),
    "column": (
        '[test]\ntitle = "a test"\nmodel = "pinned-column"\ncontrol = "mid.uy_mm"\nsource = "bench"\n'
        '[postures]\nA = [0.0, 0.0]\n[points.mid]\nbody = "link"\nat = 0.5\n'
        '[instrument."mid.uy_mm"]\nnoise = 0.01\nheld = "target"\n[instrument.fx_N]\nnoise = 0.1\nscale = 0.001\n',
        ["posture,mid.uy_mm,fx_N", *(f"A,{0.5 * k:.2f},{-200 - 5 * k}" for k in STEPS)],
    ),
    "joint": (
        'kind = "joint"\n' + TEST + 'joint = "drive"\n'
        "[lever]\nforce_mm = 300.0\ngauge_mm = 250.0\nsource = 'tape'\n"
        "[instrument.deflection_mm]\nnoise = 0.001\n[instrument.force_N]\nnoise = 0.1\nzero = 0.1\n",
        ["force_N,deflection_mm", *(f"{10.0 * k},{7.5e-3 * k}" for k in STEPS)],
    ),
    "frequencies": (
        'kind = "frequencies"\n' + TEST + "[frequencies]\nnoise_Hz = 0.1\nnoise_rel = 0.001\nmissing = 1\n"
        'source = "tap"\n[payload]\non = "boom"\nposition_mm = [0.0, 0.0, 0.0]\nmass_kg = 1.0\nsource = "scale"\n'
        "[tolerance]\nmass_rel = 0.1\n",
        ["posture,f1_Hz", "A,30.0", "B,30.1"],
    ),
    "poses": (
        'kind = "poses"\n' + TEST + 'rigid = false\ngravity = [0.0, 0.0, -9.81]\norder = "as taken"\n'
        'joints = "measured"\nencoders = "motor"\n' + MARKERS + 'orientation = "none"\n'
        "[tracker]\nnoise_mm = 0.02\nnoise_rad = 1e-4\nsource = 'tracker'\n"
        "[base]\nposition_mm = [0.0, 0.0, 0.0]\nsigma_mm = 10.0\nsigma_rad = 0.1\n"
        'turns = [{ turn_about = "z", angle_deg = 0.0 }]\n',
        [
            "q.q_rad,m.x_mm,m.y_mm,m.z_mm",
            *(f"{q:.2f},{500 * np.cos(q):.3f},{500 * np.sin(q):.3f},10.0" for q in np.linspace(-1, 1, 6)),
        ],
    ),
    "deflections": (
        'kind = "deflections"\n' + TEST + "gravity = [0.0, 0.0, -9.81]\n"
        '[joints]\nq = "drive"\n[loads.tool]\non = "boom"\nposition_mm = [0.0, 0.0, 0.0]\naxes = "tool"\n'
        'turns = [{ turn_about = "z", angle_deg = 0.0 }]\nsource = "cell"\n'
        + MARKERS.split("\n", 2)[2]
        + "[tracker]\nnoise_mm = 0.005\nnoise_mm_per_N = 1e-5\nnoise_mm_per_Nmm = 0.0\nnoise_rad = 1e-5\n"
        'noise_rad_per_N = 0.0\nnoise_rad_per_Nmm = 0.0\naxes = "own"\nsigma_rad = 0.01\nsource = "dial"\n',
        [
            "q.q_rad,tool.fx_N,tool.fy_N,tool.fz_N,m.dx_mm,m.dy_mm,m.dz_mm",
            *(f"{q:.2f},0,{50 + 10 * q:.1f},0,0,{0.15 + 0.03 * q:.4f},0" for q in np.linspace(-1, 1, 6)),
        ],
    ),
}
"""Every key of every kind of test, with readings of an arm."""


def places(content: Any, before: Place = ()) -> Iterator[Place]:
    """Every key and, of a list, its first two entries."""
    if isinstance(content, dict | list):
        for key, value in content.items() if isinstance(content, dict) else list(enumerate(content))[:2]:
            yield (*before, key)
            yield from places(value, (*before, key))


def changed(content: dict[str, Any], place: Place, value: object) -> dict[str, Any]:
    result = copy.deepcopy(content)
    at: Any = result
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    return result


def wrong_answers(content: dict[str, Any], file: Path, load: Callable[[Path], object]) -> tuple[int, list[str]]:
    """How many values were refused, and what is wrong with answers."""
    refused, found = 0, []
    for place in dict.fromkeys([*places(content), ("kind",)]):
        at: Any = content
        for key in place:
            at = at.get(key, "") if isinstance(at, dict) else at[key]
        for name, value in VALUES.items():
            if type(value) is type(at) and name != "date":
                continue
            text = toml_text(changed(content, place, value))
            file.write_text(re.sub(r'"@([-:\d]+)"', r"\1", text), encoding="utf-8")
            try:
                load(file)
            except pydantic.ValidationError as error:
                found.append(f"{place} {name}: raw {one_line(error)}")
            except (ValueError, OSError) as error:
                refused += 1
                said, words = str(error), [str(key).rstrip("s") for key in place if isinstance(key, str)]
                named = any(word in said for word in words) and file.name in said
                if "\n" in said or "Input should" in said or not named:
                    found.append(f"{place} {name}: {said}")
            except Exception as error:
                found.append(f"{place} {name}: {type(error).__name__} {error}")
    return refused, found


@pytest.mark.parametrize("kind", SHEETS)
def test_every_key_of_a_sheet(kind, tmp_path):
    sheet, readings = SHEETS[kind]
    (tmp_path / "arm.toml").write_text(ARM, encoding="utf-8")
    data = tmp_path / "readings.csv"
    data.write_text("\n".join(readings) + "\n", encoding="utf-8")
    file = tmp_path / "sheet.toml"
    content = tomllib.loads(sheet)
    file.write_text(toml_text(content), encoding="utf-8")
    assert load_data(data, file).kind == kind  # as it is, the sheet is sound
    refused, found = wrong_answers(content, file, lambda path: load_data(data, path))
    assert found == []
    assert refused > 5 * len(list(places(content)))


def judged(file: Path) -> None:
    """All ways in which commands read a model: what it is, what is doubtful, and its numbers to be changed."""
    answers = []
    for read in (load_model, findings_of, lambda path: MachineFiles.read(path).machine()):
        try:
            read(file)
        except pydantic.ValidationError:
            raise
        except ValueError as error:
            answers.append(error)
    if answers:
        raise answers[0]


def sources() -> dict[str, str]:
    models = {
        name: MODELS.joinpath(f"{name}.toml").read_text("utf-8") for name in ("planar-2r", "orthoglide-chain")
    }
    models["hexapod"] = MODELS.joinpath("machines", "hexapod.toml").read_text("utf-8")
    models["four-bar"] = TEMPLATES.joinpath("bodies.toml").read_text("utf-8").replace("NAME", "four-bar")
    models["bracket-arm"] = EXAMPLES.joinpath("parts", "bracket-arm.toml").read_text("utf-8")
    return models


@pytest.mark.slow
@pytest.mark.parametrize("name", sources())
def test_every_key_of_a_model(name, tmp_path, monkeypatch):
    prepare(tmp_path)
    for chain in MODELS.joinpath("machines", "chains").iterdir():
        (tmp_path / chain.name).write_bytes(chain.read_bytes())
    (tmp_path / "l-bracket.step").write_text("a drawing", encoding="utf-8")

    def computed(*_: object) -> object:
        raise ValueError(f"{name}.toml: {' '.join(map(str, content))} parts compliance")

    monkeypatch.setattr(solid_provider, "_computers", [computed])
    content = tomllib.loads(sources()[name])
    refused, found = wrong_answers(content, tmp_path / f"{name}.toml", judged)
    # a value of a right type may stand where it says another machine, whose loops do not close
    assert [one for one in found if "does not close" not in one] == []
    assert refused > 5 * len(list(places(content)))


def test_every_key_of_a_beam_path_and_of_a_verification_case(tmp_path):
    path = tmp_path / "path.toml"
    path.write_text(PATH, encoding="utf-8")

    def identified(file: Path) -> None:
        build_path(parsed(file.name, file.read_bytes()).content, file.name)

    def case(file: Path) -> None:
        read_case(file.name, file.read_bytes())

    for text, name, load in (
        (PATH, "path.toml", identified),
        (CASES.joinpath("arch-120.toml").read_text("utf-8"), "arch-120.toml", case),
    ):
        content = tomllib.loads(text)
        load_sound = tmp_path / name
        load_sound.write_text(toml_text(content), encoding="utf-8")
        load(load_sound)
        refused, found = wrong_answers(content, load_sound, load)
        assert found == []
        assert refused > 5 * len(list(places(content)))


@pytest.mark.slow
def test_the_command_says_one_line_and_status_2(tmp_path):
    (tmp_path / "arm.toml").write_text(ARM, encoding="utf-8")
    model = tmp_path / "broken.toml"
    model.write_text(ARM.replace("length_mm = 500.0", 'length_mm = ["500"]'), encoding="utf-8")
    sheet = tmp_path / "sheet.toml"
    sheet.write_text("kind = { a = 1 }\n" + SHEETS["ramps"][0], encoding="utf-8")
    data = tmp_path / "readings.csv"
    data.write_text("\n".join(SHEETS["ramps"][1]) + "\n", encoding="utf-8")
    test = [str(data), "--sheet", str(sheet), "--out", str(tmp_path / "out")]
    of_model = "broken.toml: part 'boom': length_mm must be a number, got ['500']"
    of_sheet = (
        'sheet.toml: kind must be one of "joint", "poses", "deflections", "frequencies", '
        "or be left out for ramps and columns, got {'a': 1}"
    )
    commands = {
        **{(name, str(model)): of_model for name in ("check", "stiffness", "explore", "modes", "buckling", "show")},
        ("curve", str(model), "--to", "1"): of_model,
        ("map", str(model), "--grid", "drive=0:1:2", "--out", str(tmp_path / "out")): of_model,
        ("sensitivity", str(model), "--of", "mass"): of_model,
        ("sweep", str(model), "--vary", "boom.length_mm=400:500:2", "--of", "mass"): of_model,
        ("optimise", str(model), "--vary", "boom.length_mm=400:500", "--minimise", "mass"): of_model,
        ("calibrate", *test): of_sheet,
        ("diagnose", *test): of_sheet,
        ("simulate", str(tmp_path / "arm.toml"), "--test", str(sheet), "--hide", "link_bow"): of_sheet,
    }
    for command, expected in commands.items():
        said = refused(*command)
        assert said.removeprefix("validate: ").replace("toml:14:", "toml:") == expected, command
    assert not (tmp_path / "out").exists()
