"""Linear models, matrix structural analysis and the loaded stiffness on frozen geometry."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from vjm.baselines import LinearEngine, MsaEngine, UnloadedJacobianEngine
from vjm.baselines.msa import beam_element, msa_stiffness
from vjm.continuation.path import EventKind
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import translation
from vjm.statics import Configuration, loaded_stiffness, stability, unloaded_stiffness
from vjm_updating.identify.experiments import series_compliance

SECTIONS = [Section(2e6, 3e7, 4e7, 5e7), Section(2e6, 3e7, 4e7, 5e7, 6e4, 7e4)]


def dimensionless(K):
    """Stiffness (6, 6) with translations in units of 310 mm: N mm."""
    unit = np.repeat([310.0, 1.0], 3)
    return K * unit[:, None] * unit


# --- matrix structural analysis -------------------------------------------------------------------


@pytest.mark.parametrize("section", SECTIONS, ids=["Bernoulli", "Timoshenko"])
def test_beam_element_with_a_fixed_root_is_the_textbook_cantilever(section):
    L, s = 120.0, section
    tip = np.linalg.inv(beam_element(section, L)[6:, 6:])
    expected = np.diag([
        L / s.EA, L**3 / (3 * s.EIz) + L / s.GAy, L**3 / (3 * s.EIy) + L / s.GAz, L / s.GJ, L / s.EIy, L / s.EIz,
    ])  # fmt: skip
    expected[1, 5] = expected[5, 1] = L**2 / (2 * s.EIz)
    expected[2, 4] = expected[4, 2] = -(L**2) / (2 * s.EIy)
    size = np.sqrt(np.diag(expected))
    # a 2×2 inversion with a determinant a quarter of its diagonal's product
    assert np.abs((tip - expected) / np.outer(size, size)).max() < 1e-13


@pytest.mark.parametrize("section", SECTIONS, ids=["Bernoulli", "Timoshenko"])
def test_beam_element_does_not_resist_rigid_motions(section):
    L, K = 120.0, beam_element(section, 120.0)
    assert np.array_equal(K, K.T)
    motions = np.vstack([np.eye(6), np.eye(6)])
    motions[7, 5], motions[8, 4] = L, -L  # turning about the root moves the tip
    # cancellation of entries of 12 EI/L³ times L
    assert np.abs(K @ motions).max() < 1e-14 * np.abs(K).max() * L
    assert np.linalg.matrix_rank(K, tol=1e-9 * np.abs(K).max() / L**2) == 6


@given(data=st.data())
def test_msa_equals_the_unloaded_virtual_joint_method(chains, data):
    chain = data.draw(chains)
    q = chain.posture("p")
    msa, vjm = msa_stiffness(chain, q), unloaded_stiffness(Mechanism(chain), q)
    # a constrained system of up to sixty unknowns whose stiffnesses differ by 1e6, against the chain without
    # its passive joints: what they take away is cancellation
    locked = Mechanism(chain)
    J = locked.kinematics(locked.configuration(q)).jacobian[:, locked.elastic]
    size = np.abs(dimensionless(np.linalg.inv(J @ locked.compliance @ J.T))).max()
    assert np.abs(dimensionless(msa - vjm)).max() < 1e-9 * size


@pytest.mark.parametrize("posture", "ABCD")
@pytest.mark.parametrize("segments", [1, 3])
def test_msa_of_the_orthoglide_is_that_of_beam_springs(chain, posture, segments):
    q = chain.posture(posture)
    msa, vjm = msa_stiffness(chain, q), unloaded_stiffness(Mechanism(chain.refined(segments)), q)
    # rounding: the same beams, split or not
    assert np.abs(dimensionless(msa - vjm)).max() < 1e-12 * np.abs(dimensionless(vjm)).max()


@pytest.mark.parametrize("engine", [LinearEngine(), MsaEngine()], ids=lambda engine: engine.label)
@pytest.mark.parametrize(("posture", "k0"), [("A", 3300), ("B", 1063), ("C", 15087), ("D", 1086)])
def test_linear_engines_draw_a_straight_line_without_events(chain, engine, posture, k0):
    path = engine.trace(chain, LoadCase(posture, -2.0, steps=4))
    assert path.events == ()
    assert path.complete
    assert path.s == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0], abs=1e-15)
    assert path.force == pytest.approx(path.tangent[0] * path.s, rel=1e-14)
    # printed to units; beams and matrices agree on the axial stiffness
    assert path.tangent[0] == pytest.approx(k0, abs=0.5)
    assert np.all(path.unstable == -1)


# --- loaded stiffness on frozen geometry ----------------------------------------------------------


def frozen(chain, posture):
    """K^F(J₀, H₀(F)) and its stability as functions of the wrench, on the geometry of the unloaded posture."""
    model = Mechanism(chain)
    x0 = model.configuration(chain.posture(posture))

    def at(wrench):
        return Configuration(model, x0, wrench, 0.0, 0)

    return lambda F: loaded_stiffness(at(F))[:, 0], lambda F: stability(at(F)).eigenvalue


@pytest.mark.parametrize(("posture", "force", "tolerance"), [
    ("A", 310.0 / (0.23 / 2.0), 1e-6),  # L/k_yy of two bars: exact, to the integration's tolerance and its event
    ("C", 2334.04, 0.005 / 2334.04),  # printed digits
])  # fmt: skip
def test_frozen_geometry_bifurcates_in_a_and_c(chain, posture, force, tolerance):
    path = UnloadedJacobianEngine().trace(chain, LoadCase(posture, 4.0))
    assert path.critical.kind is EventKind.BIFURCATION
    assert path.critical.force == pytest.approx(force, rel=max(tolerance, 1e-8))
    assert not path.complete
    assert "frozen geometry" in path.stopped
    assert path.s[-1] <= path.critical.s
    assert path.critical.stiffness_before > 0.0


@pytest.mark.parametrize(("posture", "force"), [("B", 2469.38), ("D", 2140.48)])
def test_frozen_geometry_has_a_stiffness_knee_in_b_and_d(chain, posture, force):
    path = UnloadedJacobianEngine().trace(chain, LoadCase(posture, 4.0))
    assert path.critical.kind is EventKind.STIFFNESS_KNEE
    assert path.unstable.max() == 0

    # the same integration by another method, with the same half of the unloaded stiffness
    rate, _ = frozen(chain, posture)
    half = 0.5 * rate(np.zeros(6))[0]

    def softened(_, F):
        return rate(F)[0] - half

    softened.terminal = True
    other = solve_ivp(lambda _, F: rate(F), (0, 4), np.zeros(6), "LSODA", events=softened, rtol=1e-9, atol=1e-6)
    # both integrate to 1e-8 or better; K^F changes fast here, so that the event is worth a hundred times that
    assert path.critical.force == pytest.approx(float(other.y_events[0][0][0]), rel=5e-8)
    assert path.critical.force == pytest.approx(force, abs=0.005)


@pytest.mark.parametrize("posture", "ABCD")
def test_frozen_geometry_has_no_event_in_compression(chain, posture):
    path = UnloadedJacobianEngine().trace(chain, LoadCase(posture, -4.0))
    assert path.events == ()
    assert path.complete


@pytest.mark.parametrize("posture", "BD")
def test_frozen_geometry_never_loses_stability_in_b_and_d(chain, posture):
    """K^F falls without bound as the eigenvalue falls, so that the force yields before it is zero."""
    rate, eigenvalue = frozen(chain, posture)
    exact = solve_ivp(lambda _, F: rate(F), (0, 4), np.zeros(6), "LSODA", rtol=1e-6, atol=1e-3)
    assert exact.success
    values = [eigenvalue(F) for F in exact.y.T]
    assert min(values) > 0.0
    # and it comes close: within a thousandth of its unloaded value
    assert min(values) < 1e-3 * values[0]


@pytest.mark.parametrize(("posture", "reported"), [("A", 2710.5), ("C", 2339.8), ("D", 2141.7)])
def test_published_like_loads_of_frozen_geometry_are_made_by_an_euler_step(chain, posture, reported):
    """dF = K^F(J₀, H₀(F)) dt in steps of 0.005 mm, reporting the first unstable one: 2711, 2340, 2142 N."""
    rate, eigenvalue = frozen(chain, posture)
    F, s, step = np.zeros(6), 0.0, 0.005
    while eigenvalue(F) > 0.0 and s < 4.0:
        F = F + rate(F) * step
        s += step
    assert s < 4.0
    assert F[0] == pytest.approx(reported, abs=0.1)  # printed digits
    # what exact integration says is lower by up to a step's worth of force, and in D no bifurcation at all
    path = UnloadedJacobianEngine().trace(chain, LoadCase(posture, 4.0))
    assert path.critical.force < F[0]
    if posture != "D":
        assert F[0] - path.critical.force < rate(np.zeros(6))[0] * step


def test_mounts_that_slide_and_turn_deflect_what_they_carry():
    along, about = (2e-5, 1e-5, 3e-5), (4e-10, 1e-10, 2e-10)
    mounts = [
        Joint(f"to {a}", axis, slides=True, passive=True, fixed=True, compliance=c)
        for a, axis, c in zip("xyz", np.eye(3), along, strict=True)
    ]
    mounts += [
        Joint(f"about {a}", axis, passive=True, fixed=True, compliance=c)
        for a, axis, c in zip("xyz", np.eye(3), about, strict=True)
    ]
    beam = Beam("bar", 120.0, section=SECTIONS[0])
    shift = np.array([30.0, -50.0, 80.0])
    chain = Machine("bracket", (*mounts, RigidOffset("arm", translation(shift)), beam), postures={"-": np.zeros(0)})
    x, y, z = shift + 120.0 * np.eye(3)[0]
    moved = np.eye(6)
    moved[:3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    K = np.linalg.inv(beam.beam_compliance() + moved @ np.diag([*along, *about]) @ moved.T)
    nothing = np.zeros(0)
    size = np.abs(dimensionless(K)).max()
    for found in (
        msa_stiffness(chain, nothing),
        unloaded_stiffness(Mechanism(chain), nothing),
        np.linalg.inv(series_compliance(chain)),
    ):
        # rounding: matrices of six rows
        assert np.abs(dimensionless(found - K)).max() < 1e-11 * size
