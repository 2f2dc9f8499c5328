"""Shares, modes, sensitivities, sweeps and optima on the command line: what they print, draw and refuse."""

import csv
import json
import signal
import subprocess
import sys
import time
import tomllib

import numpy as np
import pytest
from helpers.command import json_of, refused, validate
from helpers.file_texts import model_text, part_text

import vjm
from vjm_updating.maps import run as maps
from vjm_validation.design_documents import FrontDocument, OptimumDocument, SweepDocument
from vjm_validation.documents import ModesDocument, SensitivityDocument, StiffnessDocument


def test_shares_are_printed_for_every_posture():
    printed = validate("stiffness", "ur10", "--wrench", "0,0,-100,0,0,0", "--shares", "--json").out
    found = StiffnessDocument.model_validate_json(printed)
    assert [row.posture for row in found.shares] == list(vjm.load("ur10").postures)
    for row in found.shares:
        np.testing.assert_allclose(
            np.sum([part.deflection for part in row.parts], axis=0), row.deflection, atol=1e-12
        )
    stretched, upright, _ = found.shares
    assert sum(part.energy for part in stretched.parts) == pytest.approx(1.0, rel=1e-12)
    # a vertical force on a vertical arm
    assert upright.nonlinearity is None
    assert all(part.energy is None for part in upright.parts)


def test_a_load_that_closed_loops_carry_alone_has_no_shares(tmp_path):
    """A vertical force on a crank that stands upright: only rounding of the loop's closing is left of it."""
    model = str(tmp_path / "crank.toml")
    validate("new", "bodies", model)
    printed = validate("stiffness", model, "--wrench", "0,0,-100,0,0,0", "--shares", "--json").out
    drawn, forward = StiffnessDocument.model_validate_json(printed).shares
    assert drawn.nonlinearity is None
    assert not np.any(drawn.deflection)
    assert forward.nonlinearity < 1e-3
    assert forward.deflection[0] > 0.01


def test_shares_of_one_posture_as_a_table_a_figure_and_a_page(tmp_path):
    figure, page = tmp_path / "shares.png", tmp_path / "shares.html"
    words = ("--posture", "stretched", "--wrench", "0,-10,0,0,0,0", "--shares", "--plot", figure, "--report", page)
    out = validate("stiffness", "planar-2r", *words).out
    assert "Shares in the deflection, posture stretched" in out
    assert "bearing" not in out
    lines = {line.split("│")[1].strip(): line for line in out.splitlines() if line.count("│") > 9}
    assert {"shoulder", "upper", "elbow", "fore", "sum"} <= set(lines)
    assert "70.2%" in lines["shoulder"]
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert "Shares in the deflection" in page.read_text()


def test_large_deflections_are_said():
    out = validate("stiffness", "planar-2r", "--posture", "stretched", "--wrench", "0,-100,0,0,0,0", "--shares").out
    assert "What is not linear changes the whole by 3.5%" in out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--shares",), "--shares: say under which load"),
        (("--shares", "--wrench", "1,0,0,0,0,0", "--engine", "msa"), "--shares: msa has no springs"),
    ],
)
def test_shares_that_cannot_be_told_are_refused(words, said):
    assert said in refused("stiffness", "orthoglide", "--posture", "isotropic", *words)


def test_modes_are_printed_and_drawn(tmp_path):
    figure, page = tmp_path / "modes.png", tmp_path / "modes.html"
    words = ("--gravity", "0,0,-9.81", "--number", "3", "--plot", figure, "--report", page)
    out = validate("modes", "ur10", *words).out
    assert "The equilibrium is stable." in out
    expected = vjm.modes(vjm.load("ur10"), number=3, gravity=(0.0, 0.0, -9.81))
    for frequency in expected.frequencies:
        assert f"{frequency:.6g}" in out
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert "Natural frequencies" in page.read_text()


def test_modes_as_json():
    found = ModesDocument.model_validate_json(validate("modes", "hexapod", "--json").out)
    assert found.verdict == "stable"
    assert len(found.modes) == 3
    assert len(found.stations) == len(found.positions) == len(found.modes[0].shape)
    assert found.massless == [f"{leg}/strut" for leg in "abcdef"]
    out = validate("modes", "hexapod").out
    assert "There are 3 frequencies" in out
    assert "Without mass: a/strut" in out


