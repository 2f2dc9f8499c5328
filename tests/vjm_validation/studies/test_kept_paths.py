"""Paths and answers of a run's folder are found again only where all that they were made of is the same."""

from dataclasses import replace

import numpy as np
import pytest

from vjm import VjmEngine
from vjm.io import provenance
from vjm.io.machine_file import load_model
from vjm.io.provenance import Provenance
from vjm.model.load_case import LoadCase
from vjm_validation.studies.chain import Key, PathStore, PathTask, run_sweep
from vjm_validation.verification.library import case_by_name
from vjm_validation.verification.runner import AnswerStore, run_cases


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
