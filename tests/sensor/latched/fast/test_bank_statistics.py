"""Spikes of pixels that draw from the bank against renewal theory, in closed form.

Intervals of charge are Gamma(Q), and a run starts at a random instant. All sums of k intervals are
Gamma(k Q), so the distributions of counts and of latched intervals follow from that of Gamma.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt
import pytest
from scipy import stats
from scipy.special import gammainc

from cosim import PS, Light, Piece
from cosim.compute.opencl import Device
from sensor.latched.fast import FastPixels, PixelArray
from sensor.latched.fast.units import BANK, NOISE
from sensor.latched.pixel.model import ExactModel
from tests.sensor.latched.fast.test_fast import ALL, CLOCK

Values = npt.NDArray[np.float64]
THRESHOLDS = [100.0, 1000.0, 30_000.0]
WIDTH = 1008
"""Pixels of a row: 63 whole groups."""
FAR = 4.5
"""Standard deviations by which an estimate may be off."""


def words(
    device: Device, q: float, rate: float, rows: int, cycles: int, seed: int = 1
) -> npt.NDArray[np.uint32]:
    """Words (cycles / 32, rows, WIDTH) of pixels under one light, spikes a cycle."""
    shape = rows, WIDTH
    plane = np.full(shape, rate, np.float32)
    flags = np.full((rows, WIDTH // 16), BANK | NOISE, np.uint8)
    array = PixelArray(
        ExactModel(q, seed, ALL), shape, np.arange(rows * WIDTH, dtype=np.uint32), CLOCK,
        q * 40_000, flags=flags,
    )  # fmt: skip
    assert array.banked
    found = FastPixels(array, device).expose(Light((Piece(0, PS, plane, plane),)), 0, cycles)
    return found.reshape(-1, *shape)


@lru_cache(maxsize=8)
def counts(device: Device, q: float, rate: float, rows: int, cycles: int) -> npt.NDArray[np.int64]:
    """Spikes of each pixel, (rows, WIDTH)."""
    return np.bitwise_count(words(device, q, rate, rows, cycles)).sum(axis=0, dtype=np.int64)


def below(a: float, x: Values) -> Values:
    """E[(x - G)+] of G = Gamma(a, 1)."""
    return np.asarray(x if a == 0 else x * gammainc(a, x) - a * gammainc(a + 1, x))


def count_law(q: float, rate: float, cycles: int) -> tuple[npt.NDArray[np.int64], Values]:
    """Numbers of spikes and their probabilities for an equilibrium renewal process: P(N >= k) is
    E[(x - S(k-1))+ - (x - S(k))+] / q with x the charge and S(k) the sum of k intervals."""
    x, most = q * rate * cycles, rate * cycles
    spread = int(8 * np.sqrt(most / q)) + 4
    k = np.arange(max(int(most) - spread, 0), int(most) + spread + 2)
    at_least = np.array([
        (below((n - 1) * q, np.array(x)) - below(n * q, np.array(x))) / q if n else 1.0 for n in k
    ])  # fmt: skip
    return k[:-1], np.clip(at_least[:-1] - at_least[1:], 0, 1)


def latched_law(q: float, rate: float) -> tuple[npt.NDArray[np.int64], Values]:
    """Latched intervals in cycles and their probabilities: E[(1 - |X - k|)+] for an interval X that
    begins at a random place in a cycle."""
    mean, spread = 1 / rate, 1 / np.sqrt(q)
    k = np.arange(max(int(mean * (1 - 9 * spread)) - 2, 0), int(mean * (1 + 9 * spread)) + 3)
    edge = below(q, np.maximum(np.arange(k[0] - 1, k[-1] + 2), 0) * (q * rate)) / (q * rate)
    return k, np.clip(edge[2:] - 2 * edge[1:-1] + edge[:-2], 0, 1)


def moments(k: npt.NDArray[np.int64], law: Values) -> tuple[float, float]:
    mean = float((k * law).sum())
    return mean, float(((k - mean) ** 2 * law).sum())


def p_value(found: npt.NDArray[np.int64], k: npt.NDArray[np.int64], law: Values) -> float:
    """Chi-square of integers against a distribution, with rare values taken together."""
    assert law.sum() == pytest.approx(1, abs=1e-6)
    seen = np.bincount(np.clip(found, k[0], k[-1]) - k[0], minlength=k.size).astype(float)
    expected = law * found.size
    order = np.arange(k.size)
    common = np.flatnonzero(expected >= 60)
    group = np.clip(order, common[0], common[-1]) - common[0]
    seen, expected = np.bincount(group, seen), np.bincount(group, expected)
    if seen.size < 2:
        return 1.0
    return float(stats.chisquare(seen, expected * seen.sum() / expected.sum()).pvalue)


@pytest.mark.parametrize("rate", [0.0317, 0.2973, 0.61])
@pytest.mark.parametrize("q", THRESHOLDS)
class TestCounts:
    rows, cycles = 128, 1024

    def test_mean_variance_and_law(self, device: Device, q: float, rate: float) -> None:
        found = counts(device, q, rate, self.rows, self.cycles)
        k, law = count_law(q, rate, self.cycles)
        mean, variance = moments(k, law)
        assert mean == pytest.approx(rate * self.cycles, rel=1e-9)
        n = found.size
        assert abs(found.mean() - mean) < FAR * np.sqrt(variance / n)
        fourth = float(((k - mean) ** 4 * law).sum())
        error = np.sqrt((fourth - variance**2) / n)
        # Fano factor: variance over mean.
        assert abs(found.var() / mean - variance / mean) < FAR * error / mean
        assert p_value(found.ravel(), k, law) > 1e-4

    def test_neighbours_are_independent(self, device: Device, q: float, rate: float) -> None:
        found = counts(device, q, rate, self.rows, self.cycles)
        about = (found - found.mean()) / found.std()
        for lag in range(1, 17):
            pairs = about[:, lag:] * about[:, :-lag]
            assert abs(pairs.mean()) < FAR / np.sqrt(pairs.size), lag

    def test_sums_over_pixels_have_the_sum_of_variances(
        self, device: Device, q: float, rate: float
    ) -> None:
        found = counts(device, q, rate, self.rows, self.cycles)
        variance = moments(*count_law(q, rate, self.cycles))[1]
        for size in (16, WIDTH):
            sums = found.reshape(-1, size).sum(axis=1)
            ratio = sums.var() / (size * variance)
            assert abs(ratio - 1) < FAR * np.sqrt(2 / sums.size), size


def latched(device: Device, q: float, rate: float, rows: int) -> npt.NDArray[np.int64]:
    """Two successive latched intervals, (2, n), of all pixels that fire in one cycle: in it, their
    spikes are at random places."""
    start, cycles = int(4 / rate), 32 * int(np.ceil(9 / rate / 32))
    flat = words(device, q, rate, rows, cycles).reshape(-1, rows * WIDTH)
    octets = np.ascontiguousarray(flat.T).view(np.uint8)
    fired = np.unpackbits(octets, axis=1, bitorder="little")
    pixel, cycle = np.nonzero(fired[fired[:, start] == 1, start:])
    first = np.searchsorted(pixel, np.arange(pixel[-1] + 1))
    at = [cycle[first + n] for n in range(3)]
    assert (at[0] == 0).all() and (pixel[first + 2] == np.arange(pixel[-1] + 1)).all()
    return np.stack([at[1] - at[0], at[2] - at[1]])


@pytest.mark.parametrize(("q", "rate"), [
    (100.0, 0.0213), (1000.0, 0.0213), (30_000.0, 0.0213), (100.0, 0.2973), (1000.0, 0.2973),
    (30_000.0, 0.2973), (1000.0, 0.61),
])  # fmt: skip
def test_latched_intervals_have_their_law_and_correlation(
    device: Device, q: float, rate: float
) -> None:
    one, two = latched(device, q, rate, round(60 / rate**0.5))
    k, law = latched_law(q, rate)
    mean, variance = moments(k, law)
    n = one.size
    assert abs(one.mean() - mean) < FAR * np.sqrt(variance / n)
    fourth = float(((k - mean) ** 4 * law).sum())
    assert abs(one.var() - variance) < FAR * np.sqrt((fourth - variance**2) / n)
    assert p_value(one, k, law) > 1e-4
    # The variance of two intervals together is that of Gamma(2 Q).
    both = moments(*latched_law(2 * q, rate / 2))[1]
    expected = both / 2 / variance - 1
    found = np.mean((one - mean) * (two - mean)) / variance
    assert abs(found - expected) < FAR * 1.5 / np.sqrt(n)


@pytest.mark.slow
@pytest.mark.parametrize("q", THRESHOLDS)
def test_sums_over_a_million_pixels(device: Device, q: float) -> None:
    # Whole-chip sums of windows far apart: 400 of them give the variance to 7 %.
    rate, window, many = 0.2973, 64, 400
    sums = []
    for seed in range(8):
        found = words(device, q, rate, 992, window * many // 8, seed)
        each = np.bitwise_count(found).reshape(many // 8, window // 32, -1)
        sums.append(each.sum(axis=(1, 2), dtype=np.int64))
    variance = moments(*count_law(q, rate, window))[1] * 992 * WIDTH
    ratio = np.concatenate(sums).var() / variance
    assert abs(ratio - 1) < FAR * np.sqrt(2 / many)
