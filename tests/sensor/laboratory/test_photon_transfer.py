"""A laboratory finds what was set: photon transfer on cameras whose parameters are known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from cosim.compute.draws import negative_binomial, poisson
from cosim.compute.streams import Stream
from cosim.light.radiometry import photons_per_lux
from sensor.frame_pixels import Exposed
from sensor.laboratory.bench import Bench
from sensor.laboratory.emva import Report, measure_camera
from sensor.laboratory.transfer import Estimate
from tests.sensor.laboratory.linear_camera import LinearPixels

SECONDS = 0.01
DARK_SECONDS = (0.001, 0.1, 0.2)
SHAPE = (24, 96)
FAR = norm.isf(0.5e-6)
"""Deviations that a right value passes once in a million."""


def bench(pixels: Any, area: float, **changes: Any) -> Bench:
    given: dict[str, Any] = {"rows": SHAPE[0], "levels": 10, "frames": 6, "stack": 24} | changes
    return Bench(pixels, area, SECONDS, DARK_SECONDS, **given)


def camera(number: int) -> LinearPixels:
    """A random linear camera whose noise spans a DN and whose darkness is clear of zero."""
    rng = np.random.default_rng(number)
    bits = int(rng.choice([8, 10, 12, 14, 16]))
    gain = (0.9 * 2**bits) / 10 ** rng.uniform(3.3, 5)
    read = max(10 ** rng.uniform(0.3, 1.3), 0.7 / gain)
    return LinearPixels(
        SHAPE, bits, gain, rng.uniform(0.1, 0.95), rng.uniform(3e-12, 1e-10),
        10 ** rng.uniform(2, 3.7), read * rng.uniform(0.3, 1), rng.uniform(0.004, 0.03), read,
        max(0.06 * 2**bits, 8 * gain * read), device_seed=number,
    )  # fmt: skip


def truths(p: LinearPixels) -> dict[str, float]:
    noise = math.hypot(p.read, math.sqrt(p.dark_current * SECONDS))
    rounded = math.hypot(noise, math.sqrt(1 / 12) / p.gain)
    return {
        "gain": p.gain, "responsivity": p.gain * p.efficiency, "quantum_efficiency": p.efficiency,
        "dark_noise": noise, "dark_current": p.dark_current,
        "dark_current_variance": p.dark_current, "dsnu": p.dsnu, "prnu": 100 * p.prnu,
        "least_photons": (rounded + 0.5) / p.efficiency,
    }  # fmt: skip


def away(report: Report, truth: dict[str, float]) -> dict[str, float]:
    """Deviations between what was found and what was set, by the figure's own limits."""
    far = {}
    for name, value in truth.items():
        found = report[name]
        side = found.high - found.value if value > found.value else found.value - found.low
        far[name] = abs(value - found.value) / side * norm.isf(0.005)
    return far


@pytest.mark.parametrize("number", [3, 11, 12])
def test_every_set_parameter_is_found_within_its_limits(number: int) -> None:
    pixels = camera(number)
    report = measure_camera(bench(pixels, pixels.area, seed=number))
    # Nine limits of 99 %: two that miss are a chance of 0.3 %, one beyond FAR of 1e-5.
    missed = {n for n, v in truths(pixels).items() if not report[n].holds(v)}
    assert len(missed) <= 1, missed
    assert max(away(report, truths(pixels)).values()) < FAR
    # The limits tell something: another camera is not this one.
    for name in ("gain", "responsivity", "quantum_efficiency", "dark_noise"):
        assert not report[name].holds(1.1 * truths(pixels)[name])
    assert report["prnu"].low > 0 and report["dsnu"].low > 0
    assert report.notes == ()


@pytest.mark.slow
def test_limits_hold_as_often_as_they_say() -> None:
    found: dict[str, list[float]] = {}
    missed, count = 0, 80
    for number in range(100, 100 + count):
        pixels = camera(number)
        report = measure_camera(bench(pixels, pixels.area, seed=number))
        for name, value in truths(pixels).items():
            m = report[name]
            missed += not m.holds(value)
            found.setdefault(name, []).append((m.value - value) * 2 * 2.576 / (m.high - m.low))
    # Figures of one camera hang together; as if all nine missed at once, 80 draws of 1 %: more
    # than 9 of them are a chance of 1e-7.
    assert missed <= 9 * 9
    for name, z in found.items():
        # Chi-square of 80 at 1e-6, either side; the larger of three variances is on the safe side.
        assert 0.45 < np.std(z) < 1.42, name
        assert abs(np.mean(z)) < FAR / math.sqrt(count) * 1.2, name


def test_saturation_is_where_the_clipped_variance_turns() -> None:
    pixels = LinearPixels(SHAPE, 10, 0.25, 0.6, 2e-11, 100, 3, 0, 8, 60)
    report = measure_camera(bench(pixels, pixels.area))
    photons = np.linspace(0.5, 1.3, 4000) * 1023 / 0.25 / 0.6
    mean, variance = np.array(
        [pixels.mean_variance(p / pixels.area / photons_per_lux(555), SECONDS) for p in photons]
    ).T
    sigma = np.sqrt(variance)
    a = (1023 - mean) / sigma  # the part of a normal law below the clip
    first = -norm.pdf(a) + a * norm.sf(a)
    second = norm.cdf(a) - a * norm.pdf(a) + a**2 * norm.sf(a)
    true = photons[np.argmax(variance * (second - first**2))]
    sat = report["saturation_photons"]
    assert sat.holds(true)
    assert (sat.high - sat.low) / sat.value < 0.05
    # Derived figures are of these.
    assert report["snr_max"].holds(math.sqrt(0.6 * true))
    decibel = 20 * math.log10(true / truths(pixels)["least_photons"])
    assert report["dynamic_range"].holds(decibel)
    electrons = report["saturation_electrons"]
    row = next(r for r in report.rows() if r["name"] == "saturation_photons")
    assert row["symbol"] == "mu_p.sat" and row["low"] < row["value"] < row["high"]
    assert electrons.value == pytest.approx(report["quantum_efficiency"].value * sat.value)


