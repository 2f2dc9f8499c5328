"""The Orthoglide chain of the paper, (21), with its foot and its parallelogram also known as beams."""

import numpy as np
import pytest

from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, Section
from vjm.rotations import AXES, rotation_from_vector


def _symmetric(entries):
    C = np.zeros((6, 6))
    for (i, j), value in entries.items():
        C[i - 1, j - 1] = C[j - 1, i - 1] = value
    return C


FOOT_19 = _symmetric(
    {
        (1, 1): 28e-5, (1, 2): -33e-5, (2, 2): 41e-5, (1, 6): -40e-7, (2, 6): 54e-7, (3, 3): 19e-4,
        (3, 4): 11e-6, (3, 5): -15e-6, (4, 4): 23e-8, (5, 5): 23e-8, (6, 6): 84e-9,
    }
)  # fmt: skip
BAR_20 = _symmetric(
    {
        (1, 1): 46e-6, (2, 2): 23e-2, (2, 6): 11e-4, (3, 3): 51e-3, (3, 5): -24e-5,
        (4, 4): 29e-6, (5, 5): 15e-7, (6, 6): 72e-7,
    }
)  # fmt: skip
LENGTH = 310.0


@pytest.fixture(scope="session")
def orthoglide():
    about_x = np.array([1.0, 0.0, 0.0])
    foot = Beam(
        "foot",
        146.5,
        own_frame=rotation_from_vector(-0.5 * np.pi * about_x),
        section_frame=rotation_from_vector([0.0, 0.0, np.deg2rad(50.3)]),
        end_offset=np.array([17.57, -8.74, 0.0]),
        section=Section(EA=7.5e7, GJ=6.40e8, EIy=6.32e8, EIz=1.744e9),
        compliance=FOOT_19,
        # as in the library: one spring whatever the number in the link
        own_segments=1,
    )
    bar = Beam(
        "link",
        LENGTH,
        own_frame=rotation_from_vector(0.5 * np.pi * about_x),
        # L/EA, L/GJ, L/EI are the diagonal of (20)
        section=Section(EA=LENGTH / 46e-6, GJ=LENGTH / 29e-6, EIy=LENGTH / 15e-7, EIz=LENGTH / 72e-7),
        compliance=BAR_20,
        count=2,
    )
    turn = np.pi / 6.0
    return Machine(
        "orthoglide",
        (
            foot,
            Joint("q1", AXES["y"], passive=True),
            Joint("q2", AXES["z"], passive=True),
            bar,
            Joint("q3", AXES["z"], passive=True),
            Joint("q4", AXES["y"], passive=True),
        ),
        postures={
            "A": np.zeros(4),
            "B": np.array([0.0, turn, -turn, 0.0]),
            "C": np.array([turn, 0.0, 0.0, -turn]),
            "D": np.array([turn, turn, -turn, -turn]),
        },
    )


@pytest.fixture(scope="session")
def linear_stiffness():
    """Unloaded stiffness (6, 6) of the lumped model, equation (5): one spring a beam is exact there."""
    from vjm.model.mechanism import Mechanism

    def stiffness(chain, q):
        model = Mechanism(chain)
        J = model.kinematics(model.configuration(q)).jacobian
        J_theta, J_q = J[:, model.elastic], J[:, model.passive]
        n = J_q.shape[1]
        A = np.block([[J_theta @ model.compliance @ J_theta.T, J_q], [J_q.T, np.zeros((n, n))]])
        return np.linalg.inv(A)[:6, :6]

    return stiffness