def test_flutter_is_said(tmp_path):
    """Beck's column below and beyond its load, 20.05 EI/L² = 2067 N."""
    model = tmp_path / "beck.toml"
    model.write_text(
        'format = 1\nname = "beck"\ntitle = "a column"\nsource = "a test"\n'
        '[units]\nlength = "mm"\nforce = "N"\nangle = "rad"\n'
        '[[parts]]\nkind = "beam"\nname = "rod"\nlength_mm = 1000.0\nmass_kg = 0.6165\n'
        "[parts.section]\nEA_N = 1.649e7\nGJ_Nmm2 = 7.93e7\nEIy_Nmm2 = 1.031e8\nEIz_Nmm2 = 1.031e8\n"
        "[postures]\nstraight = {}\n"
    )
    out = validate("modes", model, "--load", "rod@1:-2200,0,0:follower").out
    assert "an oscillation grows (flutter)" in out
    assert json_of("modes", model, "--load", "rod@1:-1900,0,0:follower")["verdict"] == "stable"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("orthoglide",), "no part that moves has a mass"),
        (("ur10", "--number", "0"), "--number: must be at least 1"),
        (("ur10", "--displacement", "0,0,0,0,0,0", "--gravity", "0,0,-9.81"), "--displacement holds the end"),
        (("ur10", "--displacement", "5000,0,0,0,0,0"), "--displacement: 5000 mm is out of reach"),
        (("ur10", "--end", "hand"), "has no end frame 'hand'"),
    ],
)
def test_modes_that_are_none_are_refused(words, said):
    assert said in refused("modes", *words)


def test_sensitivities_say_what_to_change(tmp_path):
    figure, page = tmp_path / "tornado.png", tmp_path / "tornado.html"
    keys = "shoulder.compliance_rad_per_Nmm,elbow.compliance_rad_per_Nmm,tool.mass_kg"
    words = ("--posture", "stretched", "--wrench", "0,-10,0,0,0,0", "--by", keys)
    out = validate("sensitivity", "planar-2r", *words, "--plot", figure, "--report", page).out
    found = SensitivityDocument.model_validate_json(validate("sensitivity", "planar-2r", *words, "--json").out)
    shoulder, elbow, mass = found.parameters
    # of a joint in series it is its share in the deflection
    shares = vjm.shares(vjm.load("planar-2r"), "stretched", wrench=(0.0, -10.0, 0.0, 0.0, 0.0, 0.0))
    of_joints = {row.part: share for row, share in zip(shares.rows, shares.fractions(1), strict=True)}
    assert (shoulder.relative, elbow.relative) == pytest.approx(
        (of_joints["shoulder"], of_joints["elbow"]), rel=1e-3
    )
    assert (mass.relative, mass.factor, elbow.factor) == (0.0, None, None)
    assert f"(times {shoulder.factor:.3g})" in out
    assert "elbow.compliance_rad_per_Nmm alone is not enough" in out
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert "Derivatives" in page.read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("planar-2r",), "--of deflection: say under which load"),
        (("planar-2r", "--of", "mass", "--by", "upper.length"), "did you mean 'upper.length_mm'"),
        (("planar-2r", "--of", "mass", "--along", "x"), "a mass has no component"),
        (("orthoglide", "--of", "mass"), "no part has a mass"),
        (("planar-2r", "--of", "critical", "--gravity", "0,-9.81,0"), "--of critical: say which load grows"),
        (("delta", "--of", "mass", "--by", "rod.length_mm"), "write chain.part.key"),
    ],
)
def test_sensitivities_that_are_none_are_refused(words, said):
    assert said in refused("sensitivity", *words)


SWEEP = ("sweep", "planar-2r", "--posture", "stretched", "--wrench", "0,-10,0,0,0,0", "--segments", "2")


def test_a_sweep_is_drawn_and_taken_up_again(tmp_path):
    table, figure = tmp_path / "sweep.csv", tmp_path / "sweep.png"
    words = (*SWEEP, "--vary", "upper.section.width_mm=40:80:3", "--csv", table)
    found = SweepDocument.model_validate_json(validate(*words, "--json").out)
    assert [row.numbers for row in found.rows] == [[40.0], [60.0], [80.0]]
    # heavier and stiffer
    assert all(row.on_front for row in found.rows)
    lines = table.read_text().splitlines()
    assert lines[1] == "upper.section.width_mm,posture,wrench,mass,deflection,why"
    table.write_text("\n".join(lines[:3]) + "\n")
    again = validate(*words, "--json", "--plot", figure)
    assert "has 1 of 3 machines already" in again.err
    assert SweepDocument.model_validate_json(again.out) == found
    assert figure.read_bytes().startswith(b"\x89PNG")
    # rows of another grid, and of another posture, stay
    more = validate(*words[:-3], "upper.section.width_mm=40:50:2", "--posture", "bent", "--csv", table, "--json")
    assert "has 0 of" not in more.err
    assert "2 rows of other values or cases stay in it" in more.err
    (row, _) = SweepDocument.model_validate_json(more.out).rows
    assert [case.posture for case in row.cases] == ["stretched", "bent"]
    assert len(table.read_text().splitlines()) == 2 + 3 + 3
    assert "is of another machine, load or question (gravity was null and is [0.0, -9.81, 0.0])" in refused(
        *words, "--gravity", "0,-9.81,0"
    )
    other = validate(*SWEEP, "--vary", "upper.length_mm=400:500:2", "--csv", table, status=2)
    assert "vary was" in other.err


