"""What is kept is shown again only where all that it was made of is the same; damage is named, or computed anew."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from importlib.resources import files

import numpy as np
import pytest
from helpers.command import refused, validate

from vjm.design import sweep
from vjm.io import provenance, solid_provider
from vjm.io.machine_file import load_model
from vjm.io.provenance import Provenance
from vjm.io.solid_compliance import SolidResult
from vjm_updating.maps import run as maps

MODELS, EXAMPLES = files("vjm") / "models", files("vjm_validation") / "examples"
FOOT = "compliance = [\n  [ 28e-5,"


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """The Orthoglide with its leg's file beside it, whose foot is a drawing of the printed compliance."""
    text = (MODELS / "manipulators/orthoglide.toml").read_text().replace('"orthoglide-chain"', '"leg"')
    (tmp_path / "machine.toml").write_text(text)
    leg = (MODELS / "orthoglide-chain.toml").read_text()
    first = leg.index(FOOT)
    last = leg.index("]\n\n", first) + 1
    material = "youngs_modulus_MPa = 7e4, poissons_ratio = 0.33"
    drawn = f'compliance = {{ from = "foot.step", {material}, base = "1", tip = "2" }}'
    (tmp_path / "leg.toml").write_text(leg[:first] + drawn + leg[last:])
    (tmp_path / "foot.step").write_text("a drawing\n")
    beam = load_model("orthoglide-chain").beams[0]

    def compute(path, table):
        # stiffer by a hundredth where the drawing says so
        compliance = beam.compliance / (1.01 if "stiffer" in path.read_text() else 1.0)
        return SolidResult(
            drawing=path.name, compliance=compliance.tolist(), interval=np.zeros((6, 6)).tolist(),
            reach_mm=(beam.own_frame.T @ beam.tip).tolist(), unknowns=1, bodies=1, buckling_N=None, volume_mm3=1e5,
            centre_of_mass_mm=[50.0, 50.0, 0.0], thickness_mm=9.0, stress_at_mm=[], stress_forms=[],
        )  # fmt: skip

    monkeypatch.setattr(solid_provider, "_computers", [compute])
    return tmp_path / "machine.toml"


def words_of(command, machine):
    out = machine.parent / "out"
    match command:
        case "sweep":
            vary = ["--vary", "leg.link.section.EA_N=6e6:7e6:2", "--wrench", "10,0,0,0,0,0", "--segments", "2"]
            return ["sweep", str(machine), *vary, "--of", "deflection", "--csv", str(out / "sweep.csv"), "--json"]
        case "map":
            grid = ["--grid", "x=0:10:2,y=0,z=0", "--engine", "vjm-2", "--jobs", "1"]
            return ["map", str(machine), *grid, "--wrench", "10,0,0", "--out", str(out), "--json"]
    raise AssertionError(command)


def appended(name, text="\n# another\n"):
    def change(folder, words, monkeypatch):
        (folder / name).write_text((folder / name).read_text() + text)
        return words

    return change


def with_words(*more):
    return lambda folder, words, monkeypatch: [*words, *more]


def other(old, new):
    return lambda folder, words, monkeypatch: [new if word == old else word for word in words]


def patched(target, name, value):
    def change(folder, words, monkeypatch):
        monkeypatch.setattr(target, name, value)
        return words

    return change


INSTALLED = provenance.libraries()
BOTH = [
    (appended("machine.toml"), "machine.toml has changed"),
    (appended("leg.toml"), "leg leg.toml has changed"),
    (appended("foot.step", "stiffer\n"), "leg foot.step has changed"),
    (with_words("--gravity", "0,0,-9.81"), "gravity was null and is [0.0, 0.0, -9.81]"),
    (patched(provenance.vjm, "__version__", "9.9"), f"version was {provenance.vjm.__version__} and is 9.9"),
    (patched(provenance, "_sources", lambda: "0" * 64), "sources has changed"),
    (patched(provenance, "libraries", lambda: INSTALLED | {"numpy": "0"}), "and is 0"),
]
CHANGES = [
    *((command, *change) for command in ("sweep", "map") for change in BOTH),
    ("sweep", other("2", "3"), "engine was vjm-2 and is vjm-3"),
    ("sweep", with_words("--load", "x/foot@0.5:1,0,0"), "load was [] and is"),
    ("sweep", other("deflection", "deflection,mass"), 'of was ["deflection"] and is ["deflection", "mass"]'),
    ("map", other("vjm-2", "vjm-3"), "engine was vjm-2 and is vjm-3"),
    ("map", other("10,0,0", "10,0,1"), "wrench was"),
    ("map", other("x=0:10:2,y=0,z=0", "x=0:20:2,y=0,z=0"), "grid was"),
    ("map", with_words("--most", "10"), "most was 20000.0 and is 10.0"),
    ("map", with_words("--quantity", "deflection"), "quantity was stiffness and is deflection"),
]


