"""The frames of tracker and markers of a rigid robot, from positions that are made with known frames."""

import numpy as np
import pytest

from vjm.rotations import rotation_from_vector
from vjm_updating.poses.pose_study import align


@pytest.mark.parametrize("turn", [0.1, 1.5], ids=["a small cube", "everywhere"])
def test_the_frames_are_found_that_made_the_positions(turn):
    """Where a hand turns little, the marker's place and the tracker's frame do nearly the same."""
    rng = np.random.default_rng(2)
    R = np.array([rotation_from_vector(v) for v in rng.uniform(-turn, turn, (60, 3))])[:, None]
    p = rng.uniform(-150.0, 150.0, (60, 1, 3))
    Q, t, m = (
        rotation_from_vector([0.4, -1.0, 0.8]),
        np.array([500.0, -900.0, 300.0]),
        np.array([40.0, -25.0, 60.0]),
    )
    noise = 0.05
    y = (p + np.einsum("gkab,b->gka", R, m)) @ Q.T + t + rng.normal(0.0, noise, p.shape)
    frames, distance = align(R, p, y, np.full((60, 1, 3, 3), np.nan), np.array([200.0]), None)
    # nine of 180 readings are spent on the frames; a tenth is twice the standard deviation of a root mean square
    assert np.sqrt(np.mean(distance**2) / 3.0) == pytest.approx(noise * np.sqrt(171.0 / 180.0), rel=0.1)
    # a place is seen by the turns of the hand: standard deviation of noise over turn √(60/3), four of them
    assert np.abs(frames.m[0] - m).max() < 4.0 * noise / (turn * np.sqrt(20.0))
