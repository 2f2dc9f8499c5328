"""The study of whole robots: its pieces, what the report says of them, and what would fail a run."""

import numpy as np
import pytest

from vjm.engines import VjmEngine
from vjm.io.machine_file import load_model
from vjm.io.model_file import load_chain
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.opensees.beams import available
from vjm_validation.acceptance import robot_rows
from vjm_validation.report.chapters import robot_pictures, robot_tables, robots
from vjm_validation.report.findings import no_finite_elements
from vjm_validation.studies.chain import Run
from vjm_validation.studies.robots import Robots, RobotStudy, curve, gathered, piece, platform_stiffness, tasks

L, EA, GJ, EI_SOFT = 310.0, 6.7391304e6, 1.0689655e7, 4.3055556e7
"""Of a bar of the library's parallelogram; its bars are 80 mm apart."""
PIECES = [
    ("critical", "isotropic", "+"),
    ("critical", "isotropic", "-"),
    ("misfit", "orthoglide", "x", "link"),
    ("stiffness", "orthoglide", "Q2", "none"),
    ("stiffness", "orthoglide", "Q2", "-y"),
    ("stiffness", "delta", "side", "none"),
    ("mobility", "par2"),
]


@pytest.fixture(scope="module")
def rows():
    assert set(PIECES) <= set(tasks())
    return gathered([row for task in PIECES for row in piece(task)])


@pytest.fixture(scope="module")
def study(rows):
    paths = {
        ("isotropic", sign, path.engine): path for sign in (1, -1) for path in curve("isotropic", f"{sign:+d}"[0])
    }
    return RobotStudy(rows, paths)


def test_the_study_takes_three_poses_each_and_every_load():
    asked = tasks()
    assert len([t for t in asked if t[0] == "stiffness" and t[1] == "orthoglide"]) == 3 + 3 * 6
    for name in ("3-puu", "delta", "par2"):
        assert len([t for t in asked if t[:2] == ("stiffness", name)]) == 3
    assert len([t for t in asked if t[0] == "critical"]) == 6


@pytest.mark.slow
def test_converged_engines_agree_and_only_the_papers_chains_buckle_when_pulled(rows):
    found = {(row.direction, row.engine): row for row in rows.critical}
    assert {engine for (way, engine), row in found.items() if way == "+x" and row.F_cr} == {"vjm-paper"}
    pressed = {engine: row for (way, engine), row in found.items() if way == "-x"}
    assert pressed["vjm-paper"].F_cr is None
    # Euler's load of the pair of bars, as for the chain alone
    for engine in ("vjm-16", "vjm-16f16", "exudyn"):
        assert pressed[engine].F_cr == pytest.approx(8849.0, rel=5e-4)
        assert pressed[engine].first_leg == "x"
        assert pressed[engine].shares["x"] > 0.999
        assert not pressed[engine].stopped


@pytest.mark.slow
def test_the_rows_that_decide_hold(study):
    found = robot_rows(study)
    assert len(found) == 10
    assert [row for row in found if not row.passed] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "change", "fails"),
    [
        ("stiffness", {"difference": 0.02}, "robots: stiffness"),
        ("critical", {"F_cr": 8000.0}, "robots: critical forces"),
        ("critical", {"shares": {"x": 0.1, "y": 0.9}}, "robots: legs that lose stability first"),
        ("critical", {"kind": "limit"}, "robots: kinds"),
        ("critical", {"stopped": "lost"}, "robots: paths complete"),
        ("misfit", {"vjm": 1.0}, "robots: a part too long"),
        ("mobility", {"rank": 5}, "robots: mobility"),
    ],
)
def test_what_is_off_fails_the_run(study, kind, change, fails):
    parts = {name: list(getattr(study.rows, name)) for name in Robots.model_fields}
    # of critical rows the refined engine pressed
    at = 6 if kind == "critical" else 0
    parts[kind][at] = parts[kind][at].model_copy(update=change)
    failed = [row.name for row in robot_rows(RobotStudy(Robots(**parts), study.curves)) if not row.passed]
    assert any(name.startswith(fails) for name in failed)


@pytest.mark.slow
def test_the_chapter_says_what_was_found(study):
    finding = robots(Run(load_chain("orthoglide-chain"), robots=study))
    text = " ".join(finding.sentences)
    assert "refined chains and finite elements agree within 0.021 %" in finding.title
    assert "8852 N at isotropic (leg x) with finite elements" in text
    assert "In all engines leg x loses stability first" in text
    assert "buckles at 2696 N at isotropic; no other does up to 12000 N" in text
    assert "none in orthoglide" in text
    tables = robot_tables(study.rows)
    assert [len(table.rows) for table in tables] == [3, 8, 12, 3]
    assert all("validate all --only robots" in table.caption for table in tables)
    for picture in robot_pictures(study):
        assert picture.content[:4] == b"\x89PNG"
        assert "validate all --only robots" in picture.caption


@pytest.mark.slow
def test_a_run_of_robots_only_is_compared_with_finite_elements(study):
    run = Run(load_chain("orthoglide-chain"), robots=study)
    assert no_finite_elements(run) is None
    assert no_finite_elements(Run(run.chain)) is not None


def test_a_run_without_the_study_has_no_chapter():
    assert robots(Run(load_chain("orthoglide-chain"))) is None
    assert robot_rows(None) == []


@pytest.mark.slow
def test_a_second_finite_element_program_is_asked_where_it_is_installed():
    if not available():
        pytest.skip("OpenSeesPy is an optional extra: it is not installed, or does not load")
    assert ("second", "isotropic") in tasks()
    (row,) = piece(("second", "isotropic"))
    assert (row.engine, row.direction) == ("opensees", "-x")
    # by bisection to 2e-3
    assert row.F_cr == pytest.approx(8849.0, rel=3e-3)


@pytest.mark.parametrize("pose", ["straight", "turned"])
def test_a_parallelogram_resists_by_its_bars_and_their_distance(pose):
    """Beam theory where it is straight, and Exudyn in either pose."""
    machine = load_model("parallelogram")
    ours = np.diag(platform_stiffness(VjmEngine(8, 8), machine, pose, np.zeros(6)))
    theirs = np.diag(platform_stiffness(ExudynEngine(elements=6), machine, pose, np.zeros(6)))
    # one solver stops at residuals of 1e-9: 3e-10 of an entry
    assert ours == pytest.approx(theirs, rel=2e-8, abs=1e-2)
    if pose == "straight":
        half, out_of_plane = 40.0, 24.0 * EI_SOFT / L**3
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
        assert ours == pytest.approx(expected, rel=1e-12, abs=1e-5)
