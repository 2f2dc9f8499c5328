"""The study of end conditions: another route to its critical points, and Koiter's law for its imperfections."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.path import EventKind
from vjm.engines import VjmEngine
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm_validation.acceptance import end_rows
from vjm_validation.report.chapter_figures import end_condition_picture, end_conditions, most_sensitive
from vjm_validation.report.words import Tone
from vjm_validation.studies.chain import END_CONDITIONS, HINGED_LOAD, ROTATIONS, Run, end_condition_study


@pytest.fixture(scope="module")
def library_chain():
    return load_chain("orthoglide-chain")


@pytest.fixture(scope="module")
def study(library_chain):
    return end_condition_study(library_chain, {"A": 4.0, "D": 14.0}, [VjmEngine(16, 16)])


@pytest.mark.slow
def test_every_posture_has_every_condition(study):
    assert set(study.paths) == {(posture, name, "vjm-16f16") for posture in "AD" for name in END_CONDITIONS}


def test_dead_load_and_imposed_displacement_lose_stability_at_the_same_state(study):
    """Where both supports hold the same five components a bifurcation with no motion along x is the same."""
    imposed, dead = (study.paths["D", name, "vjm-16f16"].events[0] for name in ("hinged", HINGED_LOAD))
    assert imposed.kind is dead.kind is EventKind.BIFURCATION
    # two paths with other parameters; each locates its event to 1e-9 of its path
    assert dead.force == pytest.approx(imposed.force, rel=1e-7)
    assert dead.point.displacement[0] == pytest.approx(imposed.point.displacement[0], rel=1e-7)


def test_the_largest_dead_load_is_where_the_imposed_displacement_s_force_peaks(library_chain, study):
    limit = study.paths["D", "dead load", "vjm-16f16"].events[0]
    imposed = VjmEngine(16, 16).trace(library_chain, LoadCase("D", -20.0))
    peak = next(event for event in imposed.events if event.kind is EventKind.LIMIT)
    assert limit.kind is EventKind.LIMIT
    # a maximum is flat: its force is as good as the square of its place
    assert limit.force == pytest.approx(peak.force, rel=1e-8)


def test_small_imperfections_cost_by_the_two_thirds_law(study):
    """Koiter 1945: behind a symmetric subcritical bifurcation the limit falls with the power 2/3 of the size."""
    curve = study.imperfections["D"]
    lost = study.paths["D", HINGED_LOAD, "vjm-16f16"].events[0].force - curve.force
    assert np.all(curve.limit)
    power = np.log(lost[1:4] / lost[:3]) / np.log(curve.size[1:4] / curve.size[:3])
    # the next term of the expansion is of relative order (size / length)^(2/3)
    assert power == pytest.approx(np.full(3, 2.0 / 3.0), abs=0.01)


def test_a_chain_that_the_load_does_not_collapse_has_no_curve(study):
    assert set(study.imperfections) == {"D"}


def test_the_report_names_the_posture_whose_loss_of_stability_the_imposed_pose_hides(library_chain, study):
    run = Run(library_chain, end_conditions=study)
    finding = end_conditions(run)
    assert finding.tone is Tone.CAUSE
    assert "hides a sharp loss of stability in D" in finding.title
    assert "Posture D under a dead load, hinged: the bifurcation is subcritical" in finding.sentences[-1]
    assert most_sensitive(study) == "D"
    assert end_condition_picture(run).content[:4] == b"\x89PNG"
    assert set(ROTATIONS) <= set(study.paths["D", "hinged", "vjm-16f16"].load_case.free)


def test_without_a_study_there_is_neither_word_nor_picture(library_chain):
    assert end_conditions(Run(library_chain)) is None
    assert end_condition_picture(Run(library_chain)) is None


def test_disagreeing_engines_are_not_accepted(study):
    coarse = {(p, name, "other"): path for (p, name, _), path in study.paths.items() if name != HINGED_LOAD}
    coarse |= {(p, HINGED_LOAD, "other"): study.paths[p, "dead load", "vjm-16f16"] for p in "AD"}
    assert all(row.passed for row in end_rows(study))
    assert end_rows(None) == []
    wrong = {row.name: row for row in end_rows(replace(study, paths={**study.paths, **coarse}))}
    # D hinged buckles, D on a guide has a limit point at a force 9 % higher
    assert wrong["end conditions: kinds"].value == "D, dead load, hinged"
    assert not wrong["end conditions: critical forces"].passed
