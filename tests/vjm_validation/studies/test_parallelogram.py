"""The real parallelogram against one bar of double stiffness: closed forms, and its chapter."""

from dataclasses import replace

import numpy as np
import pytest

from vjm.continuation.path import Equilibrium, Path
from vjm.errors import NoConvergenceError
from vjm.io.machine_file import load_model
from vjm.io.model_file import load_chain
from vjm.model.load_case import LoadCase
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_validation.report.chapters import distance_picture, parallelogram, parallelogram_tables
from vjm_validation.studies.chain import Run
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
