"""Linear models and matrix structural analysis."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vjm.baselines import LinearEngine, MsaEngine
from vjm.baselines.msa import beam_element, msa_machine
from vjm.model.load_case import LoadCase
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, RigidOffset, Section
from vjm.rotations import translation
from vjm.statics import unloaded_stiffness
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
    msa, vjm = msa_machine(chain, q).end_stiffness(), unloaded_stiffness(Mechanism(chain), q)
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
    msa, vjm = msa_machine(chain, q).end_stiffness(), unloaded_stiffness(Mechanism(chain.refined(segments)), q)
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
        msa_machine(chain, nothing).end_stiffness(),
        unloaded_stiffness(Mechanism(chain), nothing),
        np.linalg.inv(series_compliance(chain)),
    ):
        # rounding: matrices of six rows
        assert np.abs(dimensionless(found - K)).max() < 1e-11 * size
