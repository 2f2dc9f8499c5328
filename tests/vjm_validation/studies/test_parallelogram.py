"""The real parallelogram against one bar of double stiffness: closed forms, and its chapter."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.path import Equilibrium, EventKind, Path
from vjm.engines import VjmEngine
from vjm.errors import NoConvergenceError
from vjm.io.machine_file import load_model
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_validation.acceptance import end_rows
from vjm_validation.report.chapter_figures import end_condition_picture, end_conditions, most_sensitive
from vjm_validation.report.chapters import distance_picture, parallelogram, parallelogram_tables
from vjm_validation.report.words import Tone
from vjm_validation.studies.chain import END_CONDITIONS, HINGED_LOAD, ROTATIONS, Run, end_condition_study
from vjm_validation.studies.robots import (
    ParallelogramComparison,
    ParallelogramRobots,
    critical_force,
    element,
    platform_stiffness,
    stability_lost,
)

L, EA, GJ, EI_SOFT, EI_STIFF = 310.0, 6.7391304e6, 1.0689655e7, 4.3055556e7, 2.0666667e8


@pytest.fixture(scope="module")
def machine():
    return load_model("parallelogram")


@pytest.mark.parametrize("distance", [20.0, 80.0, 200.0])
def test_straight_its_stiffness_is_beam_theorys(machine, distance):
    found = element(machine, "straight", distance)
    half = 0.5 * distance
    out_of_plane = 24.0 * EI_SOFT / L**3
    expected = [
        2.0 * EA / L,
        0.0,
        out_of_plane,
        # two bars twist, and bend against one another
        2.0 * GJ / L + out_of_plane * half**2,
        8.0 * EI_SOFT / L,
        2.0 * EA / L * half**2,
    ]
    # rounding: 2e-15 of an entry, 1e-7 where the largest, some 1e8, leaves a zero
    assert found.real == pytest.approx(expected, rel=1e-12, abs=1e-5)
    # one bar of double stiffness lacks what comes with the distance
    assert found.single == pytest.approx([*expected[:3], 2.0 * GJ / L, expected[4], 0.0], rel=1e-12, abs=1e-5)


def test_turned_it_is_exudyns(machine):
    found = element(machine, "turned", 80.0)
    theirs = np.diag(platform_stiffness(ExudynEngine(elements=6), machine, "turned", np.zeros(6)))
    # one solver stops at residuals of 1e-9: 3e-10 of an entry
    assert found.real == pytest.approx(theirs, rel=2e-8, abs=1e-2)


@pytest.mark.slow
def test_at_the_isotropic_point_either_robot_buckles_as_the_bars_do():
    # across the parallelogram's plane its two bars are one of double stiffness, pinned by the leg's outer hinges
    for name in ("orthoglide", "orthoglide-parallelograms"):
        assert critical_force(load_model(name), "isotropic") == pytest.approx(8849.0, rel=1e-3)


def test_the_chapter_says_where_the_replacement_fails(machine):
    straight = element(machine, "straight", 80.0)
    found = [element(machine, pose, 80.0) for pose in machine.poses]
    with_exudyn = tuple(replace(e, exudyn=e.real) for e in found)
    robots = (ParallelogramRobots("isotropic", np.ones(6), np.full(6, 40.0), 8850.0, None),)
    study = ParallelogramComparison((straight, *with_exudyn), robots)
    finding = parallelogram(Run(load_chain("orthoglide-chain"), parallelogram=study))
    assert any("the real one is 1.80 times as stiff" in sentence for sentence in finding.sentences)
    rows = {row[0]: row[1:4] for row in parallelogram_tables(study)[0].rows}
    assert rows["turn in its plane, N mm/rad"] == ("0", "6.96×10⁷", "∞")
    assert distance_picture(study).content[:4] == b"\x89PNG"


def test_a_path_that_ends_without_losing_its_stability_is_no_answer():
    point = Equilibrium(0.0, np.zeros(6), np.zeros(6), 1.0, 1.0, 0, 1, 0.0, np.zeros((1, 3)), np.zeros(1))
    there = replace(point, s=1.0, eigenvalue=0.5, ramp=700.0)
    path = Path("vjm", "m", LoadCase("home", 1.0), (point, there), stopped="lost its way")
    with pytest.raises(NoConvergenceError, match="lost its way"):
        stability_lost(path)
    assert stability_lost(replace(path, stopped="")) is None
    # a knee too sharp to follow
    assert stability_lost(replace(path, points=(point, replace(there, eigenvalue=1e-5)))) == 700.0


# The study of end conditions: another route to its critical points, and Koiter's law for its imperfections.


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
