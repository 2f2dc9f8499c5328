"""OpenSees' beams on the pinned column and on the paper's chain, against closed forms and against Exudyn."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers.elements import needs_opensees

from vjm.continuation.path import EventKind
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.opensees import OpenSeesEngine
from vjm_fea.opensees.beams import ElementKind

pytestmark = needs_opensees

LENGTH, EA, EIZ = 310.0, 6.74e6, 4.3e7
EULER = np.pi**2 * EIZ / LENGTH**2


@pytest.fixture(scope="module")
def column():
    y, z = AXES["y"], AXES["z"]
    parts = (
        Joint("q1", y, passive=True),
        Joint("q2", z, passive=True),
        Beam("bar", LENGTH, section=Section(EA, 1.07e7, 2.07e8, EIZ)),
        Joint("q3", z, passive=True),
        Joint("q4", y, passive=True),
    )
    return Machine("column", parts, postures={"-": np.zeros(4)})


@pytest.fixture(scope="module")
def trace(orthoglide):
    @cache
    def traced(posture, to, steps, branch=1):
        return OpenSeesEngine().trace(orthoglide, LoadCase(posture, to, steps=steps, branch=branch))

    return traced


@pytest.mark.slow
# P (1 − P/EA) = π² EI/L². The linear element is π²/12 n² too stiff: its axial force knows the chord only. The bowed
# one is of fourth order, measured 0.27/n⁴; from it π²/12 n² · P/EA is taken off, as its bow is over the unstretched
# length, so that the error passes zero behind n = 16.
@pytest.mark.parametrize(
    ("element", "order", "error"),
    [
        (ElementKind.LINEAR, 2.0, lambda n: np.pi**2 / (12.0 * n**2)),
        (ElementKind.BOWED, 4.1, lambda n: 0.27 / n**4 - np.pi**2 / (12.0 * n**2) * EULER / EA),
    ],
)
def test_critical_load_of_the_pinned_column_converges_with_its_order(column, element, order, error):
    exact = 0.5 * EA * (1.0 - np.sqrt(1.0 - 4.0 * EULER / EA))
    meshes, errors = [4, 8, 16], []
    for n in meshes:
        event = OpenSeesEngine(n, element).trace(column, LoadCase("-", -0.25)).critical
        assert event.kind is EventKind.BIFURCATION
        assert event.switched
        errors.append(event.force / exact - 1.0)
    # the next terms are a sixteenth to a quarter of these on the coarsest mesh; events are located to 1e-9
    assert errors == pytest.approx([error(n) for n in meshes], rel=0.07, abs=1e-7)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.05)


def test_a_straight_column_is_pulled_like_a_rod(column):
    path = OpenSeesEngine(4).trace(column, LoadCase("-", 1.0))
    assert path.complete
    assert path.critical is None
    assert path.force[-1] == pytest.approx(EA / LENGTH, rel=1e-9)


@pytest.mark.parametrize(
    "mounts", [(), (Joint("frame", np.eye(3)[1], passive=True, fixed=True, compliance=1e-9),)], ids=["", "mount"]
)
@pytest.mark.parametrize("posture", "ABCD")
def test_unloaded_stiffness_is_the_lumped_model_s(orthoglide, linear_stiffness, posture, mounts):
    orthoglide = replace(orthoglide, parts=(*mounts, *orthoglide.parts))
    unloaded = OpenSeesEngine().problem(orthoglide, LoadCase(posture, 1.0)).unloaded()
    K = linear_stiffness(orthoglide.refined({"foot": 2, "link": 1}), orthoglide.posture(posture))
    # both are linear beam theory; two springs take the foot's section instead of its matrix
    assert unloaded.tangent == pytest.approx(K[0, 0], rel=1e-9)


@pytest.mark.slow
# The critical points of 32 Exudyn elements, extrapolated by their observed order.
@pytest.mark.parametrize(
    ("posture", "force", "displacement"), [("A", 8849.111, 2.867774), ("C", 7674.754, 0.524857)]
)
def test_compression_buckles_straight_postures(orthoglide, trace, posture, force, displacement):
    path = trace(posture, -4.0, 8)
    event = path.critical
    assert path.complete
    assert event.kind is EventKind.BIFURCATION
    assert event.switched
    # 16 elements: measured 3e-6 off
    assert event.force == pytest.approx(force, rel=5e-6)
    assert event.s == pytest.approx(displacement, rel=5e-6)
    assert np.all(path.unstable == 0)
    behind = path.s > event.s
    assert np.all(path.tangent[behind] > 0.0)
    assert np.max(path.tangent[behind]) < 0.01 * path.tangent[0]
    exudyn = ExudynEngine().trace(orthoglide, LoadCase(posture, -4.0, steps=8))
    grid = np.linspace(0.0, 4.0, 9)
    ours, theirs = (p.force[[int(np.argmin(np.abs(p.s - s))) for s in grid]] for p in (path, exudyn))
    # before buckling 4e-7; in the bow 8e-6, which is Exudyn's distance from its own 32 elements
    assert ours == pytest.approx(theirs, rel=2e-5, abs=1e-6)
    before = grid < event.s
    assert ours[before] == pytest.approx(theirs[before], rel=2e-6, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("posture", "force", "displacement", "last"),
    [("B", 7339.087, 8.54778, 8030.9), ("D", 6670.963, 8.36447, 7017.95)],
)
def test_oblique_postures_have_a_stiffness_knee(trace, posture, force, displacement, last):
    """Against 32 Exudyn elements, extrapolated."""
    path = trace(posture, -14.0, 14)
    event = path.critical
    assert path.complete
    assert event.kind is EventKind.STIFFNESS_KNEE
    # 16 elements: measured 4e-6; at the end 5e-5, where bending with torsion is of second order
    assert event.force == pytest.approx(force, rel=1e-5)
    assert event.s == pytest.approx(displacement, rel=1e-5)
    assert path.force[-1] == pytest.approx(last, rel=8e-5)


@pytest.mark.parametrize("posture", "ABCD")
def test_tension_has_no_critical_point(trace, posture):
    path = trace(posture, 4.0, 8)
    assert path.complete
    assert path.critical is None
    assert np.all(path.unstable == 0)
    assert np.all(path.force[1:] > 0.0)


def test_what_joints_leave_free_has_no_stiffness(orthoglide):
    """Turned about z, which the last joints but one leave free in B: no force, and no event made of rounding."""
    path = OpenSeesEngine(4).trace(orthoglide, LoadCase("B", 0.05, axis="rz"))
    assert path.complete
    assert path.critical is None
    assert path.tangent == pytest.approx(0.0, abs=0.0)
    assert path.force == pytest.approx(0.0, abs=1e-6)


@pytest.mark.slow
def test_the_two_branches_mirror_each_other(trace):
    up, down = (trace("A", -4.0, 8, *branch) for branch in ((), (-1,)))
    # the error measured is rounding alone
    assert down.force[-1] == pytest.approx(up.force[-1], rel=1e-9)
    for path, sign in ((up, 1.0), (down, -1.0)):
        change = path.points[-1].shape - path.critical.point.shape
        row, component = np.unravel_index(np.argmax(np.abs(change)), change.shape)
        assert np.sign(change[row, component]) == sign
        assert path.stations[row].part == "link"
        # the soft plane of the bar
        assert component == 2
