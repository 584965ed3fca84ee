"""The first-spike code: the paper's figure, round trips, lines, and the closed forms behind k."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import Clock, Events, Viform
from cosim.spikes.viform import unpack_planes
from sensor.codec.coding import Code, encode, recode
from sensor.codec.follow import FOLLOW_STATE, follow
from sensor.codec.law import LATCH_VARIANCE, effective_q, entropy_bounds, event_rate, width_law
from sensor.codec.trains import first_spikes, levels, repeated, without_transitions
from tests.cosim.spikes.whole_streams import events_of, viform_of

CLOCK = Clock(40_000)
LOSSLESS = (Code("repeat"), Code("line"))

# Figure 1: spikes 1-4 of width w, 5 in between, 6-11 of w / 2, 12 in between, 13 and 14 of 2 w.
W = 40
WIDTHS = [W] * 4 + [27] + [W // 2] * 6 + [61] + [2 * W] * 2
TIMES = np.cumsum(WIDTHS) - 1


def train(times, cycles: int) -> Viform:
    """One pixel that fires at these cycles."""
    planes = np.zeros((cycles, 1, 1), bool)
    planes[times] = True
    return Viform.from_planes(planes, CLOCK)


def count(stream: Viform, code: Code) -> int:
    """First spikes of a stream, closing ones included."""
    return sum(frame.events for frame in encode(stream, code))


def test_figure_1_sends_five_first_spikes_and_three_for_intensity_alone():
    stream = train(TIMES, int(TIMES[-1]) + 1)
    first = first_spikes(events_of(stream))
    numbers = np.searchsorted(TIMES, first.time) + 1
    assert numbers.tolist() == [1, 5, 6, 12, 13]
    assert first.width.tolist() == [W, 27, W // 2, 61, 2 * W]
    assert repeated(first) == events_of(stream)
    assert count(stream, Code("repeat")) == 5
    bare = without_transitions(first)
    assert (np.searchsorted(TIMES, bare.time) + 1).tolist() == [1, 6, 13]
    _, _, begin, width = levels(bare)
    assert width.tolist() == [W, W // 2, 2 * W]
    # In force from where the first spike of each began, not from the instant of the change.
    assert begin.tolist() == [-1, TIMES[4], TIMES[11]]


def test_the_intensity_code_drops_runs_between_steady_stretches_alone():
    widths = [3, 9, 9, 5, 6, 7, 8, 8, 8, 2, 4]  # 3 before the first steady one, 2 and 4 after
    times = np.cumsum(widths) - 1
    stream = train(times, int(times[-1]) + 1)
    bare = without_transitions(first_spikes(events_of(stream)))
    assert bare.width.tolist() == [3, 9, 8, 2, 4]
    alternating = train(np.cumsum([3, 4] * 20) - 1, 140)
    first = first_spikes(events_of(alternating))
    assert len(without_transitions(first)) == len(first) == 40


def test_repetition_that_stops_before_the_end_is_closed_by_no_spike():
    first = first_spikes(events_of(train([4, 9, 14], 40)))
    assert first.time.tolist() == [4, 40] and first.width.tolist() == [5, 26]
    assert first_spikes(events_of(train([4, 9, 14], 19))).time.tolist() == [4]  # 19 is outside
    assert first_spikes(events_of(train([4, 9, 14], 20))).time.tolist() == [4, 20]


def test_an_asynchronous_chip_s_events_come_back():
    zero = np.zeros(4, np.uint16)
    time, width = np.array([1009, 1019, 1040, 1061]), np.array([10, 10, 21, 21])
    events = Events(zero, zero, time, width, (1, 1), 70, Clock(10**9), 1000)
    first = first_spikes(events)
    assert first.time.tolist() == [1009, 1040]
    assert repeated(first) == events


@pytest.mark.parametrize(
    ("width", "level", "says"),
    [([10, 10, 9], None, "must follow one another"), ([10, 10, 11], [1, 2, 2], "full spikes")],
)
def test_events_that_the_code_cannot_hold_are_refused(width, level, says):
    zero = np.zeros(3, np.uint16)
    part = None if level is None else np.array(level, np.uint16)
    events = Events(
        zero, zero, np.array([9, 19, 30]), np.array(width), (1, 1), 50, CLOCK, level=part, levels=2
    )
    with pytest.raises(ValueError, match=says):
        first_spikes(events)


TRAINS = {
    "empty": [],
    "one at the start": [0],
    "one at the end": [1299],
    "one": [700],
    "all ones": range(1300),
    "alternating": range(1, 1300, 2),
    "stops": range(0, 600, 7),
    "stops at a chunk": range(0, 512, 16),
    "faster and faster": np.cumsum(range(49, 0, -1)),
    "latched": [int(n * 3.3) for n in range(390)],
}


@pytest.mark.parametrize("code", LOSSLESS, ids=lambda code: code.name)
@pytest.mark.parametrize("name", TRAINS)
def test_a_train_comes_back(name, code):
    stream = train(list(TRAINS[name]), 1300)
    assert recode(stream, code) == stream
    if code.name == "repeat":
        first = first_spikes(events_of(stream))
        assert viform_of(repeated(first)) == stream
        assert count(stream, code) == len(first)


@given(
    st.integers(1, 2000), st.integers(1, 3), st.integers(1, 5),
    st.sampled_from([0.0, 0.004, 0.1, 0.5, 0.97, 1.0]), st.integers(0, 2**32),
)  # fmt: skip
def test_random_streams_come_back_and_both_forms_agree(cycles, height, width, share, seed):
    planes = np.random.default_rng(seed).random((cycles, height, width)) < share
    whole = Viform.from_planes(planes, CLOCK)
    stream = Viform(whole.words, cycles, CLOCK, -77)
    for code in LOSSLESS:
        assert recode(stream, code) == stream
    first = first_spikes(events_of(stream))
    assert viform_of(repeated(first)) == stream
    assert count(stream, Code("repeat")) == len(first)


def test_streams_of_several_bands_come_back():
    planes = np.random.default_rng(3).random((70, 130, 300)) < 0.3  # 39 000 pixels, three bands
    stream = Viform.from_planes(planes, CLOCK)
    for code in LOSSLESS:
        assert recode(stream, code) == stream


def beatty(tau: np.ndarray, phase: np.ndarray, cycles: int) -> Viform:
    """Pixels that fire at floor(phase + n tau), (H, W) each."""
    t = np.arange(cycles)[:, None, None]
    fired = np.ceil((t + 1 - phase) / tau) > np.ceil((t - phase) / tau)
    return Viform.from_planes(fired & (t + 1 > phase), CLOCK)


def test_a_beatty_sequence_is_one_line():
    random = np.random.default_rng(5)
    tau = 1 + random.random((30, 30)) ** 3 * 90
    stream = beatty(tau, random.random((30, 30)) * tau, 1500)
    assert count(stream, Code("line")) == 900
    assert recode(stream, Code("line")) == stream
    assert count(stream, Code("repeat")) > 30 * 900


def is_line(times: list[int]) -> int | None:
    """The least b of a line floor((a n + r) / b) through the spikes, by trying them all."""
    n = np.arange(len(times))
    y = np.array(times) - times[0]
    for b in range(1, len(times)):
        for a in range(b, b * int(y.max(initial=1)) + 1):
            spread = a * n - b * y  # r must lie so that 0 <= spread + r < b, and 0 <= r < b
            if -spread.min() < b and spread.max() - spread.min() < b and spread.max() < b:
                return b
    return None


def test_lines_are_as_long_as_they_can_be():
    # Every train of 5 widths from {2, 3, 4}: greedy lines against exhaustive search.
    for widths in itertools.product((2, 3, 4), repeat=5):
        times = [0, *itertools.accumulate(widths)]
        expected, first = 0, 0
        while first < len(times):
            stop = first + 1
            while stop < len(times) and (
                stop - first == 1 or is_line(times[first : stop + 1]) is not None
            ):
                stop += 1
            expected, first = expected + 1, stop
        assert count(train(times, times[-1] + 1), Code("line")) == expected, widths


# The law of widths.


def moments(law: np.ndarray) -> tuple[float, float]:
    n = np.arange(len(law))
    mean = float(law @ n)
    return mean, float(law @ (n - mean) ** 2)


def test_the_law_of_a_width_has_the_moments_that_follow_from_its_parts():
    # A spread of many ticks: the latch adds 1/6.
    mean, variance = moments(width_law(40.0, 100.0))
    assert mean == pytest.approx(40, rel=1e-9)
    assert variance == pytest.approx(40.0**2 / 100.0 + LATCH_VARIANCE, rel=1e-9)
    # None to speak of: f (1 - f), which is 1/6 on average over the fraction of the mean width.
    fractions = (np.arange(50) + 0.5) / 50
    spreads = [moments(width_law(5 + f, 1e9))[1] for f in fractions]
    np.testing.assert_allclose(spreads, fractions * (1 - fractions), atol=1e-3)
    assert np.mean(spreads) == pytest.approx(1 / 6, rel=1e-3)
    assert effective_q(1000.0, math.sqrt(1000.0)) == pytest.approx(500.0)
    with pytest.raises(ValueError, match="saturate"):
        width_law(1.2, 100.0)


def gamma_stream(mean: float, q: float, pixels: int, cycles: int, seed: int) -> Viform:
    """Latched spikes of steady light; each pixel fired in the cycle before the first."""
    random = np.random.default_rng(seed)
    steps = random.gamma(q, mean / q, (pixels, int(cycles / mean * 1.6) + 20))
    when = np.floor(np.cumsum(steps, axis=1) - random.random((pixels, 1))).astype(int)
    planes = np.zeros((cycles, 1, pixels), bool)
    row, column = np.nonzero((when >= 0) & (when < cycles))
    planes[when[row, column], 0, row] = True
    return Viform.from_planes(planes, CLOCK)


@pytest.mark.parametrize("k", [1.0, 2.0, 3.0])
@pytest.mark.parametrize(("mean", "q"), [(20.0, 100.0), (50.0, 1000.0)])
def test_steady_light_sends_as_many_statistical_events_as_the_chain_says(k, mean, q):
    pixels, cycles = 150, 150_000
    stream = gamma_stream(mean, q, pixels, cycles, 11)
    wanted = event_rate(mean, q, k)
    state = np.zeros((pixels, FOLLOW_STATE), np.int32)
    state[:, 0], state[:, 2] = -1, 1
    words = np.ascontiguousarray(stream.words[:, 0].T)
    records = np.empty((4, int(np.bitwise_count(words).sum()) + pixels), np.int32)
    n = follow(words, 0, cycles, state, 1 / q, k, 0, records)
    # Pixels are independent, and long beside what their chains remember.
    events = np.bincount(records[0, :n], minlength=pixels) - 1
    rate = events / (cycles / mean)
    # alpha 1e-6; that neighbouring widths share a phase changes the rate by less than 1 %.
    spread = 4.9 * rate.std(ddof=1) / math.sqrt(pixels)
    assert abs(rate.mean() - wanted) < spread + 0.01 * wanted
    assert spread < 0.15 * wanted


def test_the_event_rate_is_that_of_two_independent_widths_where_the_bound_is_the_same():
    # At large Q sigma hardly depends on w0: P(|N| > k / sqrt 2).
    for k in (1.0, 2.0, 3.0):
        assert event_rate(3000.0, 1e5, k) == pytest.approx(math.erfc(k / 2), rel=0.03)


def test_entropy_bounds_meet_the_gaussian_and_the_latch():
    # A spread of many ticks: both are log2(sigma sqrt(2 pi e)).
    low, high = entropy_bounds(200.0, 400.0)
    gauss = math.log2(10 * math.sqrt(2 * math.pi * math.e))
    assert low == pytest.approx(gauss, abs=0.01) and high == pytest.approx(gauss, abs=0.01)
    assert low <= high
    # No spread: where the phase is known the width is, else it is one of two.
    low, high = entropy_bounds(3.5, 1e12)
    assert low < 1e-3 and high == pytest.approx(1.0, abs=1e-3)


def test_no_lossless_code_goes_below_the_entropy():
    mean, q = 12.0, 100.0
    stream = gamma_stream(mean, q, 500, 8000, 2)
    spikes = int(np.bitwise_count(stream.words).sum())
    low = entropy_bounds(mean, q)[0]
    for code in LOSSLESS:
        bits = 8 * sum(len(frame.data) for frame in encode(stream, code, 9))
        assert low < bits / spikes < 2.5 * low


# The statistical code.


def test_a_change_beyond_k_is_sent_and_one_within_is_not():
    q, k = 100.0, 3.0
    sigma = math.sqrt(50**2 / q + LATCH_VARIANCE)  # 5.02
    inside, outside = 50 + int(k * sigma), 50 + int(k * sigma) + 1
    for new, events in ((inside, 1), (outside, 2)):
        times = np.cumsum([50] * 10 + [new] * 10) - 1
        stream = train(times, int(times[-1]) + 1)
        assert count(stream, Code("statistical", k, q)) == events
    # Threshold noise widens the bound.
    times = np.cumsum([50] * 10 + [outside] * 10) - 1
    stream = train(times, int(times[-1]) + 1)
    assert count(stream, Code("statistical", k, q, threshold_noise=10.0)) == 1


def test_a_refinement_sends_the_mean_of_the_next_widths():
    widths = [20, 22, 21, 19, 22, 20, 20, 20]  # the first spike, then four whose mean is 21
    times = np.cumsum(widths) - 1
    stream = train(times, int(times[-1]) + 1)
    code = Code("statistical", 5.0, 100.0, refine=4)
    assert count(stream, code) == 2
    out = events_of(recode(stream, code)).time
    # 19; four in 84 ticks up to 103; then on at 21.
    assert out.tolist() == [19, 40, 61, 82, 103, 124, 145]


def test_a_pixel_that_goes_dark_is_told_apart_from_one_that_repeats():
    code = Code("statistical", 3.0, 1000.0)
    stream = train(range(9, 300, 10), 900)
    assert recode(stream, code) == stream
    again = train([*range(9, 300, 10), *range(700, 900, 10)], 900)
    assert recode(again, code) == again


def test_refined_levels_are_nearer_to_the_light_than_single_widths():
    mean, q = 20.0, 100.0
    stream = gamma_stream(mean, q, 1000, 4000, 7)
    errors = []
    for refine in (0, 8):
        out = recode(stream, Code("statistical", 5.0, q, refine=refine))
        spikes = unpack_planes(out.words, 0, 4000).sum(axis=0)
        errors.append(float(np.sqrt(np.mean((spikes / 4000 * mean - 1) ** 2))))
    # A single width is off by the RSD, sqrt(1/100 + 1/6/400) = 0.102 of it, for as long as it
    # stands (some are replaced); a mean of 8 by 0.0354.
    assert 0.06 < errors[0] < 0.11 and errors[1] < 0.045


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (("jpeg",), "code must be one of line, repeat, statistical, not 'jpeg'"),
        (("line", 3.0), "must stand without settings"),
        (("statistical",), "k must be above 0"),
        (("statistical", math.nan, 100.0), "k must be above 0"),
        (("statistical", 3.0), "threshold must be 1e-3"),
        (("statistical", 3.0, 100.0, 200.0), "threshold noise must be 0 to the threshold"),
        (("statistical", 3.0, 100.0, 0.0, 1), "refine must be 0, or 2 to 255, not 1"),
    ],
)
def test_settings_that_are_none_are_refused(settings, says):
    with pytest.raises(ValueError, match=says):
        Code(*settings)