def refuse_to_compute(monkeypatch):
    def never(task):
        raise AssertionError("computed anew")

    monkeypatch.setattr(maps, "evaluate", never)
    monkeypatch.setattr(sweep, "evaluated", never)


def contents(folder):
    return {file: file.read_bytes() for file in sorted(folder.rglob("*")) if file.suffix in (".csv", ".json")}


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize(("command", "change", "said"), CHANGES)
def test_each_input_that_changes_is_named_and_the_old_is_not_shown(machine, monkeypatch, command, change, said):
    words, out = words_of(command, machine), machine.parent / "out"
    first = validate(*words)
    kept = contents(out)
    with monkeypatch.context() as context:
        refuse_to_compute(context)
        again = validate(*words)
    assert again.out == first.out
    # the CSV and the records are as they were; pictures may be drawn again
    assert contents(out) == kept
    changed = validate(*change(machine.parent, words, monkeypatch), status=2)
    assert changed.out == ""
    (line,) = [line for line in changed.err.splitlines() if line.startswith("error") or said in line]
    assert said in line
    assert contents(out) == kept


def test_a_drawing_of_a_leg_that_changes_changes_the_answer(machine):
    words = [
        word for word in words_of("sweep", machine) if word not in ("--csv", str(machine.parent / "out/sweep.csv"))
    ]
    before, after = (
        json.loads(validate(*appended("foot.step", text)(machine.parent, words, None)).out)["rows"][0]["values"][0]
        for text in ("", "stiffer\n")
    )
    assert 0.9 * before < after < (1.0 - 1e-6) * before


def test_a_sweep_that_was_interrupted_equals_one_that_was_not(machine, monkeypatch):
    words = [word.replace("6e6:7e6:2", "6e6:7e6:7") for word in words_of("sweep", machine)]
    whole, csv = validate(*words), machine.parent / "out/sweep.csv"
    rows = csv.read_text()
    csv.unlink()
    true, calls = sweep.evaluated, []

    def cut_off(task):
        calls.append(task)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return true(task)

    monkeypatch.setattr(sweep, "evaluated", cut_off)
    validate(*words, status=130)
    assert 2 < len(csv.read_text().splitlines()) < len(rows.splitlines())
    assert (validate(*words).out, csv.read_text()) == (whole.out, rows)
    assert len(calls) == 3


