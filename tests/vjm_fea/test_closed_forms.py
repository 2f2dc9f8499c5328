"""Beams with answers in closed form: the cantilever, the pinned column, and Exudyn's own static solver."""

import itertools

import numpy as np
import pytest
from scipy.optimize import brentq

from vjm.continuation.path import EventKind
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES, displaced, frame, rotation_from_vector
from vjm_fea.exudyn.engine import ExudynEngine
from vjm_fea.exudyn.system import exu, items

LENGTH = 310.0
EA, EIY, EIZ, GJ = 6.74e6, 2.07e8, 4.3e7, 1.07e7
GA = EA / 2.6 * 5.0 / 6.0
BAR = Section(EA, GJ, EIY, EIZ, GA, GA)


def cantilever(**of_beam):
    return Machine("cantilever", (Beam("bar", LENGTH, section=BAR, **of_beam),), postures={"-": np.zeros(0)})


def column():
    y, z = AXES["y"], AXES["z"]
    parts = (
        Joint("q1", y, passive=True),
        Joint("q2", z, passive=True),
        Beam("bar", LENGTH, section=BAR),
        Joint("q3", z, passive=True),
        Joint("q4", y, passive=True),
    )
    return Machine("column", parts, postures={"-": np.zeros(4)})


def critical_load(shear):
    """Root of P (1 + P/GA − P/EA) = π² EI/L²: 4410.04 N, extensible and shearable; 4419.06 N without shear."""
    euler = np.pi**2 * EIZ / LENGTH**2
    flexibility = (1.0 / GA if shear else 0.0) - 1.0 / EA
    return brentq(lambda P: P * (1.0 + P * flexibility) - euler, 0.5 * euler, 1.5 * euler)


@pytest.mark.parametrize("shear", [True, False])
@pytest.mark.parametrize("elements", [1, 5])
def test_tip_compliance_of_a_cantilever_is_beam_theory(shear, elements):
    own, across = rotation_from_vector([0.3, -0.2, 0.9]), rotation_from_vector([-0.5, 0.1, 0.4])
    chain = cantilever(own_frame=own, section_frame=across, end_offset=np.array([20.0, -8.0, 5.0]))
    problem = ExudynEngine(elements=elements, shear=shear).problem(chain, LoadCase("-", 1.0))
    found = np.linalg.inv(problem.unloaded().stiffness)
    rigid = Section(EA, GJ, EIY, EIZ)
    reference = Beam(
        "bar", LENGTH, section_frame=across, end_offset=np.array([20.0, -8.0, 5.0]),
        section=BAR if shear else rigid,
    ).beam_compliance()  # fmt: skip
    turned = np.kron(np.eye(2), own)
    # the corrected element is exact in linear statics for any number; the locked arm's columns are
    # differences with a relative error near 1e-9
    scale = np.sqrt(np.diag(turned @ reference @ turned.T))
    assert (found - turned @ reference @ turned.T) / np.outer(scale, scale) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("corrected", "shear", "order", "table"),
    [
        (False, True, 2.0, {4: 5.2e-2, 8: 1.3e-2, 16: 3.2e-3}),
        (True, True, 3.5, {4: 3.7e-3, 8: 2.9e-4, 16: 3.0e-5}),
        (True, False, 4.0, {4: 3.4e-3, 8: 2.1e-4, 16: 1.0e-5}),
    ],
)
def test_critical_load_of_the_pinned_column_converges_with_its_order(corrected, shear, order, table):
    assert critical_load(shear=True) == pytest.approx(4410.04, abs=0.01)
    errors = []
    for n, known in table.items():
        engine = ExudynEngine(elements=n, shear=shear, corrected=corrected)
        event = engine.trace(column(), LoadCase("-", -0.25)).critical
        assert event.kind is EventKind.BIFURCATION
        errors.append(event.force / critical_load(shear) - 1.0)
        # the known errors, of an independent prototype where sheared, have two digits
        assert abs(errors[-1]) == pytest.approx(known, rel=0.05)
    observed = np.log2(np.abs(np.array(errors[:-1]) / errors[1:]))
    # under the corrected element's fourth order lies a second order of some P/GA and P/EA: with shear it shows
    # from 8 elements on (3.67, 3.27), without it bends the order the other way (4.00, 4.37)
    assert observed == pytest.approx(order, abs=0.4)


