"""The library's models reproduce the paper's numbers and the handbooks' formulas.

Reference: A. Pashkevich, A. Klimchik, D. Chablat, "Nonlinear Effects in Stiffness Modeling of Robotic
Manipulators", (19), (20), (21), Tables I and II.
"""

import hashlib
from importlib import resources

import jsonschema
import numpy as np
import pytest

from vjm.io.model_file import library, load_chain, model_schema, read_document
from vjm.io.saint_venant import rectangle_torsion
from vjm.io.shapes import Rectangle, SquareTube
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Beam, Joint, JointKind
from vjm.rotations import AXES


@pytest.fixture(scope="module")
def orthoglide() -> Machine:
    return load_chain("orthoglide-chain")


def beam(chain: Machine, name: str) -> Beam:
    return next(part for part in chain.beams if part.name == name)


def unloaded_stiffness(chain: Machine, label: str) -> np.ndarray:
    """Upper-left block of the inverse of the paper's (18) at zero load, N, mm, rad."""
    model = Mechanism(chain)
    J = model.kinematics(model.configuration(chain.posture(label))).jacobian
    J_theta, J_q = J[:, model.elastic], J[:, model.passive]
    n = J_q.shape[1]
    matrix = np.block([[J_theta @ model.compliance @ J_theta.T, J_q], [J_q.T, np.zeros((n, n))]])
    # lengths in units of the link, or the entries differ by 1e6
    scale = np.diag([*np.repeat([1.0 / chain.characteristic_length, 1.0], 3), *np.ones(n)])
    return (scale @ np.linalg.inv(scale @ matrix @ scale) @ scale)[:6, :6]


def test_library_lists_names_with_titles():
    entries = dict(library())
    assert list(entries) == sorted(entries)
    assert {"orthoglide-chain", "pinned-column"} <= set(entries)
    for name, title in entries.items():
        chain = load_chain(name)
        assert (chain.name, chain.title) == (name, title)


def test_chain_is_equation_21(orthoglide):
    assert [part.name for part in orthoglide.parts] == ["actuator", "foot", "q1", "q2", "link", "q3", "q4"]
    drive = orthoglide.parts[0]
    assert isinstance(drive, Joint)
    assert (drive.kind, drive.slides) == (JointKind.ACTUATOR, True)
    assert drive.compliance == 0.0
    np.testing.assert_array_equal(drive.axis, AXES["x"])
    for joint, axis in zip(orthoglide.joints, "yzzy", strict=True):
        np.testing.assert_array_equal(joint.axis, AXES[axis])
    assert beam(orthoglide, "link").count == 2


def test_hash_is_of_the_file(orthoglide):
    raw = resources.files("vjm").joinpath("models", "orthoglide-chain.toml").read_bytes()
    assert orthoglide.sha256 == hashlib.sha256(raw).hexdigest()


def test_postures_are_table_1(orthoglide):
    s = np.pi / 6
    table = {"A": [0, 0, 0, 0], "B": [0, s, -s, 0], "C": [s, 0, 0, -s], "D": [s, s, -s, -s]}
    assert set(orthoglide.postures) == set(table)
    for label, q in table.items():
        np.testing.assert_allclose(orthoglide.posture(label), q, rtol=0, atol=1e-15)