@pytest.mark.slow
@pytest.mark.parametrize("command", ["sweep", "map"])
def test_a_run_that_was_killed_goes_on_and_equals_one_that_was_not(tmp_path, command):
    """By SIGKILL, which no program can hear: what is on the disk has to be whole by itself."""
    shutil.copy(MODELS / "planar-2r.toml", tmp_path / "arm.toml")

    def words(place):
        if command == "sweep":
            vary = ["upper.length_mm=400:600:8", "fore.length_mm=300:500:8"]
            end = [
                "--wrench",
                "0,-10,0,0,0,0",
                "--of",
                "mass,deflection,frequency",
                "--csv",
                str(place / "rows.csv"),
            ]
            return ["sweep", str(tmp_path / "arm.toml"), "--vary", *vary, *end, "--json"]
        grid = ["--grid", "shoulder=-1:1:10,elbow=0.2:2:10", "--quantity", "critical", "--engine", "vjm-2"]
        return ["map", str(tmp_path / "arm.toml"), *grid, "--jobs", "1", "--out", str(place), "--json"]

    def started(place):
        return len(list(place.glob("tasks/*"))) if command == "map" else int((place / "rows.csv").exists())

    cut, whole = tmp_path / "cut", tmp_path / "whole"
    run = [sys.executable, "-c", "from vjm_validation.cli.main import main; main()", *words(cut)]
    process = subprocess.Popen(run, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120.0
    while not started(cut) and time.monotonic() < deadline:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    rows = (cut / "rows.csv").read_text().splitlines() if command == "sweep" else []
    assert started(cut)
    assert len(rows) < 2 + 64
    assert not (cut / "map.csv").exists()
    again, uncut = validate(*words(cut)), validate(*words(whole))
    assert again.out.replace(str(cut), "") == uncut.out.replace(str(whole), "")


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda cells: [*cells[:3], "", cells[-1]], "line 4: column deflection: has no value"),
        (lambda cells: [*cells[:3], "0.0.1", cells[-1]], "line 4: column deflection: '0.0.1' is no number"),
        (lambda cells: ["", *cells[1:]], "line 4: column leg.link.section.EA_N: has no value"),
        (lambda cells: cells[:-1], "line 4: 4 cells for 5 columns"),
        (lambda cells: [*cells[:-1], "not found"], "line 4: has values, and 'not found' in column why"),
        (lambda cells: [], "line 4: 0 cells for 5 columns"),
    ],
)
def test_a_damaged_row_is_named_by_file_and_line(machine, damage, said):
    words, csv = words_of("sweep", machine), machine.parent / "out/sweep.csv"
    validate(*words)
    *before, last = csv.read_text().splitlines()
    csv.write_text("\n".join([*before, ",".join(damage(last.replace('"10,0,0,0,0,0"', "W").split(",")))]) + "\n")
    csv.write_text(csv.read_text().replace(",W,", ',"10,0,0,0,0,0",'))
    spoilt = csv.read_text()
    assert f"{csv}, {said}" in refused(*words)
    assert csv.read_text() == spoilt


@pytest.mark.parametrize("left", [1, 12, -1])
def test_a_last_line_that_was_cut_off_is_computed_anew_and_said(machine, left):
    words, csv = words_of("sweep", machine), machine.parent / "out/sweep.csv"
    first, whole = validate(*words), csv.read_text()
    *before, last = whole.splitlines()
    csv.write_text("\n".join([*before, last[:left]]))
    again = validate(*words)
    assert f"{csv}, line 4: was cut off: its machine is computed anew" in again.err
    assert (again.out, csv.read_text()) == (first.out, whole)


def test_a_csv_that_is_none_of_a_sweep_is_refused(machine):
    words, csv = words_of("sweep", machine), machine.parent / "out/sweep.csv"
    csv.parent.mkdir()
    csv.write_text("a,b\n1,2\n")
    assert "it does not say what it was made of" in refused(*words)
    assert csv.read_text() == "a,b\n1,2\n"


@pytest.mark.parametrize("spoil", [lambda text: text[: len(text) // 2], lambda text: text.replace("1", "2", 40)])
def test_a_damaged_record_of_a_map_is_computed_anew(machine, spoil):
    words, out = words_of("map", machine), machine.parent / "out"
    first = validate(*words)
    (record,) = out.glob("tasks/*.json")
    whole = record.read_text()
    record.write_text(spoil(whole))
    assert (validate(*words).out, record.read_text()) == (first.out, whole)


def test_a_report_of_other_inputs_is_gone_before_another_run_begins(tmp_path, monkeypatch):
    """Else a run that is cut off would leave the old page beside new curves."""
    arm, out = tmp_path / "arm.toml", tmp_path / "out"
    shutil.copy(MODELS / "planar-2r.toml", arm)
    made_of = Provenance.of(load_model(arm).files, command=f"validate all {arm}")
    (out / "curves").mkdir(parents=True)
    summary = json.dumps({"made_of": dict(made_of.inputs)})
    for name, text in (("summary.json", summary), ("index.html", "old"), ("curves/a.csv", "old")):
        (out / name).write_text(text)

    def cut_off(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("vjm_validation.runs.own_machine.study", cut_off)
    validate("all", arm, "--out", out, status=130)
    assert (out / "index.html").exists()
    arm.write_text(arm.read_text() + "# another\n")
    validate("all", arm, "--out", out, status=130)
    assert not (out / "index.html").exists()
    assert not (out / "summary.json").exists()
    assert not (out / "curves/a.csv").exists()
