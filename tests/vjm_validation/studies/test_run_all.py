"""What `validate all` must show on the paper's chain; figures from published data and closed forms."""

import csv
import math
from dataclasses import replace

import jsonschema
import numpy as np
import pytest

from vjm import VjmEngine
from vjm.io import provenance
from vjm.io.machine_file import load_model
from vjm.io.provenance import Provenance
from vjm.model.load_case import LoadCase
from vjm.model.parts import Placement
from vjm_fea.opensees.beams import available
from vjm_validation.schemas import schemas
from vjm_validation.studies.chain import ENGINES, Key, PathStore, PathTask, run_sweep
from vjm_validation.verification.library import case_by_name, library
from vjm_validation.verification.runner import AnswerStore, run_cases


def test_it_ends_well_and_says_where_the_report_is(finished_run):
    folder, finished = finished_run
    assert finished.status == 0, finished.err
    assert f"report: {folder / 'index.html'}" in finished.out
    assert (folder / "index.html").stat().st_size > 100_000


def test_an_interrupted_run_keeps_what_is_done_and_goes_on(interrupted_run):
    run = interrupted_run
    assert run.status == 130
    assert "interrupted; what is finished is in" in run.err
    assert "Traceback" not in run.err
    assert len(run.kept) >= 5
    assert run.unfinished == []
    assert not run.summarised
    assert run.again.status == 0, run.again.err
    assert (run.folder / "summary.json").exists()
    assert all(file.stat().st_mtime_ns == stamp for file, stamp in run.kept.items())


def test_the_summary_keeps_to_its_schema(summary):
    jsonschema.validate(summary, schemas()["summary.schema.json"])


def test_every_engine_has_every_path(finished_run, summary):
    folder, _ = finished_run
    for posture in "ABCD":
        for direction in ("tension", "compression"):
            own = set(summary["chain"][posture][direction])
            # a whole run asks a second finite element program where it is installed
            assert own - {"opensees"} == set(ENGINES)
            for engine in own:
                lines = (folder / "curves" / f"{posture}_{direction}_{engine}.csv").read_text().splitlines()
                assert lines[0].startswith("# model=orthoglide-chain")
                assert len(list(csv.DictReader(lines[1:]))) >= 2


def test_all_acceptance_rows_hold(summary):
    assert len(summary["acceptance"]) > 10
    assert [row for row in summary["acceptance"] if not row["passed"]] == []


def test_the_papers_buckling_is_in_tension(summary):
    chain = summary["chain"]
    for posture, force, displacement in (("A", 2696, 0.813), ("C", 2334, 0.1544)):
        found = chain[posture]["tension"]["vjm-paper"]
        assert found["critical"] == "bifurcation"
        # repaired data give these figures independently; three and four digits
        assert found["F_cr"] == pytest.approx(force, rel=2e-3)
        assert found["d_cr"] == pytest.approx(displacement, rel=2e-3)
        assert found["K2"] == pytest.approx(8.675, rel=2e-3)
    for posture in "BD":
        assert chain[posture]["tension"]["vjm-paper"]["critical"] == "stiffness-knee"
    for posture in "ABCD":
        assert chain[posture]["compression"]["vjm-paper"]["critical"] is None


def test_beams_buckle_in_compression_only(summary):
    chain = summary["chain"]
    for posture in "ABCD":
        for engine in ("exudyn", "exudyn-footspring", "vjm-16", "vjm-16f16"):
            assert chain[posture]["tension"][engine]["critical"] is None, (posture, engine)
    # Euler's load of the pair of bars, raised by their shortening; the slanted foot takes 4e-5 off
    L, EI, EA = 310.0, 2 * 310.0 / 72e-7, 2 * 310.0 / 46e-6
    euler = math.pi**2 * EI / L**2
    closed = euler * (1.0 + euler / EA)
    for engine in ("vjm-16", "vjm-16f16", "exudyn", "exudyn-footspring"):
        a, c = chain["A"]["compression"][engine], chain["C"]["compression"][engine]
        assert a["critical"] == c["critical"] == "bifurcation"
        assert a["F_cr"] == pytest.approx(closed, rel=1e-3)
        # in C the bar leans by 30°: its axial force is F_cr / cos 30°
        assert c["F_cr"] == pytest.approx(closed * math.cos(math.pi / 6), rel=2e-3)
        for posture in "BD":
            assert chain[posture]["compression"][engine]["critical"] == "stiffness-knee"