def test_an_optimum_is_written_as_a_file_that_keeps_its_limit(tmp_path):
    best = tmp_path / "best.toml"
    words = (
        "optimise", "planar-2r", "--posture", "stretched", "--wrench", "0,-10,0,0,0,0", "--segments", "2",
        "--minimise", "mass", "--such-that", "deflection<=5.9", "--vary", "upper.section.width_mm=30:90",
        "--starts", "1", "--no-confirm", "--out", best,
    )  # fmt: skip
    found = OptimumDocument.model_validate_json(validate(*words, "--json").out)
    assert found.kept
    assert found.limits[0].active
    there = SweepDocument.model_validate_json(
        validate(
            "sweep", best, *SWEEP[2:], "--vary", f"upper.section.width_mm={found.numbers[0].value}:99:2", "--json"
        ).out
    )
    mass, deflection = there.rows[0].values
    assert mass == pytest.approx(found.value, rel=1e-9)
    assert deflection == pytest.approx(5.9, rel=2e-6)


def test_a_platform_is_swept_in_postures_by_label_and_by_hand():
    found = SweepDocument.model_validate_json(
        validate(
            "sweep", "delta", "--vary", "delta-rod.rod.section.EA_N=8e6:12e6:2", "--of", "deflection",
            "--segments", "1",
            "--posture", "low", "--posture", "-10,0,-20", "--wrench", "0,0,-50,0,0,0", "--json",
        ).out
    )  # fmt: skip
    assert [[case.posture for case in row.cases] for row in found.rows] == [["low", "-10,0,-20"]] * 2
    for row in found.rows:
        # the worst of both
        assert row.values[0] == max(case.values[0] for case in row.cases)
    assert found.rows[1].values[0] < found.rows[0].values[0]


def test_an_optimum_of_legs_is_written_with_its_chain_files(tmp_path):
    best = tmp_path / "best.toml"
    found = OptimumDocument.model_validate_json(
        validate(
            "optimise", "delta", "--maximise", "stiffness.z", "--vary", "delta-arm.arm.length_mm=500:530",
            "--segments", "1", "--starts", "1", "--no-confirm", "--out", best, "--json",
        ).out
    )  # fmt: skip
    assert found.numbers[0].at_bound
    assert found.before is not None
    assert found.value > found.before
    loaded = vjm.stiffness(vjm.load(str(best)), engine="vjm-1", wrench=(0.0,) * 6).loaded
    assert 1.0 / np.linalg.inv(loaded)[2, 2] == pytest.approx(found.value, rel=1e-6)
    assert "with no limits" in best.read_text()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("sweep", "planar-2r"), "say which number varies"),
        (("sweep", "planar-2r", "--vary", "upper.length_mm=4:5"), "write KEY=a:b:n"),
        (
            ("sweep", "planar-2r", "--vary", "upper.length=400:500:2", "--of", "mass"),
            "did you mean 'upper.length_mm'",
        ),
        (("sweep", "planar-2r", "--vary", "upper.length_mm=400:500:2"), "--of deflection: say under which load"),
        (("optimise", "planar-2r", "--vary", "upper.length_mm=400:500"), "--minimise, --maximise: say one"),
        (
            ("optimise", "planar-2r", "--maximise", "mass", "--vary", "upper.length_mm=400:500"),
            "say one: minimise mass, ",
        ),
        (
            ("optimise", "planar-2r", "--minimise", "mass", "--vary", "upper.length_mm=400:500", "--hold-tool"),
            "give another posture",
        ),
        (
            ("optimise", "planar-2r", "--minimise", "cost", "--cost", "2*", "--vary", "upper.length_mm=4:5"),
            "is no formula",
        ),
        (
            ("optimise", "planar-2r", "--minimise", "mass", "--weights", "a", "--vary", "upper.length_mm=4:5"),
            "write numbers such as 1,2",
        ),
        (
            ("optimise", "planar-2r", "--minimise", "mass", "--plot", "a.png", "--vary", "upper.length_mm=4:5"),
            "say --against which quantity",
        ),
        (
            ("optimise", "orthoglide", "--minimise", "mass", "--vary", "link.length_mm=1:2"),
            "'link.length_mm' is no number of a part",
        ),
    ],
)
def test_designs_that_are_none_are_refused(words, said):
    assert said in refused(*words)


