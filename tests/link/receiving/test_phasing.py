"""The fit of the timing against witnesses of known timing, and the pace against a line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import approx_fprime, minimize

from link.receiving import phasing
from link.receiving.pacing import Delay, Pace
from link.receiving.phasing import fit_timing, measure_delay
from link.receiving.synthesis import NOISE, RULES, Levels, Witnesses, likelihood
from link.timing import Timing

ROWS, COUNT, SYMBOLS, TICKS = 600, 1200, 40, 70
TRUE = Timing(8.37, 2 / (1 + 300e-6), 0.03, ROWS)
ON, BACKGROUND = 1.4, 0.03
TOLD = replace(TRUE, first=TRUE.first - 0.11, period=2.0, slope=0.0)
"""What pilots say of it."""


def witnesses(rule: str, seed: int = 6) -> Witnesses:
    """Pixels as the model has them: their charge at a tick's end is compared with a threshold that
    scatters by NOISE. Each sees a cell of its own."""
    rng = np.random.Generator(np.random.Philox(key=seed))
    rows = np.sort(rng.integers(0, ROWS, COUNT)).astype(np.float64)
    light = (rng.random((COUNT, SYMBOLS)) < 0.5) * rng.uniform(0.9, 1, (COUNT, 1))
    bits = np.zeros((COUNT, TICKS), np.uint8)
    start, charge = TRUE.start(0, rows), np.full(COUNT, 0.5)
    each = np.arange(COUNT)
    for k in range(TICKS):
        at = (10 + k - start) / TRUE.period
        n = np.floor(at).astype(int)
        ends = start + (n + 1) * TRUE.period
        share = np.clip(10 + k + 1 - ends, 0, 1)
        charge += ON * ((1 - share) * light[each, n] + share * light[each, n + 1]) + BACKGROUND
        fired = charge + NOISE * rng.standard_normal(COUNT) > 1
        bits[:, k] = fired
        rest = np.maximum(charge - 1, 0)
        left = {"hard": 0 * rest, "residual": rest % 1, "subtract": rest}[rule]
        charge = np.where(fired, left, np.minimum(charge, 1))
    return Witnesses(rows, rows, light, 0, bits, 10, COUNT)


@pytest.mark.parametrize("rule", RULES)
def test_the_slope_of_the_likelihood_is_that_of_differences(rule: str) -> None:
    w = witnesses(rule)
    at = np.array([0.05, 1.33, 0.04, 0.02, 0.03])
    nats, slope, bend = phasing._derivatives(w, TOLD, at, rule)
    assert nats == pytest.approx(
        len(w.rows) * (TICKS - 4)
        * likelihood(w, phasing._moved(TOLD, w, at[0], at[3], at[4]), at[1], at[2], rule)
    )  # fmt: skip
    by_steps = approx_fprime(at, lambda x: phasing._derivatives(w, TOLD, x, rule)[0], 1e-6)
    assert slope == pytest.approx(by_steps, rel=1e-3, abs=1)
    assert np.linalg.eigvalsh(bend)[0] > 0


@pytest.mark.parametrize("rule", RULES)
def test_a_known_timing_is_found_in_few_passes(rule: str) -> None:
    w = witnesses(rule)
    fit = fit_timing(w, TOLD, 300.0)
    assert fit.levels.reset == rule and fit.passes < 40
    # five numbers, alpha 1e-6: five standard errors each
    _, _, bend = phasing._derivatives(w, TRUE, np.array([0, ON, BACKGROUND, 0, 0]), rule)
    error = np.sqrt(np.diag(np.linalg.inv(bend)))
    middle = (10 + TICKS / 2 - TRUE.first) / TRUE.period
    late = fit.timing.start(middle, ROWS / 2) - TRUE.start(middle, ROWS / 2)
    found = (
        late, fit.levels.on - ON, fit.levels.background - BACKGROUND,
        fit.timing.slope - TRUE.slope, (fit.timing.period / TRUE.period - 1) * TICKS,
    )  # fmt: skip
    assert (np.abs(found) < 5.2 * error).all(), found / error
    assert fit.drift <= error[4] / TICKS * 1.5  # the pilots' period helps
    assert error[0] < 0.01


def test_the_top_is_that_of_a_long_simplex_from_any_start() -> None:
    w = witnesses("hard").some(200)
    held, free = np.array([np.inf, np.inf, np.inf, 0.1, 0.02]), np.ones(5, np.bool_)
    prior = 1 / held**2

    def cost(x: npt.NDArray[np.float64]) -> float:
        nats = phasing._derivatives(w, TOLD, np.array([x[0], *np.abs(x[1:3]), *x[3:]]), "hard")[0]
        return float(x**2 @ prior) / 2 - nats

    start = np.array([0.1, 1.4, 0.03, 0, 0])
    shape = np.vstack([start, start + np.diag([0.05, 0.1, 0.02, 0.03, 0.01])])
    slow = minimize(cost, start, method="Nelder-Mead", options={
        "initial_simplex": shape, "maxfev": 600, "xatol": 1e-5, "fatol": 1e-3})  # fmt: skip
    for first in ([-0.2, 1.1, 0.1, 0.1, 0.0], [0.3, 1.9, 0.0, -0.1, 0.01], [0.1, 1.4, 0.2, 0, 0]):
        top = phasing._climb(w, TOLD, np.array(first), "hard", free, held, 0.02)
        assert top.passes < 40
        assert -top.nats < slow.fun + 0.1


@pytest.mark.parametrize("late", [-0.2, 0.0, 0.13])
def test_a_look_says_how_late_symbols_are(late: float) -> None:
    w = witnesses("hard")
    delay = measure_delay(
        w, replace(TRUE, first=TRUE.first - late), Levels(ON, BACKGROUND, "hard", 0)
    )
    assert delay.error < 0.005
    assert abs(delay.ticks - late) < 4.9 * delay.error  # alpha 1e-6


def test_a_look_at_spikes_that_say_nothing_is_unsure() -> None:
    w = witnesses("hard")
    dark = replace(w, light=0 * w.light)
    assert measure_delay(dark, TRUE, Levels(ON, BACKGROUND, "hard", 0)) == Delay(0.0, np.inf)


def test_a_pace_is_the_line_through_all_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Weighted least squares, the fit at the begin being two more looks."""
    monkeypatch.setattr("link.receiving.pacing._HALF", 1e30)
    rng = np.random.Generator(np.random.Philox(key=7))
    model, drift, begin = 0.01, 120e-6, 50.0
    pace = Pace.fitted(replace(TRUE, first=TRUE.first - 0.02, period=2.0), begin, 80, drift)
    timing = pace.timing
    ticks = begin + np.array([130.0, 280.0, 290.0, 470.0])
    errors = np.array([0.004, 0.03, 0.002, 0.01])
    design, seen, weight = [[1.0, 0.0], [0.0, 1.0]], [0.0, 0.0], [1 / model]
    weight.append(1 / np.hypot(drift, model / 80))
    for tick, error in zip(ticks, errors, strict=True):
        n = (tick - TRUE.first) / TRUE.period
        late = float(TRUE.start(n, 0)) + rng.normal(0, error) - float(timing.start(n, 0))
        design.append([1.0, tick - begin])
        seen.append(late)
        weight.append(1 / np.hypot(error, model))
        pace = pace.measured(tick, Delay(
            late + float(timing.start(n, 0) - pace.timing.start(n, 0)), error
        ))  # fmt: skip
    a = np.array(design) * np.array(weight)[:, None]
    line, *_ = np.linalg.lstsq(a, np.array(seen) * weight, rcond=None)
    cover = np.linalg.inv(a.T @ a)
    n = (ticks[-1] - timing.first) / timing.period
    moved = float(pace.timing.start(n, 0) - timing.start(n, 0))
    assert moved == pytest.approx(line[0] + line[1] * (ticks[-1] - begin), abs=1e-4)
    assert pace.timing.period / timing.period - 1 == pytest.approx(line[1], abs=1e-7)
    assert pace.limit == pytest.approx(3e6 * np.sqrt(cover[1, 1]), rel=1e-6)
    assert abs(pace.timing.period / TRUE.period - 1) * 1e6 < pace.limit


def test_looks_long_ago_count_less() -> None:
    pace = Pace.fitted(TRUE, 0.0, 80, 1e-4)
    for k in range(1, 400):
        pace = pace.measured(128.0 * k, Delay(0.0, 0.003))
    # a drift that begins now is taken over though much was seen before
    for k in range(400, 800):
        n = (128.0 * k - TRUE.first) / TRUE.period
        here = TRUE.start(n, 0) + 50e-6 * 128.0 * (k - 400)
        pace = pace.measured(128.0 * k, Delay(float(here - pace.timing.start(n, 0)), 0.003))
    assert pace.timing.period / TRUE.period - 1 == pytest.approx(50e-6, rel=0.1)
