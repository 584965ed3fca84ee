"""Alignment of the converter's lines: the pattern, the eye, word phases, errors by closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import norm

from imagers.ebaps.board.adc_lines import (
    BIT_PS,
    LINES,
    PATTERN_WORDS,
    POSITIONS,
    TAP_PS,
    AdcLines,
    error_rate,
    pn9,
)


def noise(count: int) -> np.ndarray:
    return np.random.default_rng(1).integers(0, 65_536, count, np.uint16)


def test_a_bit_is_160_taps() -> None:
    assert (BIT_PS, TAP_PS, POSITIONS) == (12_500, 78.125, 160)


def test_the_pattern_is_a_maximum_length_sequence_on_every_line() -> None:
    words = pn9(2 * 511)
    for line in range(LINES):
        bits = words >> line & 1
        assert np.array_equal(bits[:511], bits[511:])
        once = bits[:511].astype(int)
        assert once.sum() == 256
        signs = 1 - 2 * once
        found = {int(signs @ np.roll(signs, n)) for n in range(1, 511)}
        assert found == {-1}  # no other word phase resembles the right one


@pytest.mark.parametrize("offset", [0.0, 1500.0, -3000.0])
def test_the_error_rate_is_the_closed_form(offset: float) -> None:
    """By hand: r (Q((T/2 + x)/s) + Q((T/2 - x)/s)); and counted over 480 000 bits."""
    jitter = 2500.0
    q = norm.sf((6250 + offset) / jitter) + norm.sf((6250 - offset) / jitter)
    assert error_rate(offset, jitter) == pytest.approx(q / 2, rel=1e-12)
    lines = AdcLines(jitter, 0.0)
    position = (6250 + offset - lines.instants[0]) / TAP_PS
    words = noise(30_016)
    got = lines.registered(words, np.full(LINES, round(position)), 0, 3)
    sent = words[None, 8:-8] >> np.arange(LINES)[:, None] & 1
    wrong = int(np.count_nonzero(got != sent))
    exact = error_rate(lines.instants[0] + round(position) * TAP_PS - 6250, jitter)
    bits = got.size
    # Errors of the two samples beside an edge are not independent: at most twice the variance.
    assert wrong == pytest.approx(bits * exact, abs=3.3 * math.sqrt(2 * bits * exact))


@pytest.mark.parametrize("device", range(1, 7))
def test_training_finds_the_middle_of_every_eye(device: int) -> None:
    jitter = 300.0
    lines = AdcLines(jitter, 3000.0, device)
    found = lines.train(1)
    assert found.found
    # A pattern of N words with 256 edges in 511 shows no error where N p << 1, some where N p >> 1.
    count = PATTERN_WORDS * 256 / 511
    inner = BIT_PS - 2 * jitter * norm.isf(1e-4 / count) - 2 * TAP_PS
    outer = BIT_PS - 2 * jitter * norm.isf(10 / count) + 2 * TAP_PS
    assert inner <= found.eyes.min() and found.eyes.max() <= outer
    assert np.abs(lines.offsets(found)).max() <= (outer - inner) / 2
    samples = noise(2000)
    assert np.array_equal(lines.receive(samples, found, 0, 1), samples)


@pytest.mark.parametrize("skew", [0.0, 12_500.0])
def test_the_extremes_of_skew_are_aligned(skew: float) -> None:
    lines = AdcLines(50.0, skew, 5)
    samples = noise(500)
    assert np.array_equal(lines.receive(samples, lines.train(1), 0, 1), samples)


def test_word_phases_differ_where_the_clock_falls_between_the_lines() -> None:
    """A board whose sampling edge falls within the skew: untrained words mix bits of neighbours."""
    device = next(
        d for d in range(1, 99) if len({*np.floor(AdcLines(0, 3000.0, d).instants / BIT_PS)}) > 1
    )
    lines = AdcLines(100.0, 3000.0, device)
    samples = noise(2000)
    raw = lines.receive(samples, lines.untrained(), 0, 1)
    assert np.mean(raw != samples) > 0.4
    found = lines.train(1)
    assert np.array_equal(lines.receive(samples, found, 0, 1), samples)
    # The phase that the training states is the one that the delays have.
    instants = lines.instants + found.positions * TAP_PS
    assert np.array_equal(found.slips, np.floor(instants / BIT_PS))


def test_expected_errors_are_those_counted() -> None:
    lines = AdcLines(1700.0, 1000.0)
    found = lines.train(1)
    samples = np.repeat(noise(40_000), 2)
    wrong = sum(
        int(np.bitwise_count(lines.receive(samples, found, n, 1) ^ samples).sum()) for n in range(4)
    )
    mean = 4 * lines.expected_errors(samples, found)
    assert mean > 100 and wrong == pytest.approx(mean, abs=3.3 * math.sqrt(2 * mean))


def test_too_much_jitter_finds_no_eye() -> None:
    lines = AdcLines(8000.0, 1000.0)
    found = lines.train(1)
    assert not found.found and found.positions.min() >= 0
