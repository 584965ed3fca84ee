"""The bank of thresholds: its law against the distribution, its order, and its offsets."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from scipy import stats

from sensor.latched.effects import RESIDUAL, SHOT_NOISE
from sensor.latched.pixel.bank import LANES, PERIOD, SIZE, bank_of, has_bank, offsets
from sensor.latched.pixel.interval import threshold
from sensor.latched.pixel.model import ExactModel

LAWS = [(50.0, 0.0), (100.0, 5.0), (1000.0, 0.0), (1000.0, 50.0), (30_000.0, 0.0), (2e6, 0.0)]
BITS = 28


def model(q: float, sigma: float = 0.0, shot: bool = True, shift: float = 0.0) -> ExactModel:
    effects = (RESIDUAL, SHOT_NOISE) if shot else (RESIDUAL,)
    return ExactModel(q, 1, effects, threshold_noise=sigma, shift=shift)


def entries(of: ExactModel) -> npt.NDArray[np.float64]:
    """Thresholds of the bank in electrons, in their order."""
    return bank_of(of, BITS).values[:SIZE] * (of.mean / 2.0**BITS)


@pytest.mark.parametrize(("q", "sigma"), LAWS)
def test_mean_and_variance_are_those_of_the_distribution(q: float, sigma: float) -> None:
    found, variance = entries(model(q, sigma)), q + sigma**2
    # The exact tier's table is linear between its knots, which widens it by 2e-6 of the variance.
    assert found.var() == pytest.approx(variance, rel=5e-6)
    assert found.mean() == pytest.approx(q, abs=1e-5 * np.sqrt(variance))
    skew = 2 * q / variance**1.5
    assert stats.skew(found) == pytest.approx(skew, rel=0.005, abs=1e-4)
    # The outermost of 4096 shares lie at -3.7 and 3.7 standard deviations if the law is normal.
    score = (found - q) / np.sqrt(variance)
    assert -3.8 < score.min() < -3.1 and 3.6 < score.max() < 4.5


def test_threshold_noise_alone_and_a_shift_are_kept() -> None:
    quiet = entries(model(1000.0, 40.0, shot=False))
    assert quiet.mean() == pytest.approx(1000, abs=1e-3)
    assert quiet.std() == pytest.approx(40, rel=3e-6)
    assert abs(stats.skew(quiet)) < 1e-4
    moved = entries(model(1000.0, 0.0, shift=50.0))
    assert moved.mean() == pytest.approx(1050, abs=1e-3)
    assert moved.var() == pytest.approx(1000, rel=5e-6)


@pytest.mark.parametrize(("q", "sigma"), LAWS)
def test_every_share_of_probability_has_one_threshold(q: float, sigma: float) -> None:
    of = model(q, sigma)
    found = np.sort(entries(of))
    edges = np.linspace(0, 2**32, SIZE + 1)[1:-1].astype(np.uint32)
    limits = threshold(of.table(), edges) / of.q * of.mean
    # The stretch about the mean, 2e-4, moves the entries near the ends of their shares.
    slack = 1e-3 * np.sqrt(q + sigma**2)
    assert (found[:-1] <= limits + slack).all() and (found[1:] >= limits - slack).all()


@pytest.mark.parametrize(("q", "sigma"), LAWS)
def test_neighbours_in_a_cycle_are_uncorrelated(q: float, sigma: float) -> None:
    about = entries(model(q, sigma)) - q
    for lag in range(1, LANES):
        assert abs(np.mean(about * np.roll(about, lag))) < 1e-5 * about.var()


def test_it_is_made_once_for_all_runs_of_a_camera() -> None:
    one, two = model(1000.0), ExactModel(1000.0, 9, (SHOT_NOISE,), reset="hard", dead_time=0.1)
    assert bank_of(one, BITS) is bank_of(two, BITS)
    assert bank_of(one, BITS) is not bank_of(model(1000.0, 1.0), BITS)


def test_wide_laws_have_none() -> None:
    assert has_bank(model(50.0)) and not has_bank(model(40.0))
    assert not has_bank(model(1000.0, shot=False))
    with pytest.raises(ValueError, match=r"must spread by 0 to 0\.15, not those of 40 e"):
        bank_of(model(40.0), BITS)


def test_the_first_lanes_follow_the_last() -> None:
    values = bank_of(model(300.0), BITS).values
    assert values.size == SIZE + LANES
    np.testing.assert_array_equal(values[:LANES], values[SIZE:])


class TestOffsets:
    groups = np.arange(0, 16 * 4000, 16, dtype=np.uint32)

    @pytest.mark.parametrize("crossing", [0, 1, 2, 3])
    def test_they_are_uniform_and_independent_over_cycles_and_groups(self, crossing: int) -> None:
        cycles = np.arange(97, 97 + 128, dtype=np.uint32)
        at = offsets(self.groups[:, None], cycles[None, :], crossing, 7).astype(float)
        n = at.size
        counts = np.bincount((at / SIZE * 64).astype(int).ravel(), minlength=64)
        assert stats.chisquare(counts).pvalue > 1e-4
        about = at / SIZE - 0.5
        for lag in (1, 2, 3, 5, 8, 16, 31, 32, 33, 64):
            found = np.mean(about[:, lag:] * about[:, :-lag]) * 12
            assert abs(found) < 4.5 / np.sqrt(n / 2), lag
        for lag in (1, 2, 25, 63):
            found = np.mean(about[lag:] * about[:-lag]) * 12
            assert abs(found) < 4.5 / np.sqrt(n / 2), lag

    def test_crossings_of_a_cycle_are_independent(self) -> None:
        cycles = np.arange(128, dtype=np.uint32)[None, :]
        at = [offsets(self.groups[:, None], cycles, n, 3) / SIZE - 0.5 for n in range(4)]
        for a in range(4):
            for b in range(a):
                assert abs(np.mean(at[a] * at[b])) * 12 < 4.5 / np.sqrt(at[0].size)

    def test_they_differ_by_seed_and_repeat_after_the_period(self) -> None:
        cycles = np.full(self.groups.size, 12_345, np.uint32)
        one, two = (offsets(self.groups, cycles, 0, seed) for seed in (1, 2))
        assert np.mean(one == two) < 0.01
        again = offsets(self.groups, cycles.astype(np.uint64) + PERIOD, 0, 1)
        np.testing.assert_array_equal(one, again)
