"""Old words of model files are read for one release, and said; the table is right in what it says."""

from __future__ import annotations

import pytest
from packaging.version import Version

import vjm
from vjm.io.findings import CAUSES, CAUSES_UNTIL, RENAMED, UNTIL, present_causes, present_document
from vjm.io.joint_tables import CoupledTable
from vjm.io.model_file import build_chain
from vjm.io.model_plausibility import model_findings
from vjm.model.parts import Joint

UNITS = {"length": "mm", "force": "N", "angle": "rad"}


def arm(coupling: str) -> dict:
    """An arm whose second joint follows the first."""
    first = {"kind": "actuated", "name": "a", "axis": "z", "compliance_rad_per_Nmm": 1e-8}
    second = {"kind": "coupled", "name": "b", "axis": "z", "to": {"a": -1.0}, "coupling": coupling}
    links = [{"kind": "link", "name": name, "translation_mm": [300.0, 0.0, 0.0]} for name in "cd"]
    return {
        "format": 1, "name": "arm", "title": "Arm", "source": "made up", "units": UNITS,
        "parts": [first, links[0], second, links[1]], "postures": {"home": {"a": 0.3}},
    }  # fmt: skip


@pytest.mark.parametrize(("old", "new"), RENAMED["coupling"].items())
def test_an_old_word_is_read_and_said(old, new):
    couplings = [
        next(
            part.coupling
            for part in build_chain(arm(word), "arm.toml").parts
            if isinstance(part, Joint) and part.coupling is not None
        )
        for word in (old, new)
    ]
    assert all(coupling.as_deflected for coupling in couplings)
    said = " ".join(map(str, model_findings(arm(old), "arm.toml")))
    assert f"arm.toml: part 'b', coupling: '{old}' is now called '{new}'" in said
    assert "is now called" not in " ".join(map(str, model_findings(arm(new), "arm.toml")))


def test_other_words_are_refused_by_the_present_ones():
    with pytest.raises(ValueError, match="as deflected"):
        CoupledTable(kind="coupled", name="b", axis="z", to={"a": 1.0}, coupling="as bended")


def test_old_words_go_with_the_version_that_is_said():
    assert Version(vjm.__version__) < min(Version(UNTIL), Version(CAUSES_UNTIL))


@pytest.mark.parametrize(("old", "new"), CAUSES.items())
def test_an_old_name_of_a_cause_is_read_and_said(old, new):
    names, findings = present_causes([f"{old}.elbow", new], "--fit")
    assert names == (f"{new}.elbow", new)
    assert [finding.found for finding in findings] == [
        f"'{old}.elbow' is now called '{new}.elbow'; the old word is read until {CAUSES_UNTIL}"
    ]
    document, findings = present_document({"named": {"causes": [old], "title": old}}, "diagnosis.json")
    assert document == {"named": {"causes": [new], "title": old}}
    assert len(findings) == 1