def test_an_interrupted_optimum_prints_the_best_so_far_and_goes_on(tmp_path):
    best, state = tmp_path / "best.toml", tmp_path / "state.json"
    words = [
        "optimise", "planar-2r", "--posture", "stretched", "--wrench", "0,-10,0,0,0,0", "--segments", "1",
        "--minimise", "mass", "--such-that", "deflection<=5.9", "--vary", "upper.section.width_mm=30:90",
        "--starts", "100", "--out", str(best), "--state", str(state),
    ]  # fmt: skip
    command = [sys.executable, "-m", "vjm_validation.cli.main", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        ends = time.monotonic() + 60.0
        while time.monotonic() < ends and (not state.exists() or state.read_text().count("deflection") < 10):
            time.sleep(0.05)
        running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=60.0)
    assert running.returncode == 130, err
    assert "this is the best machine so far; what was computed is in" in err
    assert "upper.section.width_mm" in out
    assert "such that deflection <= 5.9 mm" in best.read_text()
    known = json.loads(state.read_text())["content"]
    words[words.index("100")] = "1"
    assert "is of another machine or question (starts was 100 and is 1)" in refused(*words)
    assert json.loads(state.read_text())["content"] == known


@pytest.mark.slow
def test_a_front_is_printed_drawn_and_confirmed(tmp_path):
    words = (
        "optimise", "planar-2r", "--wrench", "0,-10,0,0,0,0", "--segments", "1", "--minimise", "mass", "--against",
        "deflection", "--points", "3", "--vary", "upper.section.width_mm=40:90", "--starts", "1",
    )  # fmt: skip
    found = FrontDocument.model_validate_json(validate(*words, "--json").out)
    assert found.quantities == ["mass", "deflection"]
    assert len(found.points) == 3
    for point in found.points:
        (row,) = point.confirmed
        assert (row.quantity, row.doubt, row.why) == ("deflection", "", "")
    plot = tmp_path / "front.svg"
    printed = validate(*words, "--no-confirm", "--plot", plot, "--report", tmp_path / "front.html").out
    assert "3 machines are not beaten by another in mass and deflection" in printed
    assert plot.read_text().startswith("<?xml")


@pytest.mark.slow
def test_a_tool_is_held_and_a_cost_is_least(tmp_path):
    best = tmp_path / "best.toml"
    words = (
        "optimise", "planar-2r", "--posture", "bent", "--wrench", "0,-50,0,0,0,0", "--segments", "1",
        "--minimise", "cost", "--cost", "2*mass", "--such-that", "deflection<=8; reach>=800", "--hold-tool",
        "--vary", "upper.length_mm=350:800", "fore.length_mm=250:700", "--starts", "1", "--out", best,
    )  # fmt: skip
    printed = validate(*words).out
    assert "Computed again" in printed
    held = tomllib.loads(best.read_text())["postures"]["bent"]
    assert held["elbow"] != 1.2
    again = vjm.load(str(best))
    # the tool is where it was
    place = vjm.tool_postures(again, (387.2534, 636.3791, 0.0))
    assert min(abs(each["elbow"] - held["elbow"]) for each in place) < 1e-4


def test_what_to_change_names_numbers_that_leave_the_geometry():
    printed = validate(
        "sensitivity", "planar-2r", "--posture", "bent", "--wrench", "0,-50,0,0,0,0", "--segments", "2"
    ).out
    (line,) = (each for each in printed.splitlines() if each.startswith("With the geometry as it is"))
    assert "to halve the deflection along x: shoulder.compliance_rad_per_Nmm from 5e-07" in line