def test_no_bifurcation_of_the_column_in_tension():
    path = ExudynEngine(elements=4, shear=True).trace(column(), LoadCase("-", 1.0))
    assert path.complete
    assert path.critical is None
    # a straight bar: P L/EA, exact for this strain measure
    assert path.force[-1] == pytest.approx(EA / LENGTH, rel=1e-9)


def test_same_wrench_as_the_static_solver_of_exudyn():
    """The recipe by hand: locked joints, the end-effector's ground moved, SolveStatic in steps."""
    n, shift = 8, 60.0
    h = LENGTH / n
    mbs = (container := exu.SystemContainer()).AddSystem()
    section = exu.BeamSection()
    section.stiffnessMatrix = np.diag([EA, GA, GA, GJ, EIY, EIZ])
    # not along an axis, so that every component takes part
    R = rotation_from_vector([0.4, -0.3, 0.8])
    chain = Machine("bar", cantilever(own_frame=R).parts, postures={"-": np.zeros(0)})
    half = 0.5 * np.linalg.norm([0.4, -0.3, 0.8])
    quaternion = [np.cos(half), *(np.sin(half) / (2.0 * half) * np.array([0.4, -0.3, 0.8]))]
    nodes = [
        mbs.AddNode(items.NodeRigidBodyEP(referenceCoordinates=[*(R @ [i * h, 0, 0]), *quaternion]))
        for i in range(n + 1)
    ]
    for a, b in itertools.pairwise(nodes):
        mbs.AddObject(items.ObjectBeamGeometricallyExact(nodeNumbers=[a, b], length=h, sectionData=section))
    grounds = []
    for node, at in ((nodes[0], np.zeros(3)), (nodes[-1], R @ [LENGTH, 0, 0])):
        ground = mbs.AddObject(items.ObjectGround(referencePosition=at))
        markers = [
            mbs.AddMarker(items.MarkerBodyRigid(bodyNumber=ground)),
            mbs.AddMarker(
                items.MarkerNodeRigid(nodeNumber=node, localHT=exu.HT(rotation=R.T, translation=[0, 0, 0]))
            ),
        ]
        grounds.append((ground, at, mbs.AddObject(items.GenericJoint(markerNumbers=markers))))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.staticSolver.verboseMode = 0
    settings.staticSolver.newton.relativeTolerance = 1e-9
    settings.staticSolver.newton.absoluteTolerance = 1e-6
    ground, at, joint = grounds[-1]
    for s in np.linspace(0.0, shift, 13)[1:]:
        mbs.SetObjectParameter(ground, "referencePosition", at + np.array([0.0, s, 0.0]))
        mbs.SolveStatic(settings, updateInitialValues=True, showCausingItems=False)
    force = np.array(mbs.GetObjectOutput(joint, exu.OutputVariableType.ForceLocal))

    engine = ExudynEngine(elements=n, shear=True, corrected=False)
    path = engine.trace(chain, LoadCase("-", shift, axis="y"))
    assert path.complete
    # the force of a joint acts on its second marker; its solver stops at a relative 1e-9, some N in 1e5
    scale = np.linalg.norm(force)
    assert path.points[-1].wrench[:3] / scale == pytest.approx(force / scale, abs=1e-8)
    assert scale > 1e4
    del container


def test_displacement_is_imposed_about_world_axes():
    """A lone beam turned rigidly at its tip: the tip's station and the wrench's work say where it went."""
    chain = Machine("bar", cantilever().parts, base=frame(rotation_from_vector([0.2, 0.5, -0.1])),
                  postures={"-": np.zeros(0)})  # fmt: skip
    problem = ExudynEngine(elements=4).problem(chain, LoadCase("-", 0.1, axis="rz"))
    here = problem.solve(0.1, problem.unloaded())
    tip = chain.base @ frame(p=[LENGTH, 0.0, 0.0])
    # turning about the end-effector's own point leaves it in place, to rounding of 310 mm
    assert here.shape[-1] == pytest.approx(tip[:3, 3], abs=1e-9)
    back = displaced(tip, here.displacement)[:3, :3] @ tip[:3, :3].T
    assert back == pytest.approx(rotation_from_vector([0.0, 0.0, 0.1]), abs=1e-12)
    # work of the driven moment from here to there by the trapezium of two points, second order in the step
    there = problem.solve(0.1001, here)
    slope = (there.wrench[5] - here.wrench[5]) / 1e-4
    assert slope == pytest.approx(0.5 * (here.tangent + there.tangent), rel=6e-8)
