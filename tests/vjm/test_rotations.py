import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vjm.rotations import (
    displaced,
    displacement_between,
    frame,
    inverse_frame,
    rotate_matrix6,
    rotation_from_vector,
    rotation_vector,
    shift_compliance,
    skew,
    translation,
    turn,
)

EPS = np.finfo(float).eps
directions = st.integers(0, 2**31).map(lambda seed: np.random.default_rng(seed).standard_normal(3))
axes = directions.map(lambda v: v / np.linalg.norm(v))
angles = st.floats(0.0, np.pi - 1e-6)


@given(axes, angles)
def test_log_undoes_exp(axis, angle):
    v = axis * angle
    # rounding of R reaches the axis divided by sin(angle), which vanishes towards the half turn
    tolerance = 10.0 * EPS * (1.0 + angle / (np.pi - angle))
    assert np.abs(rotation_vector(rotation_from_vector(v)) - v).max() < tolerance


@given(axes, st.floats(-300.0, -3.0))
def test_small_rotations_keep_their_relative_accuracy(axis, exponent):
    v = axis * 10.0**exponent
    # a few roundings of numbers of the size of v itself; nothing of size one is subtracted
    assert np.abs(rotation_vector(rotation_from_vector(v)) - v).max() <= 4.0 * EPS * 10.0**exponent


@given(axes, angles)
def test_exp_agrees_with_an_independent_library(axis, angle):
    # ten roundings of numbers up to one
    expected = Rotation.from_rotvec(axis * angle).as_matrix()
    assert np.abs(rotation_from_vector(axis * angle) - expected).max() < 10 * EPS


def test_exp_of_zero_is_the_identity():
    assert np.array_equal(rotation_from_vector(np.zeros(3)), np.eye(3))
    assert np.array_equal(rotation_vector(np.eye(3)), np.zeros(3))


@given(axes)
def test_log_of_a_half_turn_is_refused(axis):
    R = 2.0 * np.outer(axis, axis) - np.eye(3)
    with pytest.raises(ValueError) as refusal:
        rotation_vector(R)
    assert "half turn" in str(refusal.value)


def test_quarter_turn_about_z_takes_x_to_y():
    # one rounding of cos(pi/2)
    assert turn([0, 0, 1], np.pi / 2) @ [1, 0, 0, 1] == pytest.approx([0, 1, 0, 1], abs=2 * EPS)
    assert skew([0, 0, 1]) @ [1, 0, 0] == pytest.approx([0, 1, 0], abs=0)


@given(axes, angles, axes, st.floats(0.0, 3.0), directions)
def test_displacement_between_undoes_displaced(axis, angle, axis2, angle2, shift):
    T = frame(rotation_from_vector(axis * angle), [100.0, -200.0, 300.0])
    d = np.concatenate([shift, axis2 * angle2])
    back = displacement_between(T, displaced(T, d))
    assert np.abs(back[:3] - shift).max() < 4 * EPS * 300.0  # positions of up to 300 mm are rounded
    # R Rᵀ is off the identity by the rounding of three products; the log divides by pi minus the angle
    assert np.abs(back[3:] - d[3:]).max() < 30.0 * EPS * (1.0 + angle2 / (np.pi - angle2))


def test_displaced_turns_about_world_axes_through_the_frames_own_origin():
    T = turn([1, 0, 0], np.pi / 2)
    T[:3, 3] = [5.0, 0.0, 0.0]
    moved = displaced(T, [0, 0, 2.0, 0, 0, np.pi / 2])
    assert moved[:3, 3] == pytest.approx([5, 0, 2], abs=0)
    # the frame's own z pointed along -y; a quarter turn about the world's z takes it to +x
    assert moved[:3, 2] == pytest.approx([1, 0, 0], abs=2 * EPS)


@given(axes, angles, directions)
def test_inverse_frame(axis, angle, p):
    T = frame(rotation_from_vector(axis * angle), p)
    assert np.abs(T @ inverse_frame(T) - np.eye(4)).max() < 20 * EPS * (1.0 + np.abs(p).max())


def test_shift_compliance_of_a_hinge_with_an_arm():
    # a hinge about z of compliance c; at the end of an arm a along x: a² c, a c, c, and nothing else
    c, a = 2e-6, 30.0
    hinge = np.zeros((6, 6))
    hinge[5, 5] = c
    expected = np.zeros((6, 6))
    expected[1, 1], expected[1, 5], expected[5, 1], expected[5, 5] = a * a * c, a * c, a * c, c
    assert shift_compliance(hinge, [a, 0, 0]) == pytest.approx(expected, rel=4 * EPS, abs=0)


@given(directions, directions)
def test_shifts_of_compliance_add_up(a, b):
    k = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    twice = shift_compliance(shift_compliance(k, a), b)
    assert np.abs(twice - shift_compliance(k, a + b)).max() < 50 * EPS * np.abs(twice).max()


def test_rotate_matrix6_turns_a_spring_along_x_to_y():
    spring = np.zeros((6, 6))
    spring[0, 0], spring[3, 3] = 7.0, 5.0
    expected = np.diag([0.0, 7.0, 0.0, 0.0, 5.0, 0.0])
    # cos(pi/2) is 6e-17
    assert rotate_matrix6(spring, turn([0, 0, 1], np.pi / 2)[:3, :3]) == pytest.approx(expected, abs=1e-15)


def test_translation_moves_the_origin_only():
    assert np.array_equal(translation([1, 2, 3]) @ [0, 0, 0, 1], [1, 2, 3, 1])
