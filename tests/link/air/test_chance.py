"""Vibration and scintillation have the law, the spectrum and the times that they should."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtri

from cosim import PS
from link.air.motion import DAMPING, resonance_step, vibration
from link.air.scintillation import Flicker, FlickerSeries, aperture_averaging, flicker, flicker_of
from link.theory.air import rytov
from tests.link.air.scenes import AIR, FIRST, OPTICS, make

Z = 4.9
"""Normal deviations of alpha 1e-6."""


def test_a_step_of_the_resonance_is_the_differential_equation() -> None:
    """Two steps are one of twice the time, and the stationary covariance stays."""
    turn, root = resonance_step(30.0, 50e-6)
    twice, root2 = resonance_step(30.0, 100e-6)
    assert turn @ turn == pytest.approx(twice, abs=1e-14)
    added = root @ root.T
    assert turn @ added @ turn.T + added == pytest.approx(root2 @ root2.T, abs=1e-13)
    assert twice @ twice.T + root2 @ root2.T == pytest.approx(np.eye(2), abs=1e-12)
    # The generator: x' = w y, y' = -w x - 2 z w y.
    w, short = 2 * math.pi * 30, 1e-9
    step, _ = resonance_step(30.0, short)
    generator = (step - np.eye(2)) / short
    assert generator == pytest.approx(np.array([[0, w], [-w, -2 * DAMPING * w]]), abs=1e-3)


def test_vibrations_variance_and_spectrum() -> None:
    """Standard deviation over independent seeds; the spectrum s^2 4 z w^3 / ((w^2 - v^2)^2 + (2 z w
    v)^2), one-sided in angular frequency over 2 pi, on a long run."""
    first = np.array([vibration(0.05, 30.0, 50e-6, 40, seed)[[0, 39]] for seed in range(500)])
    n = first[:, 0].size
    for at in (0, 1):
        found = (first[:, at] ** 2).mean() / 0.05**2
        assert abs(found - 1) < Z * math.sqrt(2 / n)
    # Correlation after 39 symbols: exp(-z w t) (cos + z / root sin).
    w, t = 2 * math.pi * 30, 39 * 50e-6
    root = math.sqrt(1 - DAMPING**2)
    exact = math.exp(-DAMPING * w * t) * (
        math.cos(root * w * t) + DAMPING / root * math.sin(root * w * t)
    )
    found = (first[:, 0] * first[:, 1]).mean() / 0.05**2
    assert abs(found - exact) < Z * math.sqrt((1 + exact**2) / n)
    step, count, blocks = 2e-3, 512, 60
    x = vibration(1.0, 30.0, step, count * blocks, 7)[:, 0].reshape(blocks, count)
    hann = np.hanning(count)
    power = np.abs(np.fft.rfft(x * hann, axis=1)) ** 2
    power = power.mean(axis=0) * 2 * step / (hann**2).sum()
    f = np.fft.rfftfreq(count, step)
    v = 2 * math.pi * f
    density = 8 * math.pi * DAMPING * w**3 / ((w**2 - v**2) ** 2 + (2 * DAMPING * w * v) ** 2)
    density /= math.pi  # to a cycle: 2 x 2 pi S(v) with the variance 1
    band = (f > 5) & (f < 60)
    ratio = power[band] / density[band]
    # Each bin's relative error is 1 / sqrt(blocks) where the spectrum is even over it.
    assert abs(np.median(ratio) - 1) < 0.05
    assert np.abs(ratio - 1).max() < Z / math.sqrt(blocks) + 0.1


def test_shifts_are_of_the_seed_alone() -> None:
    long, short = vibration(1.0, 30.0, 50e-6, 100, 5), vibration(1.0, 30.0, 50e-6, 40, 5)
    assert np.array_equal(long[:40], short)
    assert not np.array_equal(long, vibration(1.0, 30.0, 50e-6, 100, 6))
    assert not vibration(0.0, 30.0, 50e-6, 5, 5).any()
    air = make(effects=["vibration"], aim=_shaking())
    assert air.shift(FIRST + PS // 40_000) == pytest.approx(tuple(air.shifts[0]))
    assert air.shift(FIRST + 2 * PS // 40_000) == pytest.approx(tuple(air.shifts[1]))
    assert air.shift(FIRST - 1) == (0, 0)


def _shaking():  # type: ignore[no-untyped-def]
    from link.air import Aim

    return Aim(vibration=0.5, vibration_frequency=200.0)


def test_aperture_averaging_is_that_of_the_integral() -> None:
    """Weak turbulence, Kolmogorov, a spherical wave through a round lens: 8 pi^2 0.033 k^2 Cn2
    int int K^(-8/3) (1 - cos(K^2 z (L - z) / (k L))) (2 J1(K D z / 2 L) / (K D z / 2 L))^2 dK dz,
    z from the source: the constant 0.4 x 1.23, the lens's part, and Churnside's limit."""
    from scipy.special import j1

    k, length = 2 * math.pi / 555e-9, 200.0
    z = (np.arange(200) + 0.5) / 200 * length
    logs = np.linspace(math.log(1e-1), math.log(1e5), 5000)
    kappa = np.exp(logs)
    weight = kappa ** (-8 / 3) * kappa * (logs[1] - logs[0])

    def variance(diameter: float) -> float:
        total = 0.0
        for at in z:
            part = 1 - np.cos(kappa**2 * at * (length - at) / (k * length))
            x = np.maximum(kappa * diameter * at / (2 * length), 1e-9)
            total += float((weight * part * (2 * j1(x) / x) ** 2).sum())
        return 8 * math.pi**2 * 0.033 * k**2 * 1e-16 * total * length / 200

    point = variance(0.0)
    assert rytov(1e-16, 555e-9, length, "spherical") == pytest.approx(point, rel=0.02)
    for diameter in (0.003, 0.01, 0.05, 0.2):
        found = aperture_averaging(diameter, 555.0, length)
        assert found == pytest.approx(variance(diameter) / point, rel=0.02)
    d2 = k * 30.0**2 / (4 * length)
    large = aperture_averaging(30.0, 555.0, length)
    assert large == pytest.approx(1 / (0.214 * d2 ** (7 / 6)), rel=0.05)
    assert aperture_averaging(0.0, 555.0, length) == pytest.approx(1)


@pytest.mark.parametrize("air", [Flicker(0.04, None, 2e-3), Flicker(0.706, (4.39, 2.56), 2e-3)])
def test_flickers_index_and_time(air: Flicker) -> None:
    """Mean 1 and the index, over independent seeds; the Ornstein-Uhlenbeck correlation of the
    logarithm of log-normal light a symbol later."""
    series = [FlickerSeries(air, 1e-3, 1, seed) for seed in range(2500)]
    pairs = np.array([[one[0][0], one[1][0]] for one in series])
    for x in pairs.T:
        n = len(x)
        assert abs(x.mean() - 1) < Z * math.sqrt(air.index / n)
        fourth = ((x - x.mean()) ** 4).mean() / x.var() ** 2
        assert abs(x.var() / air.index - 1) < Z * math.sqrt((fourth - 1) / n)
    if air.shape is None:
        logs = np.log(pairs)
        found = np.corrcoef(logs.T)[0, 1]
        exact = math.exp(-0.5)
        assert abs(found - exact) < Z * (1 - exact**2) / math.sqrt(len(logs))
    # Limits that are each exceeded with at most 1 %.
    z = float(ndtri(0.01 if air.shape is None else 0.01 / 2))
    low, high = air.factors(np.array([[z, z], [-z, -z]]))
    outside = (pairs[:, 0] < low).mean(), (pairs[:, 0] > high).mean()
    assert max(outside) < 0.01 + Z * math.sqrt(0.01 / len(pairs))


def test_flicker_of_a_path() -> None:
    """100 m, 532 nm, 5 m/s: 1.5 ms. Averaged gamma-gamma keeps the index."""
    assert flicker(1e-14, 532.0, 100.0, 1e-6, 5.0).time == pytest.approx(1.459e-3, rel=1e-3)
    strong = flicker(1e-12, 555.0, 500.0, 0.02, 1.0)
    assert strong.shape is not None
    a, b = strong.shape
    assert 1 / a + 1 / b + 1 / (a * b) == pytest.approx(strong.index)
    point = flicker(1e-12, 555.0, 500.0, 1e-9, 1.0)
    assert strong.index == pytest.approx(
        point.index * aperture_averaging(0.02, 555.0, 500.0), rel=1e-6
    )
    assert flicker(0.0, 555.0, 5.0, 0.02, 1.0).index == 0
    assert math.isinf(flicker(1e-14, 555.0, 5.0, 0.02, 0.0).time)


def test_the_panels_light_flickers_and_nothing_else() -> None:
    """A small panel before a large lens is one patch."""
    strong = replace(AIR, structure=1e-9, glare=0.0, ambient=500.0)
    optics = replace(OPTICS, pitch=100e-6)
    air = make(air=strong, optics=optics, effects=["scintillation", "surroundings"])
    assert air.flicker.index > 1e-4 and air.patches.count == 1
    plain = make(air=replace(strong, structure=0.0), optics=optics, effects=["surroundings"])
    for symbol in (0, 3):
        (one,), (two,) = air._made([symbol]), plain._made([symbol])
        lit = two.first > two.first.max() * 0.9
        found = one.first[lit] / two.first[lit]
        assert found == pytest.approx(np.full(lit.sum(), air.factors[symbol]), rel=0.02)
        assert one.first[0, 0] == two.first[0, 0]
    law, patches = flicker_of(optics, strong)
    assert law == air.flicker and patches.shape == (1, 1)