@pytest.mark.parametrize(
    ("posture", "engine", "d_cr", "tolerance"),
    [
        # figures of an independent prototype to three or four digits
        ("A", "vjm-16", 2.723, 1e-3),
        ("A", "vjm-16f16", 2.867, 1e-3),
        ("A", "exudyn", 2.867, 1e-3),
        ("A", "exudyn-footspring", 2.891, 1e-3),
        ("C", "vjm-16", 0.5116, 1e-3),
        ("C", "vjm-16f16", 0.5247, 1e-3),
        ("C", "exudyn", 0.5247, 1e-3),
        ("B", "vjm-16", 7.92, 2e-3),
        ("D", "vjm-16", 7.20, 2e-3),
        ("B", "vjm-16f16", 8.57, 5e-3),
        ("D", "vjm-16f16", 8.37, 5e-3),
    ],
)
def test_displacements_depend_on_the_law_of_the_foot(summary, posture, engine, d_cr, tolerance):
    assert summary["chain"][posture]["compression"][engine]["d_cr"] == pytest.approx(d_cr, rel=tolerance)


def test_the_linear_engines_have_a_straight_line(summary):
    for engine in ("vjm-linear", "msa"):
        found = summary["chain"]["A"]["compression"][engine]
        assert found["critical"] is None
        assert found["K0"] == found["K3"]
        assert found["F_end"] == pytest.approx(found["K0"] * found["d_end"], rel=1e-12)


def test_published_figures_say_whether_rounding_reaches_them(summary):
    rows = {(r["posture"], r["quantity"]): r for r in summary["published"]}
    assert len(rows) == 28
    assert rows["A", "F_cr"]["inside"] is True
    assert rows["A", "K0"]["inside"] is False
    for row in rows.values():
        assert row["reach_low"] <= row["ours"] <= row["reach_high"]
        assert row["inside"] == (row["reach_low"] <= row["published"] <= row["reach_high"])


def test_the_lumping_study_tells_the_placements_apart(summary):
    found = {(r["direction"], r["placement"], r["springs"]): r["F_cr"] for r in summary["lumping"]}
    assert found["compression", "end", 1] is None
    assert found["tension", "end", 1] == pytest.approx(2688, rel=1e-3)  # L³/3EI: 6 EI/L² of one bar
    assert found["compression", "middle", 4] < 8849 < found["compression", "end", 4]
    assert all(found["tension", "best", n] is None for n in (4, 8, 16, 32))
    assert {place for _, place, _ in found} == set(Placement)
    # 32 springs by the suite's rule stand for the limit: the next coarser is 4e-8 from it
    limit = found["compression", "best", 32]
    assert found["compression", "best", 16] == pytest.approx(limit, rel=1e-7)
    assert found["compression", "best", 4] == pytest.approx(limit, rel=3e-5)
    assert found["compression", "two-thirds", 8] == pytest.approx(limit, rel=4e-4)


@pytest.mark.slow
def test_whole_robots_are_in_the_summary(whole_summary):
    found = whole_summary["robots"]
    assert {row["robot"] for row in found["stiffness"]} == {"orthoglide", "3-puu", "delta", "par2"}
    # a second finite element program is asked where it is installed
    assert len([row for row in found["critical"] if row["engine"] != "opensees"]) == 24
    assert any(row["name"] == "robots: critical forces" for row in whole_summary["acceptance"])


CANNOT = {"column-pinned-shear", "column-clamped-pinned-shear", "postbuckling-pinned-shear"}
"""Cases that OpenSees refuses: corotational beams without shear cannot be asked for it."""