def test_rounding_that_hides_the_noise_is_told() -> None:
    pixels = LinearPixels(SHAPE, 8, 0.02, 0.6, 2e-11, 10, 3, 0.01, 2, 10)
    report = measure_camera(bench(pixels, pixels.area))
    assert "rounding hides" in report.notes[0]
    # The upper limit of the standard: 0.4/K.
    assert report["dark_noise"].value == pytest.approx(
        math.sqrt(0.24 - 1 / 12) / report["gain"].value
    )


@dataclass
class Multiplied:
    """Each photoelectron becomes 1 + a geometric number of mean g - 1: F^2 = 2 - 1/g."""

    times: float
    gain: float
    area: float = 2e-11
    shape = SHAPE
    bits = 14
    effects: Any = None

    def __post_init__(self) -> None:
        self.effects = {}

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> Any:
        numbers = np.arange(rows.lux_seconds.size, dtype=np.int64).reshape(rows.lux_seconds.shape)
        light = rows.lux_seconds * self.area * photons_per_lux(555) * 0.8
        n = poisson(light + 20, numbers, rows.frame, seed, Stream.IMAGER_SHOT)
        more = negative_binomial(n, self.times - 1, numbers, rows.frame, seed, Stream.IMAGER_GAIN)
        return np.minimum(np.rint(self.gain * (n + more)), 2**14 - 1).astype(np.uint16)


def test_multiplication_shows_as_gain_times_its_excess_noise() -> None:
    pixels = Multiplied(times=5.0, gain=0.4)
    report = measure_camera(bench(pixels, pixels.area, frames=4, stack=8))
    excess = 2 - 1 / 5
    truth = {"gain": 0.4 * 5 * excess, "quantum_efficiency": 0.8 / excess,
             "responsivity": 0.4 * 5 * 0.8}  # fmt: skip
    assert max(away(report, truth).values()) < FAR
    assert not report["gain"].holds(0.4 * 5)


@dataclass(frozen=True, eq=False)
class Bent(LinearPixels):
    """Charge x is read as x (1 - x/bend)."""

    bend: float = 1e5

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> Any:
        wide = LinearPixels(
            self.shape, 16, 1.0, self.efficiency, self.area, 0, 0, 0, 0, 0
        ).convert(rows, seed, frozenset({"shot noise"})).astype(float)  # fmt: skip
        value = self.black + self.gain * wide * (1 - wide / self.bend)
        return np.clip(np.rint(value), 0, (1 << self.bits) - 1).astype(np.uint16)


def test_linearity_error_is_that_of_the_curve() -> None:
    pixels = Bent(SHAPE, 12, 0.2, 0.5, 2e-11, 0, 0, 0, 0, 100, bend=100_000.0)
    report = measure_camera(bench(pixels, pixels.area, frames=8))
    end = report.transfer.saturated_photons
    x = np.array([s.photons for s in report.transfer.levels])
    x = x[(x >= 0.05 * end) & (x <= 0.95 * end)]
    e = 0.5 * x
    y = 0.2 * (e - (e + e**2) / 1e5)  # the mean of x^2 has Poisson's variance in it
    slope, level = np.polyfit(x, y, 1, w=1 / y)
    fit = level + slope * x
    true = 100 * np.abs((y - fit) / fit).mean()
    assert report["linearity_error"].holds(true)
    assert report["linearity_error"].low > 0.2


def test_a_quotients_limits_follow_from_its_parts() -> None:
    rng = np.random.default_rng(5)
    n, rho = 2500, 0.8
    # Closed form: var(a/b) = (a/b)^2 (va/a^2 + vb/b^2 - 2 cab/(a b)) / n.
    a, b, sa, sb = 5.0, 2.0, 1.0, 0.5
    true = (a / b) ** 2 * (sa**2 / a**2 + sb**2 / b**2 - 2 * rho * sa * sb / (a * b)) / n
    x, y = rng.standard_normal((2, 50, 50))
    first, second = a + sa * x, b + sb * (rho * x + math.sqrt(1 - rho**2) * y)
    quotient = Estimate.mean(first) / Estimate.mean(second)
    assert quotient.value == pytest.approx(first.mean() / second.mean())
    # A variance of 2500 is known to sqrt(2/2500); the largest of three (2500, 50 and 50 units)
    # is at most a few sqrt(2/50) above.
    assert true * (1 - FAR * math.sqrt(2 / n)) < quotient.variance < true * (1 + FAR * 0.2)


def test_what_a_column_shares_widens_the_limits() -> None:
    rng = np.random.default_rng(6)
    columns = 3.0 * rng.standard_normal(200)
    values = columns + rng.standard_normal((100, 200))
    # Closed form: 9/200 of the columns and 1/20000 of the pixels, not 10/20000.
    assert Estimate.mean(values).variance == pytest.approx(
        9 / 200 + 1 / 20000, rel=FAR * math.sqrt(2 / 200)
    )


@pytest.mark.parametrize(
    "changes", [{"rows": 25}, {"rows": 2}, {"levels": 2}, {"frames": 1}], ids=str
)
def test_a_bench_that_cannot_measure_is_refused(changes: dict[str, int]) -> None:
    pixels = camera(1)
    with pytest.raises(ValueError, match="bench"):
        bench(pixels, pixels.area, **changes)
    with pytest.raises(ValueError, match="2 dark exposures"):
        Bench(pixels, 1e-11, 0.01, (0.1, 0.1), rows=24)
