"""The loop of the phase against its closed forms, and against clocks that drift and jitter."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov
from scipy.stats import chi2

from link.receiving.phasing import fit_phase
from link.receiving.steering import GAINS, LoopGains, PhaseLoop, centred
from link.receiving.synthesis import NOISE, Levels
from tests.link.receiving.test_phasing import BACKGROUND, ON, TRUE, witnesses

INTERVAL = 128
SIGMA = 0.005
"""Standard error of a measured phase, ticks."""


def held(
    intervals: int, drift: float, start: float, *, noise: float = 0.0, wander: float = 0.0,
    longer: float = 9.0, shorter: float = 9.0, seed: int = 0, grows: float = 0.0,
) -> tuple[np.ndarray, PhaseLoop]:  # fmt: skip
    """True phases at the begins of intervals, ticks. drift: in an interval, which grows by `grows`
    and walks by `wander`, RMS, from one to the next."""
    random = np.random.default_rng(seed)
    loop, phase, out = PhaseLoop(longer, shorter), start, []
    for n in range(intervals):
        out.append(phase)
        error = 0.03 if n == 0 else SIGMA
        seen = centred(phase + noise * random.standard_normal())
        correction = loop.correction
        loop.step(seen, error)
        drift += grows + wander * random.standard_normal()
        phase += drift - correction
    return np.array(out), loop


@pytest.mark.parametrize("damping", [0.3, math.sqrt(0.5), 1.0])
@pytest.mark.parametrize("frequency", [0.05, 0.25, 0.8])
def test_the_gains_have_the_poles_of_their_frequency_and_damping(
    frequency: float, damping: float
) -> None:
    gains = LoopGains.of(frequency, damping)
    pole = np.exp((-damping + 1j * math.sqrt(1 - damping**2)) * frequency)
    value = pole**2 - (2 - gains.alpha - gains.beta) * pole + 1 - gains.alpha
    assert abs(value) < 1e-12 and gains.beta > 0 and 0 < gains.alpha < 1


@pytest.mark.parametrize("gains", [GAINS, LoopGains.of(0.1, 1.0), LoopGains.of(0.8, 0.4)])
def test_the_noise_is_that_of_the_filters_covariance(gains: LoopGains) -> None:
    """The error of (x, d) after a measurement: e = (1 - K H) F e + K n; that of the lock is x + 2
    d of it."""
    share = np.array([[gains.alpha], [gains.beta]])
    move = np.array([[1.0, 1.0], [0.0, 1.0]])
    step = (np.eye(2) - share @ np.array([[1.0, 0.0]])) @ move
    covariance = solve_discrete_lyapunov(step, share @ share.T)
    two = np.array([1.0, 2.0])
    assert gains.noise == pytest.approx(two @ covariance @ two, rel=1e-9)


def test_the_lock_has_the_variance_of_the_closed_form() -> None:
    phases = held(60_000, 1e-3, 0.0, noise=SIGMA)[0][1000:]
    # Errors correlate over some 1 / (2 bandwidth) intervals: that many fewer are independent.
    count = phases.size * 2 * GAINS.bandwidth
    low, high = chi2.ppf([5e-4, 1 - 5e-4], count) / count
    assert low < np.mean(phases**2) / (SIGMA**2 * GAINS.noise) < high
    assert abs(phases.mean()) < 4 * SIGMA / math.sqrt(phases.size)


def test_a_constant_offset_leaves_no_error_and_acceleration_that_of_the_closed_form() -> None:
    assert abs(held(400, 100e-6 * INTERVAL, 0.2)[0][-1]) < 1e-12
    grows = 1e-6
    phases, _ = held(3000, 0.0, 0.0, grows=grows)
    assert phases[-1] == pytest.approx(grows * GAINS.lag, rel=1e-9)


@pytest.mark.parametrize("ppm", [-100, 0, 20, 100])
def test_any_phase_is_locked_in_a_few_intervals(ppm: float) -> None:
    for start in np.linspace(-0.49, 0.49, 15):
        # 2 counts of 10 ns a tick shorter, 25 longer: as the board of 1000 rows
        phases, loop = held(
            40, ppm * 1e-6 * INTERVAL, float(start), noise=SIGMA, longer=1.28, shorter=0.1024,
            seed=int(100 * start) + 50,
        )  # fmt: skip
        locked = np.array([centred(float(phase)) for phase in phases])
        assert np.abs(locked[6:]).max() < 0.1
        assert np.ptp(phases[6:]) < 0.2  # no slip
        assert abs(loop.drift - ppm * 1e-6 * INTERVAL) < 0.01


@pytest.mark.parametrize("ppm", [0, 20, 100])
def test_the_lock_holds_over_fifty_thousand_ticks(ppm: float) -> None:
    """Clocks that wander by 1 part per million from interval to interval, RMS."""
    for seed in range(20):
        random = np.random.default_rng(seed)
        phases, _ = held(
            400, ppm * 1e-6 * INTERVAL, random.uniform(-0.5, 0.5), noise=SIGMA,
            wander=1e-6 * INTERVAL, longer=1.28, shorter=0.1024, seed=seed,
        )  # fmt: skip
        assert max(abs(centred(float(phase))) for phase in phases[6:]) < 0.1


def test_without_measurements_the_drift_goes_on() -> None:
    loop, phase, drift = PhaseLoop(1.28, 0.1024), 0.2, 20e-6 * INTERVAL
    for n in range(80):
        correction = loop.correction
        loop.step(phase if n < 40 else None, SIGMA)
        phase += drift - correction
    assert abs(phase) < 1e-3


def test_a_phase_beyond_the_blank_rest_is_reached_by_longer_ticks() -> None:
    loop = PhaseLoop(1.28, 0.1)
    loop.step(-0.4, 0.03)
    assert loop.correction == pytest.approx(0.6, abs=0.05)
    loop = PhaseLoop(1.28, 0.6)
    loop.step(-0.4, 0.03)
    assert loop.correction == pytest.approx(-0.4, abs=0.05)


def test_the_phases_standard_error_is_that_of_cramer_and_rao() -> None:
    """Delays of model pixels scatter about the true one by the inverse of the likelihood's
    information, light and background being unknown as well."""
    late, levels = 0.05, Levels(1.3, 0.02, "hard", 0.0)
    at = replace(TRUE, first=TRUE.first - late)
    found = [fit_phase(witnesses("hard", seed), at, levels)[0] for seed in range(30)]
    off = np.array([(one.ticks - late) / one.error for one in found])
    low, high = chi2.ppf([5e-4, 1 - 5e-4], off.size)
    assert low < np.sum(off**2) < high
    assert max(one.error for one in found) < 0.02
    fitted = fit_phase(witnesses("hard"), at, levels)[1]
    assert (fitted.on, fitted.background) == pytest.approx((ON, BACKGROUND), abs=0.02)
    assert fitted.noise == NOISE