@pytest.mark.slow
def test_every_case_is_met_by_every_engine(whole_summary):
    missing = set() if available() else {"opensees"}
    rows = [row for row in whole_summary["verification"] if row["engine"] not in missing]
    wanted = {(case.name, engine) for case in library() for engine in case.file.engines if engine not in missing}
    assert {(row["case"], row["engine"]) for row in rows} >= wanted
    for row in rows:
        if row["engine"] == "opensees" and row["case"] in CANNOT:
            assert row["passed"] is None
            assert row["not_run"].startswith("refused"), row
        else:
            assert row["passed"], row


# Paths and answers of a run's folder are found again only where all that they were made of is the same.


def test_infinite_and_missing_values_come_back_as_they_were(tmp_path):
    made_of, content = Provenance({"a": "b"}), {"values": [[np.inf, -np.inf, 0.1 + 0.2], [1e-300, 3.0, 5e300]]}
    made_of.keep(tmp_path / "a.json", content)
    assert made_of.kept(tmp_path / "a.json") == content
    made_of.keep(tmp_path / "b.json", [float("nan")])
    assert np.isnan(made_of.kept(tmp_path / "b.json")[0])
    assert Provenance({"a": "c"}).kept(tmp_path / "a.json") is None


def column(engine="vjm-2", **changed):
    case = LoadCase("straight", -0.05, steps=2)
    return PathTask(Key("straight", "compression", engine), replace(load_model("pinned-column"), **changed), case)


@pytest.mark.parametrize(
    "other",
    [
        lambda task: replace(task, chain=replace(task.chain, files={"pinned-column.toml": "0" * 64})),
        lambda task: replace(task, chain=replace(task.chain, base=np.diag([1.0, -1.0, -1.0, 1.0]))),
        lambda task: replace(task, load_case=replace(task.load_case, to=-0.04)),
        lambda task: replace(task, load_case=replace(task.load_case, steps=3)),
    ],
)
def test_a_path_is_found_again_only_where_all_is_the_same(tmp_path, capsys, other):
    store, task = PathStore(tmp_path), column()
    (path,) = run_sweep([task], store).values()
    found = store.find(task)
    assert found is not None
    assert found.force.tolist() == path.force.tolist()
    assert store.find(other(task)) is None
    run_sweep([task], store)
    assert capsys.readouterr().err == ""
    run_sweep([other(task)], store)
    assert "1 paths, the first" in " ".join(capsys.readouterr().err.split())


def test_a_path_of_another_engine_or_program_is_not_found(tmp_path, monkeypatch):
    store, task = PathStore(tmp_path), column()
    run_sweep([task], store)
    monkeypatch.setattr("vjm_validation.studies.chain.engine_by_name", lambda _: VjmEngine(3))
    assert store.find(column()) is None
    monkeypatch.undo()
    assert store.find(column()) is not None
    monkeypatch.setattr(provenance.vjm, "__version__", "9.9")
    assert store.find(column()) is None


def test_a_curve_that_an_older_program_left_is_written_anew(tmp_path):
    store, task = PathStore(tmp_path), column()
    run_sweep([task], store)
    text = store.curve(task.key).read_text()
    store.curve(task.key).write_text("of another program\n")
    store.find(task)
    assert store.curve(task.key).read_text() == text


def test_an_answer_is_found_again_only_of_the_same_file_by_the_same_program(tmp_path, monkeypatch):
    case = case_by_name("column-pinned")
    (answers,) = run_cases([case], families=("vjm",), folder=tmp_path)
    store = AnswerStore(tmp_path)
    assert store.find(case.name, case.files, "vjm") == answers
    assert store.find(case.name, case.files, "exudyn") is None
    assert store.find(case.name, {f"{case.name}.toml": "0" * 64}, "vjm") is None
    monkeypatch.setattr(provenance.vjm, "__version__", "9.9")
    assert store.find(case.name, case.files, "vjm") is None
