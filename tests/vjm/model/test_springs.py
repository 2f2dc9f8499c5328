"""Virtual springs of beams: textbook compliances, and splitting that does not change the unloaded chain."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, Placement, Section
from vjm.model.springs import BeamColumnSpring
from vjm.rotations import AXES

ROUNDING = 1e-13
"""Of a few sums and products of entries, each compared with the size that its row and column give it."""


def relative_error(k, expected):
    """Largest error of a compliance over the geometric mean of the two diagonal entries that it couples."""
    size = np.sqrt(np.diag(expected))
    return np.abs((k - expected) / np.outer(size, size)).max()


def tip_compliance(model, q=None):
    """Compliance (6, 6) at the end-effector with the passive joints held: J k Jᵀ."""
    x = model.configuration(np.zeros(len(model.passive)) if q is None else q)
    J = model.kinematics(x).jacobian[:, model.elastic]
    return J @ model.compliance @ J.T


def test_cantilever_of_the_textbooks():
    L, s = 200.0, Section(EA=2e6, GJ=3e7, EIy=4e7, EIz=5e7, GAy=6e5, GAz=7e5)
    # a force at the tip: L³/3EI + L/GA, turning it by L²/2EI; a moment: L²/2EI and L/EI
    expected = np.zeros((6, 6))
    expected[0, 0] = L / s.EA
    expected[1, 1] = L**3 / (3 * s.EIz) + L / s.GAy
    expected[2, 2] = L**3 / (3 * s.EIy) + L / s.GAz
    expected[3, 3] = L / s.GJ
    expected[4, 4] = L / s.EIy
    expected[5, 5] = L / s.EIz
    expected[1, 5] = expected[5, 1] = L**2 / (2 * s.EIz)
    # up along +z is a turn about −y
    expected[2, 4] = expected[4, 2] = -(L**2) / (2 * s.EIy)
    assert relative_error(s.compliance(L), expected) < ROUNDING
    bernoulli = Section(s.EA, s.GJ, s.EIy, s.EIz).compliance(L)
    assert bernoulli[1, 1] == pytest.approx(L**3 / (3 * s.EIz), rel=ROUNDING)


def test_count_multiplies_every_stiffness():
    s = Section(1e6, 2e6, 3e6, 4e6, 5e5, 6e5)
    assert np.allclose(s.times(3).compliance(50.0) * 3, s.compliance(50.0), rtol=ROUNDING, atol=0)
    k = np.diag([1e-5, 1e-3, 1e-3, 1e-7, 1e-7, 1e-7])
    assert np.array_equal(Beam("b", 100.0, compliance=k, count=2).tip_compliance(), k / 2)


@given(data=st.data(), n=st.integers(1, 12), placement=st.sampled_from(list(Placement)))
def test_segments_have_together_the_compliance_of_the_whole(chains, data, n, placement):
    chain = data.draw(chains)
    split = chain.refined({beam.name: n for beam in chain.beams if beam.section is not None}, placement)
    q = chain.posture("p")
    whole, parts = (tip_compliance(Mechanism(c), q) for c in (chain, split))
    # sums over up to a hundred springs with levers
    assert relative_error(parts, whole) < 100 * ROUNDING


@pytest.mark.parametrize("placement", Placement)
def test_beam_with_a_rigid_arm_keeps_its_compliance_when_split(chain, placement):
    (foot,) = (beam for beam in chain.beams if beam.name == "foot")
    model = Mechanism(Machine("foot", (foot,)).refined({"foot": 7}, placement))
    turned = Machine("foot", (Beam("foot", 1.0, own_frame=foot.own_frame, compliance=foot.beam_compliance()),))
    # the matrix is read at the tip, wherever that is: only the frame's turn matters
    assert relative_error(tip_compliance(model), tip_compliance(Mechanism(turned))) < 10 * ROUNDING


def test_foot_as_a_beam_meets_every_printed_entry_of_19(chain, foot_printed):
    (foot,) = (beam for beam in chain.beams if beam.name == "foot")
    k = foot.beam_compliance()
    for (i, j), printed in foot_printed.items():
        # (19) prints two digits: half a unit of the last one
        unit = 10.0 ** (np.floor(np.log10(abs(printed))) - 1)
        assert abs(k[i - 1, j - 1] - printed) < 0.5 * unit, (i, j)
    # where (19) prints a zero, the beam has nothing that the digits of its neighbours would show
    printed_matrix = foot.compliance
    size = np.sqrt(np.diag(printed_matrix))
    assert np.abs(k / np.outer(size, size))[printed_matrix == 0.0].max() < 0.01


def test_link_as_a_beam_meets_20_but_for_the_stiff_plane(chain):
    (link,) = (beam for beam in chain.beams if beam.name == "link")
    beam, printed = 2 * link.beam_compliance(), link.compliance
    off = np.abs(beam - printed) / np.where(printed == 0.0, np.inf, np.abs(printed))
    # two-digit entries: (2,2) and (2,6) lie within half a unit of the last digit of 23 and 11
    assert off[1, 1] < 0.5 / 23
    assert off[1, 5] < 0.5 / 11
    # no single length meets both planes of (20): the stiff one is 6 % off at 310 mm
    assert off[2, 2] == pytest.approx(1 - 0.0480 / 0.051, abs=0.0001 / 0.051)


def test_two_thirds_rule_puts_the_spring_there():
    section = Section(1e6, 1e7, 1e7, 1e7)
    model = Mechanism(Machine("beam", (Beam("b", 90.0, section=section),)).refined(1, "two-thirds"))
    # the first virtual joint stands 60 mm from the root, 30 mm before the tip
    assert model.before[0][:3, 3] == pytest.approx([60, 0, 0], rel=1e-15)
    assert model.tail[:3, 3] == pytest.approx([30, 0, 0], rel=1e-15)


@pytest.mark.parametrize(
    ("segments", "said"),
    [({"none": 2}, "no beam 'none'"), ({"b": 0}, "at least one segment"), ({"m": 2}, "has no section")],
)
def test_impossible_splits_are_refused_by_name(segments, said):
    parts = (Beam("b", 1.0, section=Section(1, 1, 1, 1)), Beam("m", 1.0, compliance=np.eye(6)))
    with pytest.raises(ValueError) as refusal:
        Machine("c", parts).refined(segments)
    assert said in str(refusal.value)


def test_chain_refuses_equal_names_and_unknown_postures(chain):
    with pytest.raises(ValueError) as refusal:
        Machine("c", (Joint("q", AXES["z"], passive=True), Joint("q", AXES["y"], passive=True)))
    assert "q stands twice" in str(refusal.value)
    with pytest.raises(KeyError) as unknown:
        chain.posture("E")
    assert "A, B, C, D" in str(unknown.value)


def test_actuator_compliance_adds_to_the_chains_own(chain):
    c = 2e-6
    soft = tip_compliance(Mechanism(chain.with_actuator_compliance(c)))
    # the drive is the first part, its axis x: in posture A it deflects by c along x and does nothing else
    added = np.zeros((6, 6))
    added[0, 0] = c
    rigid = tip_compliance(Mechanism(chain))
    assert np.abs(soft - rigid - added).max() < 1e-15 * np.abs(rigid).max()


@given(
    load=st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6),
    axial=st.floats(-30.0, 30.0),
)
def test_beam_column_spring_is_conservative_and_firm_under_any_load(load, axial):
    """Its compliance is the derivative of its strain, symmetric, and positive definite under any axial force."""
    h = 20.0
    section = Section(EA=1e6, GJ=2e6, EIy=3e6, EIz=1e6)
    spring = BeamColumnSpring(section, h)
    euler = np.pi**2 * section.EIz / h**2  # of the segment alone
    unit = np.array([1e3, 1e3, 1e3, 1e4, 1e4, 1e4])
    reaction = np.array(load) * unit
    reaction[0] = axial * euler / 10.0
    compliance = spring.compliance(reaction)
    assert np.array_equal(compliance, compliance.T)
    step = 1e-4 * unit
    slope = [(spring.strain(reaction + d) - spring.strain(reaction - d)) / (2.0 * d.sum()) for d in np.diag(step)]
    size = np.sqrt(np.outer(np.diag(spring.unloaded), np.diag(spring.unloaded)))
    # central differences of a smooth law over 1e-4 of its loads, and rounding of the strain over that step
    assert np.abs((np.array(slope).T - compliance) / size).max() < 1e-5 * np.abs(compliance / size).max()
    without_moment = np.array([reaction[0], 0, 0, 0, 0, 0])
    assert np.linalg.eigvalsh(spring.compliance(without_moment) / size)[0] > 0.0


def test_beam_column_spring_is_the_exact_segment_to_the_fourth_order_in_its_load():
    """φ = 1/(z + √z cot √z) and ψ = 3(1 − √z cot √z)/(z √z cot √z), from the stability functions of a strut."""
    h, EI = 10.0, 2e6
    section = Section(EA=1e15, GJ=1.0, EIy=EI, EIz=EI)
    spring = BeamColumnSpring(section, h)
    error = []
    loads = np.array([0.1, 0.2, 0.4])
    for z in loads:
        root = np.sqrt(z)
        G = root / np.tan(root)
        compliance = spring.compliance(np.array([-4.0 * EI * z / h**2, 0, 0, 0, 0, 0]))
        rotation, shift = 1.0 / (z + G), 3.0 * (1.0 - G) / (z * G)
        error.append([
            abs(compliance[5, 5] / (h / EI * rotation) - 1.0),
            abs(compliance[1, 1] / (h**3 / (12 * EI) * shift) - 1.0),
        ])  # fmt: skip
    observed = np.polyfit(np.log(loads), np.log(np.array(error)), 1)[0]
    # the error is of order z⁵; the next term, of z⁶, bends the slope at z = 0.4
    assert np.all(observed > 4.7)
    assert np.all(np.array(error)[0] < 1e-5)
