"""A finder that is not told of a cause must not name it, and one that is told of one looks no further."""

from pathlib import Path

import pytest
from hidden_effects.finder import diagnosed
from hidden_effects.plan import Group


@pytest.fixture(scope="module")
def friction(hide, tmp_path_factory):
    truth, _ = hide(6001, Group.SINGLE, "joint_friction", strength=24.0)
    # the set's files are where it was made
    folder = next(tmp_path_factory.getbasetemp().glob("three*/6001"))
    return truth, folder


def verdict(folder: Path, out: Path, *options: str) -> dict:
    return diagnosed(folder / "data.csv", folder / "sheet.toml", out, options)


@pytest.mark.slow
def test_a_deleted_cause_is_unknown_or_one_of_its_class(friction, tmp_path):
    truth, folder = friction
    assert truth["apart"] > 8.0
    found = verdict(folder, tmp_path, "--without", "joint_friction")
    may = {tuple(causes) for causes in truth["admitted"]} - {("joint_friction",)}
    said = [tuple(candidate["causes"]) for candidate in found["candidates"]]
    assert found["verdict"] == "unknown" or (said and set(said) <= may), (found["verdict"], said)


@pytest.mark.slow
def test_the_only_cause_is_named(friction, tmp_path):
    _, folder = friction
    found = verdict(folder, tmp_path, "--only", "joint_friction")
    assert found["causes"] == ["joint_friction"]


@pytest.mark.slow
def test_a_cause_that_there_is_not_is_refused(friction, tmp_path):
    _, folder = friction
    found = verdict(folder, tmp_path, "--without", "joint_fiction")
    assert "did you mean 'joint_friction'" in found["error"]
    assert not (tmp_path / "diagnosis.json").exists()
