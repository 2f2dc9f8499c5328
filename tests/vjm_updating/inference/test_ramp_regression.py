"""A displacement that was driven steadily: its lines, what is not known of them, and who may not be believed."""

from dataclasses import replace

import numpy as np
import pytest

from vjm_updating.inference.fitting import Whitening
from vjm_updating.inference.noise import uncorrelated_noise
from vjm_updating.inference.observed import RampRegression, basis, pieces, steadiest, steady

SIGMA = 5e-4
"""Of the gauge, mm."""
NOISE = np.where(np.arange(6) < 1, 2.0, 1.0)
"""Of the force along x, N."""
STIFFNESS = 9000.0
"""N/mm."""


def load_case(times_over: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of sequences, each out, held and back, and the times of their readings."""
    ways = [np.linspace(0.0, 0.12, 13), np.full(5, 0.12), np.linspace(0.11, 0.0, 11)]
    times = [np.arange(13.0), 12.0 + np.array([4.0, 9.0, 20.0, 50.0, 90.0]), 102.0 + np.arange(1.0, 12.0)]
    u, t = np.concatenate(ways), np.concatenate(times)
    count = 2 * times_over
    sequence = np.repeat(np.arange(count), len(u))
    return sequence, np.concatenate([t + 300.0 * k for k in range(count)]), np.tile(np.r_[u, -1.3 * u], times_over)


def remembering(rng: np.random.Generator, sequence: np.ndarray, rho: float) -> np.ndarray:
    """Noise of unit size, autocorrelated within each sequence."""
    e = rng.standard_normal(len(sequence))
    for k in range(1, len(e)):
        if sequence[k] == sequence[k - 1]:
            e[k] = rho * e[k - 1] + np.sqrt(1.0 - rho**2) * e[k]
    return e


@pytest.mark.parametrize("rho", [0.0, 0.8])
def test_turns_and_holds_are_found_within_a_reading(rho):
    sequence, when, u = load_case()
    rng = np.random.default_rng(7)
    for _ in range(20):
        parts = pieces(sequence, when, u + SIGMA * remembering(rng, sequence, rho), SIGMA)
        assert [slanted for _, slanted in parts] == [True, False, True] * 2
        begins = [int(own[0]) for own, _ in parts]
        # the last reading of a ramp lies on the hold, too
        assert np.abs(np.array(begins) - [0, 13, 18, 29, 42, 47]).max() <= 1


def test_without_noise_every_reading_is_on_its_line():
    sequence, when, u = load_case()
    Q = basis(pieces(sequence, when, u, SIGMA), when)
    # round-off of a few dozen terms
    assert np.allclose(Q.T @ Q, np.eye(Q.shape[1]), rtol=0.0, atol=1e-12)
    assert np.allclose(Q @ (Q.T @ u), u, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("rho", [0.0, 0.7])
def test_what_is_not_known_of_the_lines_is_what_noise_makes_of_them(rho):
    sequence, when, u = load_case()
    own = RampRegression(basis(pieces(sequence, when, u, SIGMA), when), sequence, np.zeros(len(u)))
    rng = np.random.default_rng(3)
    draws = 4000
    off = np.array([own.regressed(u + remembering(rng, sequence, rho)) - u for _ in range(draws)])
    said = own.errors(rho)
    # a variance from that many draws is known to √(2/4000); four times that
    size = np.sqrt(np.einsum("ns,ns->n", said, said))
    bound = 4.0 * np.sqrt(2.0 / draws) * np.outer(size, size)
    assert (np.abs(off.T @ off / draws - said @ said.T) < bound).all()


def read(rng: np.random.Generator, jitter: float, times_over: int = 1) -> tuple[np.ndarray, ...]:
    """Readings of a spring that softens, by a drive that may tremble by so many of its gauge's deviations."""
    sequence, when, u = load_case(times_over)
    true = u + jitter * SIGMA * rng.standard_normal(len(u))
    force = np.full((len(u), 6), np.nan)
    force[:, 0] = STIFFNESS * (true - 0.8 * true**2) + NOISE[0] * rng.standard_normal(len(u))
    return sequence, when, true + SIGMA * rng.standard_normal(len(u)), force


def test_a_drive_that_trembles_is_known_by_its_forces():
    rng = np.random.default_rng(11)
    for _ in range(10):
        sequence, when, shown, force = read(rng, 0.0)
        found = steady(sequence, when, shown, SIGMA, force, NOISE)
        # the share's standard error is some 0.1 here; two of them are none
        assert found is not None
        assert found.throughout
        assert found.moved.max() < 0.35
        # a drive that moves as much as its gauge errs: forces follow half of it and more of what else is read
        sequence, when, shown, force = read(rng, 3.0)
        assert steady(sequence, when, shown, SIGMA, force, NOISE) is None


def test_the_share_that_forces_follow_is_what_the_drive_did():
    rng = np.random.default_rng(5)
    shares = []
    for _ in range(20):
        sequence, when, shown, force = read(rng, 0.6, 8)
        found = steady(sequence, when, shown, SIGMA, force, NOISE)
        assert found is not None
        shares.append(float(found.moved[0]))
    # 0.36 of 1.36; the share of 370 readings is known to 0.03, of which one is off by four at most; the mean of
    # twenty is known to 0.007, and polynomials, which take a little of both, put it 0.01 off
    assert np.abs(np.array(shares) - 0.36 / 1.36).max() < 0.12
    assert np.mean(shares) == pytest.approx(0.36 / 1.36, abs=0.03)


def test_a_drive_that_goes_by_steps_of_its_own_is_still_while_it_holds():
    rng = np.random.default_rng(13)
    ways = [np.linspace(0.0, 0.12, 13), np.full(12, 0.12), np.linspace(0.11, 0.0, 12), np.zeros(15)]
    u = np.tile(np.concatenate(ways), 2)
    held = np.tile(np.repeat([False, True, False, True], [len(way) for way in ways]), 2)
    sequence, when = np.repeat([0, 1], len(u) // 2), np.arange(float(len(u)))
    true = u + np.where(held, 0.0, 6.0 * SIGMA * rng.standard_normal(len(u)))
    shown = true + SIGMA * rng.standard_normal(len(u))
    force = np.full((len(u), 6), np.nan)
    force[:, 0] = STIFFNESS * true + NOISE[0] * rng.standard_normal(len(u))
    found = steady(sequence, when, shown, SIGMA, force, NOISE)
    assert found is not None
    assert not found.throughout
    # a step that happens to end near a hold may be taken for a part of it
    way = ~(held | np.roll(held, 1) | np.roll(held, -1))
    # what was read counts on the way, the mean while held, which twelve readings know to a third of the noise
    np.testing.assert_array_equal(found.regressed(shown)[way], shown[way])
    assert np.abs(found.regressed(shown) - true)[held].max() < 3.0 * SIGMA / np.sqrt(12.0)
    assert (found.moved[held] < 0.3).all()
    assert (found.errors(0.0)[way] == 0.0).all()


@pytest.mark.parametrize("flagged", [0, 2])
def test_outliers_of_the_force_do_not_hide_that_a_test_was_steady(flagged):
    rng = np.random.default_rng(2)
    sequence, when, shown, force = read(rng, 0.0)
    force[[8, 35][:flagged], 0] += 90.0
    assert steady(sequence, when, shown, SIGMA, force, NOISE) is not None


def test_nothing_is_believed_where_it_cannot_be_told():
    sequence, when, shown, force = read(np.random.default_rng(4), 0.0)
    # a force that does not feel the gauge's noise, and a displacement without any
    assert steady(sequence, when, shown, SIGMA, force, 50.0 * NOISE) is None
    assert steady(sequence, when, shown, 0.0, force, NOISE) is None
    # a gauge that sticks, or oscillates
    stuck = shown[3 * (np.arange(len(shown)) // 3)]
    assert steady(sequence, when, stuck, SIGMA, force, NOISE) is None
    swinging = shown + 3.0 * SIGMA * np.sin(2.0 * np.arange(len(when)))
    assert steady(sequence, when, swinging, SIGMA, force, NOISE) is None


def whitening(rho: float, moved: float) -> Whitening:
    """Of three channels that the displacement shakes."""
    sequence, when, u = load_case()
    own = RampRegression(basis(pieces(sequence, when, u, SIGMA), when), sequence, moved)
    present = np.zeros((len(u), 6), dtype=bool)
    present[:, :3] = True
    present[9, 1] = False
    gauge_sensitivity = np.array([4.0, 1.5, -2.0, 0.0, 0.0, 0.0]) * (1.0 + np.abs(u[:, None]))
    C = moved * gauge_sensitivity[:, :, None] * gauge_sensitivity[:, None, :] + np.diag(
        [4.0, 1.0, 2.25, 1.0, 1.0, 1.0]
    )
    C = np.where(present[:, :, None] & present[:, None, :], C, np.where(present[:, :, None], 0.0, np.eye(6)))
    factors = np.linalg.inv(np.linalg.cholesky(C))
    autoregression = replace(uncorrelated_noise(sequence, present), rho=np.full(6, rho))
    return Whitening(factors, autoregression, present, {0: own}, gauge_sensitivity[:, :, None] * np.eye(6)[0])


def dense(own: Whitening) -> np.ndarray:
    """The whitening of independent errors as a matrix, column by column."""
    plain = replace(own, steady={})
    on = np.flatnonzero(own.present)
    return np.column_stack([plain.flat(row.reshape(own.present.shape)) for row in np.eye(own.present.size)[on]])


@pytest.mark.parametrize(("rho", "moved"), [(0.0, 0.0), (0.6, 0.0), (0.3, 0.2)])
def test_residuals_become_independent_with_the_errors_of_lines_among_them(rho, moved):
    own = whitening(rho, moved)
    on = np.flatnonzero(own.present)
    L = dense(own)
    slow = own.slow.reshape(-1, own.slow.shape[2])[on]
    covariance = np.linalg.inv(L.T @ L) + slow @ slow.T
    whole = np.column_stack([own.flat(row.reshape(own.present.shape)) for row in np.eye(own.present.size)[on]])
    # round-off by the covariance's condition, 5e2
    assert np.allclose(whole @ covariance @ whole.T, np.eye(len(on)), rtol=0.0, atol=1e-12)
    assert np.allclose(
        own.flat(np.eye(6)[None] * own.present[:, :, None])[:, 0], own.flat(own.present * np.eye(6)[0])
    )
    # its determinant, but for what the autocorrelation alone makes of it; round-off of sums of some 200
    autoregression = np.linalg.slogdet(L.T @ L)[1] + replace(own, steady={}).determinant
    assert own.determinant == pytest.approx(np.linalg.slogdet(covariance)[1] + autoregression, abs=1e-10)


def test_likely_errors_of_lines_are_taken_away_and_outliers_say_little_of_them():
    own = whitening(0.5, 0.0)
    rng = np.random.default_rng(8)
    raw = own.slow @ (3.0 * rng.standard_normal(own.slow.shape[2]))
    left = own.without_slow(raw)
    assert np.linalg.norm(replace(own, steady={}).flat(left)) < 0.5 * np.linalg.norm(
        replace(own, steady={}).flat(raw)
    )
    flagged = np.zeros_like(raw)
    flagged[20, 0] = 120.0
    assert np.abs(own.without_slow(flagged) - flagged).max() < 0.05 * 120.0


def test_errors_of_lines_that_are_far_larger_than_a_reading_are_taken_away():
    """Against the closed form of Gaussian noise: of errors without noise nothing but their shrinkage is left."""
    own = whitening(0.5, 0.0)
    only = replace(own, steady={})
    raw = own.slow @ np.full(own.slow.shape[2], 30.0)
    V, r = only.flat(own.slow), only.flat(raw)
    gauss = r - V @ np.linalg.solve(np.eye(V.shape[1]) + V.T @ V, V.T @ r)
    assert np.abs(r).max() > 20.0
    # reason: the step at which the search ends, 1e-2 of a reading, times how slowly it may come near
    np.testing.assert_allclose(only.flat(own.without_slow(raw)), gauss, atol=0.1)


def stepped(seed: int, scatter: float, *, by_clock: bool) -> tuple[np.ndarray, ...]:
    """Sequences, clock, order, displacement, gauge and wrench of ramps that are even by the clock or by readings.

    Args:
        seed: of the noise.
        scatter: of the intervals between readings, relative.
        by_clock: whether the drive goes at a steady rate; else by even steps.
    """
    rng = np.random.default_rng(seed)
    n = 60
    order = np.tile(np.arange(2.0 * n), 2)
    clock = np.cumsum(1.0 + scatter * rng.standard_normal(4 * n))
    along = np.concatenate([t - t[0] for t in np.split(clock, 2)]) if by_clock else order
    sequence = np.repeat([0, 1], 2 * n)
    u = 0.002 * np.where(along < n, along, 2.0 * n - along) * np.where(sequence, -1.3, 1.0)
    force = np.full((4 * n, 6), np.nan)
    force[:, 0] = STIFFNESS * u + NOISE[0] * rng.standard_normal(4 * n)
    return sequence, clock, np.arange(4.0 * n), u, u + SIGMA * rng.standard_normal(4 * n), force


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("by_clock", [False, True])
def test_a_drive_is_even_by_the_clock_or_by_its_readings(seed, by_clock):
    sequence, clock, order, u, shown, force = stepped(seed, 0.05, by_clock=by_clock)
    found = steadiest(sequence, [clock, order], shown, SIGMA, force, NOISE)
    assert found is not None

    def error(path: RampRegression) -> float:
        return float(np.sqrt(np.mean((path.regressed(shown) - u) ** 2)) / SIGMA)

    # eight numbers of lines from 240 readings: 0.18 of the noise, whose square is known to a half
    assert error(found) < 0.33
    # over the other time alone nothing is believed, or the drive is off by more
    other = steady(sequence, order if by_clock else clock, shown, SIGMA, force, NOISE)
    assert other is None or error(other) > error(found)


def test_of_even_times_nothing_changes():
    sequence, clock, order, _, shown, force = stepped(0, 0.0, by_clock=False)
    found, usual = (
        steadiest(sequence, [clock, order], shown, SIGMA, force, NOISE),
        steady(sequence, clock, shown, SIGMA, force, NOISE),
    )
    assert found is not None
    assert usual is not None
    # round-off of bases over times that differ by a shift
    assert np.allclose(found.regressed(shown), usual.regressed(shown), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("gap", [False, True])
def test_a_drive_may_change_its_rate_by_some_per_cent_where_it_passes_zero(gap):
    """Ramps are programmed from zero to either side, and a reading at zero may be missing."""
    u = np.concatenate([np.arange(-11, 0) * 0.0378, np.arange(12) * 0.0364])
    keep = np.arange(len(u)) != 11 if gap else np.ones(len(u), dtype=bool)
    count, when = int(keep.sum()), np.arange(len(u), dtype=float)[keep]
    sequence = np.repeat(np.arange(8), count)
    read = np.tile(u[keep], 8) + 0.0011 * np.random.default_rng(2).standard_normal(8 * count)
    lines = basis(pieces(sequence, np.tile(when, 8), read, 0.0011), np.tile(when, 8))
    straight = (lines @ (lines.T @ read)).reshape(8, count)
    # one line through all of a ramp is 4e-3 beside it at its middle
    assert np.abs(straight - u[keep]).max() < 3.0 * 0.0011
    assert np.sqrt(np.mean((straight - u[keep]) ** 2)) < 0.6 * 0.0011
