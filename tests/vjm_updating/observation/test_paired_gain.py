"""Whether a prediction is better beyond noise, by blocks of readings that err alike."""

import numpy as np
import pytest

from vjm_updating.inference.significance import PairedGain, Worth, paired_gain, student_isf

BLOCKS, EACH = 5, 40
BLOCK = np.repeat(np.arange(BLOCKS), EACH)


def drawn(rng, shift, scatter):
    """Errors of two predictions: their ratio is what each block has in common, of a mean and a scatter."""
    was = np.sqrt(rng.uniform(0.5, 1.5, (BLOCKS * EACH, 1)))
    common = shift + scatter * rng.standard_normal(BLOCKS)
    return was, was * np.exp(-0.5 * common[BLOCK][:, None])


@pytest.mark.parametrize("shift", [0.0, 0.15], ids=["alike", "better"])
def test_of_predictions_that_are_alike_five_in_a_hundred_seem_not(shift):
    rng = np.random.default_rng(4)
    found = []
    for _ in range(2000):
        was, now = drawn(rng, shift, 0.1)
        found.append(paired_gain(was, now, BLOCK, np.ones_like(was)).worth)
    shares = [np.mean([one is worth for one in found]) for worth in (Worth.BETTER, Worth.WORSE)]
    if shift:
        # 1.5 of the blocks' scatter, five of them: the noncentral t distribution says 0.74
        assert shares[0] == pytest.approx(0.74, abs=0.05)
    else:
        # standard errors of the shares are 0.0035
        assert shares == pytest.approx([0.025, 0.025], abs=0.014)


def test_readings_of_a_block_are_no_independent_witnesses():
    """Were they, differences that each block has in common would be sure of the wrong sign in most tests."""
    rng = np.random.default_rng(5)
    alone = np.arange(BLOCKS * EACH)
    by_block, by_reading = [], []
    for _ in range(300):
        was, now = drawn(rng, 0.0, 0.1)
        for found, block in ((by_block, BLOCK), (by_reading, alone)):
            found.append(paired_gain(was, now, block, np.ones_like(was)).worth is not Worth.ALIKE)
    assert np.mean(by_reading) > 0.5
    assert np.mean(by_block) < 0.1


def test_the_gain_by_hand():
    was, now = np.array([[3.0], [1.0], [2.0], [np.nan]]), np.array([[1.0], [1.0], [1.0], [5.0]])
    found = paired_gain(was, now, np.array([0, 0, 1, 2]), np.array([[1.0], [2.0], [1.0], [1.0]]))
    # blocks of weights 3 and 1 with the squares 11 and 4 before, 3 and 1 after
    ratio = np.log([11.0 / 3.0, 4.0])
    mean = (3.0 * ratio[0] + ratio[1]) / 4.0
    assert found == PairedGain(
        pytest.approx(np.sqrt(15.0 / 4.0)), 1.0, pytest.approx(mean),
        pytest.approx(np.sqrt(2.0 * ((3.0 * (ratio[0] - mean)) ** 2 + (ratio[1] - mean) ** 2)) / 4.0), 2,
    )  # fmt: skip
    assert student_isf(0.025, 4) == pytest.approx(2.776, abs=5e-4)


def test_a_gain_in_every_block_is_one_though_the_blocks_differ_by_factors():
    was = np.array([1.0, 2.0, 5.0, 10.0, 30.0])[:, None]
    found = paired_gain(was, np.full((5, 1), 0.1), np.arange(5), np.ones((5, 1)))
    assert found.worth is Worth.BETTER
    # all errors together must say so, too
    was[:4], now = 1.0, np.array([0.5, 0.5, 0.5, 0.5, 31.0])[:, None]
    assert paired_gain(was, now, np.arange(5), np.ones((5, 1))).worth is Worth.ALIKE


def test_the_noise_is_what_decides():
    found = PairedGain(2.0, 1.5, 0.5, 0.1, 5)
    assert found.worth is Worth.BETTER
    assert found.saved > found.noise
    assert found.saved == pytest.approx(1.0 - np.exp(-0.25))
    assert PairedGain(2.0, 1.8, 0.2, 0.1, 5).worth is Worth.ALIKE
    assert PairedGain(1.5, 2.0, -0.5, 0.1, 5).worth is Worth.WORSE


def test_of_one_block_nothing_is_known():
    assert paired_gain(np.full((4, 1), 2.0), np.ones((4, 1)), np.zeros(4, dtype=int), np.ones((4, 1))).worth is (
        Worth.ALIKE
    )
    assert paired_gain(np.full((2, 1), np.nan), np.ones((2, 1)), np.arange(2), np.ones((2, 1))) is None
