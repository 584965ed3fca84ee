"""Dark subtraction: integer arithmetic, and what theory says is left of the fixed pattern."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy import stats

from imagers.ebaps.device.exposure import (
    TRUNCATION_VARIANCE,
    mean_of_four,
    residual_variance,
    subtract,
)
from imagers.ebaps.pixels import EbapsPixels
from imagers.ebaps.pixels.silicon import Silicon
from sensor.frame_pixels import Exposed

SHAPE = (128, 160)
N = SHAPE[0] * SHAPE[1]
ALPHA = 1e-6
# A large dark current: its pattern is far above the noise, and the noise is close to normal.
WARM = replace(Silicon(), dark=40_000.0)
PIXELS = EbapsPixels(SHAPE, volts=0.0, silicon=WARM)
KEPT = frozenset(PIXELS.effects)
TEMPORAL = frozenset({"silicon shot noise", "read noise"})
SECONDS = 0.02
K = WARM.dn_per_electron


def dark(frame: int, seconds: float = SECONDS, kept: frozenset[str] = KEPT) -> npt.NDArray:
    times = np.full(SHAPE[0], seconds)
    exposed = Exposed(np.zeros(SHAPE), times, 0 * times, 0, frame)
    return PIXELS.convert(exposed, 5, kept)


def within_chi_square(values: npt.NDArray[np.float64], variance: float) -> None:
    """The sample variance lies in the chi-square interval of so many normal values."""
    low, high = stats.chi2.ppf([ALPHA / 2, 1 - ALPHA / 2], N - 1) / (N - 1)
    assert low < values.var(ddof=1) / variance < high, values.var(ddof=1) / variance


def test_the_mean_of_four_is_a_sum_shifted() -> None:
    rng = np.random.default_rng(1)
    frames = rng.integers(0, 65_536, (4, 40, 50), dtype=np.uint16)
    exact = frames.astype(int).sum(axis=0)
    assert (mean_of_four(list(frames)) == exact // 4).all()
    full = [np.full((2, 2), 65_535, np.uint16)] * 4
    assert (mean_of_four(full) == 65_535).all()  # 18 bits on the way
    with pytest.raises(ValueError, match="4 dark frames"):
        mean_of_four(list(frames[:3]))


def test_what_the_shift_drops() -> None:
    frames = np.random.default_rng(2).integers(900, 1100, (4, 300, 300), dtype=np.uint16)
    dropped = frames.mean(axis=0) - mean_of_four(list(frames))
    assert dropped.mean() == pytest.approx(3 / 8, abs=5 * math.sqrt(5 / 64) / 300)
    assert dropped.var() == pytest.approx(TRUNCATION_VARIANCE, rel=0.02)


def test_nothing_goes_below_zero_or_above_full_scale() -> None:
    live, black = np.array([[5, 65_535]], np.uint16), np.array([[9, 0]], np.uint16)
    assert subtract(live, black).tolist() == [[0, 65_535]]
    assert subtract(live, black, 10).tolist() == [[6, 65_535]]


@pytest.mark.parametrize("mean", [-2000.0, 0.0, 300.0, 5000.0])
def test_clipping_lifts_the_mean(mean: float) -> None:
    """To that of a normal value with its negative values set to 0: m Phi(m/s) + s phi(m/s)."""
    values = np.random.default_rng(3).normal(mean, 600, 200_000)
    live = np.full(values.shape, 30_000, np.uint16)
    left = subtract(live, (30_000 - values).astype(np.uint16))
    clipped = mean * stats.norm.cdf(mean / 600) + 600 * stats.norm.pdf(mean / 600)
    # Converted values are whole numbers, rounded down.
    assert left.mean() == pytest.approx(clipped, abs=5 * 600 / math.sqrt(values.size) + 1)


class TestTheory:
    """Temporal variance of a dark frame, var; of what four darks leave, var/4 + 5/64 + var/L."""

    variance = PIXELS.mean_variance(0.0, SECONDS)[1]

    def test_before_subtraction_the_pattern_rules(self) -> None:
        pattern = (WARM.dsnu * WARM.dark * SECONDS) ** 2 + WARM.offset_spread**2
        raw = dark(0).astype(float).var()
        assert raw > 10 * self.variance
        assert raw == pytest.approx(pattern * K * K + self.variance, rel=0.1)

    @pytest.mark.parametrize("lives", [1, 8])
    def test_only_temporal_noise_is_left(self, lives: int) -> None:
        """Of the fixed pattern nothing: the residual of one frame, and of a mean of eight."""
        mean = mean_of_four([dark(n) for n in range(4)])
        left = np.mean([subtract(dark(4 + n), mean, 20_000) for n in range(lives)], axis=0)
        within_chi_square(left, residual_variance(self.variance, self.variance, lives))
        spread = math.sqrt(residual_variance(self.variance, self.variance, lives) / N)
        assert abs(left.mean() - 20_000 - 3 / 8) < 4.9 * spread

    def test_the_dark_mean_keeps_its_own_noise(self) -> None:
        """Against the true pattern (a frame without temporal noise): var/4 exactly."""
        mean = mean_of_four([dark(n) for n in range(4)]).astype(float)
        truth = dark(0, kept=KEPT - TEMPORAL).astype(float)
        # The truth is rounded as well: another 1/12.
        within_chi_square(mean - truth, residual_variance(self.variance) + 1 / 12)

    def test_three_or_five_darks_would_be_seen(self) -> None:
        """The interval is narrow enough to tell four darks from three or five."""
        low, high = stats.chi2.ppf([ALPHA / 2, 1 - ALPHA / 2], N - 1) / (N - 1)
        assert high < (1 / 3) / (1 / 4) and low > (1 / 5) / (1 / 4)

    def test_darks_of_another_exposure_leave_the_dark_currents_pattern(self) -> None:
        """Live at 20 ms, darks at 10 ms: DSNU x 10 ms stays, offsets go all the same."""
        mean = mean_of_four([dark(n, SECONDS / 2) for n in range(4)])
        left = subtract(dark(4), mean, 20_000).astype(float)
        half = PIXELS.mean_variance(0.0, SECONDS / 2)[1]
        temporal = residual_variance(half, self.variance)
        pattern = (WARM.dsnu * WARM.dark * K * (SECONDS - SECONDS / 2)) ** 2
        assert pattern > 5 * temporal
        # The pattern is gamma distributed of shape 1/dsnu^2: its excess kurtosis 6 dsnu^2 widens
        # the interval.
        scatter = math.sqrt((2 + 6 * WARM.dsnu**2) / N)
        assert abs(left.var() / (pattern + temporal) - 1) < 4.9 * scatter
        # And it is the device's own: what is left follows its map.
        assert np.corrcoef(left.ravel(), PIXELS.pattern.dark().ravel())[0, 1] > 0.9
