"""The likelihood in the dark finds the mean dark current, also below a spike a recording."""

import numpy as np
import pytest

from sensor.calibrate.censored import dark_likelihood

CYCLES = 4000


def record(dark: float, dsnu: float, sigma: float, pixels: int) -> tuple[np.ndarray, ...]:
    """Spikes, first and last of renewal processes in their stationary state."""
    rng = np.random.default_rng(1)
    d = dark * np.maximum(1 + dsnu * rng.standard_normal(pixels), 1e-9)
    most = int(2 * CYCLES * dark) + 8
    charge = 1 + sigma * rng.standard_normal((pixels, most))
    charge[:, 0] = (1 + sigma**2 + sigma * charge[:, 0] - sigma) * rng.uniform(size=pixels)
    at = np.ceil(np.cumsum(charge, axis=1) / d[:, None]) - 1
    spikes = (at < CYCLES).sum(axis=1)
    last = np.where(spikes, at[np.arange(pixels), np.maximum(spikes - 1, 0)], -1)
    return spikes, np.where(spikes, at[:, 0], -1), last


@pytest.mark.parametrize(
    ("expected", "dsnu", "sigma"),
    [(0.4, 0.1, 0.02), (0.9, 0.2, 0.01), (1.6, 0.07, 0.03), (3.6, 0.07, 0.05), (12.0, 0.2, 0.03)],
)
def test_the_mean_is_where_the_likelihood_is_highest(
    expected: float, dsnu: float, sigma: float
) -> None:
    dark, pixels = expected / CYCLES, 20_000
    data = record(dark, dsnu, sigma, pixels)

    def height(factor: float) -> float:
        mean = np.full(pixels, factor * dark)
        return float(dark_likelihood(*data, CYCLES, mean, (dsnu * mean) ** 2, sigma**2, 0.0).sum())

    step = 0.002
    low, middle, high = (height(1 + k * step) for k in (-1, 0, 1))
    curvature = (2 * middle - low - high) / step**2
    off = (high - low) / (2 * step) / curvature
    assert abs(off) < 4 / np.sqrt(curvature)