def test_joint_frame_is_the_world(orthoglide):
    """(21): the base "includes also the foot transformation"; six decimals of a mm are written."""
    foot = beam(orthoglide, "foot")
    np.testing.assert_allclose(orthoglide.base[:3, 3] + foot.tip, np.zeros(3), atol=1e-6)
    np.testing.assert_array_equal(orthoglide.base[:3, :3], np.eye(3))
    model = Mechanism(orthoglide)
    end = model.kinematics(model.configuration(orthoglide.posture("A"))).end
    np.testing.assert_allclose(end[:3, 3], [310.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(end[:3, :3], np.eye(3), atol=1e-14)


@pytest.mark.parametrize(("label", "k_xx"), [("A", 3300.0), ("B", 1063.0), ("C", 15087.0), ("D", 1086.0)])
def test_unloaded_stiffness_along_x(orthoglide, label, k_xx):
    """N/mm; the repaired data's own K0 for Table II."""
    assert unloaded_stiffness(orthoglide, label)[0, 0] == pytest.approx(k_xx, rel=2e-3)


FOOT_DIGIT = {(1, 1): 1e-5, (1, 2): 1e-5, (2, 2): 1e-5, (1, 6): 1e-7, (2, 6): 1e-7, (3, 3): 1e-4,
              (3, 4): 1e-6, (3, 5): 1e-6, (4, 4): 1e-8, (4, 5): 1e-8, (5, 5): 1e-8, (6, 6): 1e-9}  # fmt: skip
"""Last printed digit of (19), 1-based; (4,5), printed as 0, takes that of its diagonal."""


def test_foot_beam_meets_19_within_rounding(orthoglide):
    foot = beam(orthoglide, "foot")
    assert foot.compliance is not None
    theory = foot.beam_compliance()
    for (i, j), digit in FOOT_DIGIT.items():
        assert abs(theory[i - 1, j - 1] - foot.compliance[i - 1, j - 1]) < 0.5 * digit, (i, j)
    absent = [(i, j) for i in range(1, 7) for j in range(i, 7) if (i, j) not in FOOT_DIGIT]
    for i, j in absent:
        assert abs(theory[i - 1, j - 1]) < 1e-18, (i, j)


BAR_DIGIT = {(1, 1): 1e-6, (2, 2): 1e-2, (2, 6): 1e-4, (4, 4): 1e-6, (5, 5): 1e-7, (6, 6): 1e-7}


def test_bar_beam_meets_20_but_for_its_stiff_plane(orthoglide):
    link = beam(orthoglide, "link")
    assert link.compliance is not None
    theory = link.beam_compliance() * link.count
    for (i, j), digit in BAR_DIGIT.items():
        assert abs(theory[i - 1, j - 1] - link.compliance[i - 1, j - 1]) < 0.5 * digit, (i, j)
    section = link.section
    assert section is not None
    quotients = [link.length / link.compliance[i, i] for i in (0, 3, 4, 5)]
    assert [section.EA, section.GJ, section.EIy, section.EIz] == pytest.approx(quotients, rel=1e-7)
    # at L = 310 (20) is not a beam in the plane of z: both entries that L enters are outside their rounding
    assert theory[2, 2] == pytest.approx(0.04805, rel=1e-6)
    assert link.compliance[2, 2] == 0.051
    assert theory[2, 4] == pytest.approx(-23.25e-5, rel=1e-6)
    assert link.compliance[2, 4] == -24e-5


def test_link_spring_is_half_the_bar(orthoglide):
    link = beam(orthoglide, "link")
    assert link.tip_compliance()[1, 1] == pytest.approx(0.115)


def test_pinned_column():
    chain = load_chain("pinned-column")
    (link,) = chain.beams
    assert (link.name, link.length) == ("link", 299.085)
    section = link.effective_section()
    E, w, t = 68948.0, 25.4, 3.175
    assert pytest.approx(E * w * t) == section.EA
    assert section.EIz == pytest.approx(E * w * t**3 / 12)
    assert section.EIy == pytest.approx(E * t * w**3 / 12)
    # the knife edges turn about the section's soft axis
    for joint in chain.joints:
        assert joint.kind is JointKind.FREE
        np.testing.assert_array_equal(joint.axis, link.section_in_chain[:3, 2])
    np.testing.assert_array_equal(chain.posture("straight"), np.zeros(2))


@pytest.mark.parametrize(
    ("ratio", "factor"), [(1.0, 0.1406), (1.5, 0.196), (2.0, 0.229), (4.0, 0.281), (10.0, 0.312)]
)
def test_rectangle_torsion(ratio, factor):
    """Timoshenko and Goodier, Theory of Elasticity, table of k1 for J = k1 (2a)³ 2b, three digits."""
    b = 3.0
    assert rectangle_torsion(ratio * b, b) == pytest.approx(factor * ratio * b**4, rel=2e-3)
    assert rectangle_torsion(b, ratio * b) == rectangle_torsion(ratio * b, b)


def test_shapes_stiffness():
    E, nu = 210000.0, 0.3
    G = E / 2.6
    tube = SquareTube(
        shape="square_tube", width_mm=20.0, wall_mm=2.0, youngs_modulus_MPa=E, poissons_ratio=nu
    ).stiffness()
    assert pytest.approx(E * (400 - 256)) == tube.EA
    assert tube.EIy == tube.EIz == pytest.approx(E * (20**4 - 16**4) / 12)
    # Bredt's closed cell with the walls' own torsion, and what the corners add: 4 % at this wall
    assert tube.GJ == pytest.approx(G * (18.0**3 * 2.0 + 4.0 / 3.0 * 18.0 * 2.0**3), rel=0.05)
    assert np.isinf([tube.GAy, tube.GAz]).all()
    flat = Rectangle(
        shape="rectangle", width_mm=10.0, thickness_mm=2.0, youngs_modulus_MPa=E, shear_modulus_MPa=8e4,
        shear_factor=5 / 6,
    ).stiffness()  # fmt: skip
    assert flat.GAy == flat.GAz == pytest.approx(8e4 * 20.0 * 5 / 6)
    assert pytest.approx(8e4 * rectangle_torsion(10.0, 2.0)) == flat.GJ


@pytest.mark.parametrize("name", [entry.name for entry in library()])
def test_library_keeps_to_the_schema(name):
    validator = jsonschema.Draft202012Validator(model_schema())
    assert list(validator.iter_errors(read_document(name).content)) == []
    assert list(validator.iter_errors({**read_document(name).content, "format": 2})) != []


def test_schema_names_every_kind():
    schema = model_schema()
    assert schema["additionalProperties"] is False
    assert set(schema["properties"]["parts"]["items"]["discriminator"]["mapping"]) == {
        "offset", "actuator", "mount", "beam", "joint", "link", "payload", "actuated", "coupled",
    }  # fmt: skip
    assert set(schema["required"]) == {"format", "name", "title", "source", "units", "parts", "postures"}
    assert "youngs_modulus_MPa" in schema["$defs"]["Rectangle"]["required"]