def test_sections_are_chosen_from_a_catalogue(tmp_path):
    (tmp_path / "tubes.csv").write_text("name,width_mm,wall_mm\nthin,45,2\nmiddle,55,2\nthick,70,3\n")
    best = tmp_path / "best.toml"
    words = (
        "optimise", "planar-2r", "--posture", "stretched", "--wrench", "0,-10,0,0,0,0", "--segments", "1",
        "--minimise", "mass", "--such-that", "deflection<=5.9", "--out", best, "--no-confirm",
        "--vary", f"upper.section=catalogue:{tmp_path / 'tubes.csv'}",
    )  # fmt: skip
    found = OptimumDocument.model_validate_json(validate(*words, "--json").out)
    assert found.parts[0].row["name"] == "middle"
    section = tomllib.loads(best.read_text())["parts"][1]["section"]
    assert (section["width_mm"], section["wall_mm"], section["youngs_modulus_MPa"]) == (55.0, 2.0, 70000.0)
    assert "middle" in validate(*words).out
    twice = (*words, "upper.section=catalogue:square-tubes")
    assert "a part stands twice" in refused(*twice)


# ``validate sweep --scheduler``: the rows of a Dask cluster are those of one process.


distributed = pytest.importorskip("distributed", reason="Dask is an optional extra and is not installed")


@pytest.mark.filterwarnings("ignore")
def test_a_sweep_by_a_cluster(tmp_path, monkeypatch):
    done, by_cluster = [], maps.on_cluster

    def counted(*given):
        for index, result in by_cluster(*given):
            done.append(index)
            yield index, result

    monkeypatch.setattr(maps, "on_cluster", counted)
    words = [
        "sweep", "ur10", "--vary", "elbow.compliance_rad_per_Nmm=1e-8:3e-8:3", "--of", "mass,deflection,frequency",
        "--posture", "stretched", "--wrench", "0,0,-100,0,0,0", "--csv",
    ]  # fmt: skip
    here, there = tmp_path / "here.csv", tmp_path / "there.csv"
    validate(*words, here)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, silence_logs=50
    ) as cluster:
        validate(*words, there, "--scheduler", cluster.scheduler_address)
    # rows go in parcels
    assert done
    tables = []
    for file in (here, there):
        lines = [line for line in file.read_text().splitlines() if not line.startswith("#")]
        tables.append(sorted(csv.DictReader(lines), key=lambda row: float(row["elbow.compliance_rad_per_Nmm"])))
    assert tables[0] == tables[1]
    # a softer elbow deflects more and vibrates more slowly
    for quantity, sign in (("deflection", 1.0), ("frequency", -1.0)):
        column = next(name for name in tables[0][0] if name.startswith(quantity))
        values = [sign * float(row[column]) for row in tables[0]]
        assert len(values) == 3
        assert values[0] < values[1] < values[2]


def rod(file, *parts, **keys):
    """A rod that hangs from a hinge with a spring, and a rigid tip behind a second one."""
    behind = (
        part_text("actuated", "wrist", axis="x", compliance_rad_per_Nmm=1e-6),
        part_text("offset", "tip", translation_mm=[0.0, -200.0, 0.0]),
    )
    half = [0.0, -150.0, 0.0]
    mass = part_text("offset", "rod", translation_mm=[0.0, -300.0, 0.0], mass_kg=1.0, centre_of_mass_mm=half)
    file.write_text(model_text("hanging", *parts, mass, *behind, postures={"home": keys}), encoding="utf-8")
    return file


def test_the_length_of_a_rigid_tip_is_geometry(tmp_path):
    """No station of the machine stands where a rigid part ends: the end frame is moved by its length."""
    hinge = part_text("actuated", "hinge", axis="z", compliance_rad_per_Nmm=1e-6)
    file = rod(tmp_path / "hanging.toml", hinge, hinge=0.0, wrist=0.0)
    found = json_of("sensitivity", file, "--of", "deflection", "--along", "x", "--wrench", "10,0,0,0,0,0")
    geometric = {row["parameter"]: row["geometric"] for row in found["parameters"]}
    assert geometric["tip.translation_mm.2"]
    assert not geometric["hinge.compliance_rad_per_Nmm"]


def test_a_frequency_of_zero_has_no_relative_change(tmp_path):
    file = rod(tmp_path / "hanging.toml", part_text("joint", "hinge", axis="z"), hinge=0.0, wrist=0.0)
    assert "its frequency is zero: no change of it is relative" in refused("sensitivity", file, "--of", "frequency")


def test_a_result_without_a_figure_says_so(tmp_path):
    plot = tmp_path / "k.png"
    words = ("stiffness", "ur10", "--posture", "stretched", "--wrench", "0,0,-100,0,0,0", "--plot", plot)
    assert f"--plot {plot}: this result has no figure: leave --plot out" in validate(*words, status=2).err
    assert not plot.exists()


def test_a_page_ends_in_html(tmp_path):
    page = tmp_path / "page.pdf"
    assert f"--report {page}: write a file that ends in .html" in refused("modes", "planar-2r", "--report", page)
