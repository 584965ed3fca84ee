"""Images from streams: against the definitions written out plainly, and against a recording."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from cosim import Clock, InputError, Viform
from sensor import isi, tau_image, tfi, tfp
from sensor.reconstruct.intervals import TIES, Ties, interval_image, spike_cycles

CLOCK = Clock(40_000)
streams = hnp.arrays(
    np.uint8,
    st.tuples(st.integers(1, 140), st.integers(1, 4), st.integers(1, 4)),
    elements=st.sampled_from([0, 0, 0, 0, 1]),
)


def interval_of(bits: np.ndarray, at: int, ties: Ties = "before") -> tuple[int, int]:
    """The definition: (last spike before `at`, first at or after it), else the nearest interval.
    With ties after: (last spike at or before it, first after it)."""
    cycles = np.flatnonzero(bits)
    if cycles.size < 2:
        return -1, -1
    n = int(np.searchsorted(cycles, at, "right" if ties == "after" else "left"))
    n = min(max(n, 1), cycles.size - 1)
    return int(cycles[n - 1]), int(cycles[n])


@settings(max_examples=150, deadline=None)
@given(streams, st.integers(0, 10**6), st.sampled_from(TIES))
def test_intervals_follow_their_definition(planes: np.ndarray, pick: int, ties: Ties) -> None:
    stream, at = Viform.from_planes(planes, CLOCK), pick % len(planes)
    begin, end = interval_image(stream, at, ties=ties)
    for place in np.ndindex(planes.shape[1:]):
        expected = interval_of(planes[(slice(None), *place)], at, ties)
        assert (begin[place], end[place]) == expected
    tau = isi(stream, at, ties=ties)
    assert np.array_equal(tau, end - begin)
    assert np.array_equal(
        tfi(stream, at, ties=ties), np.where(tau > 0, 1 / np.maximum(tau, 1), 0).astype(np.float32)
    )


@settings(max_examples=100, deadline=None)
@given(streams, st.integers(0, 10**6), st.integers(0, 140), st.sampled_from([0, 33, 2**62]))
def test_intervals_within_a_span(planes: np.ndarray, pick: int, first: int, length: int) -> None:
    """Spikes outside the span do not count; its end may lie beyond the stream's, without end."""
    stream, at = Viform.from_planes(planes, CLOCK), pick % len(planes)
    first = min(first, at)
    stop = max(at + 1, first + length)
    begin, end = interval_image(stream, at, (first, stop))
    within = planes.copy()
    within[:first] = within[stop:] = 0
    for place in np.ndindex(planes.shape[1:]):
        expected = interval_of(within[(slice(None), *place)], at)
        assert (begin[place], end[place]) == expected


@settings(max_examples=100, deadline=None)
@given(streams, st.integers(0, 10**6), st.integers(1, 60), st.booleans())
def test_tfi_of_a_window_takes_intervals_between_its_spikes(
    planes: np.ndarray, pick: int, window: int, preceding: bool
) -> None:
    stream, at = Viform.from_planes(planes, CLOCK), pick % len(planes)
    window = window if preceding else window | 1
    first = max(at + 1 - window if preceding else at - window // 2, 0)
    stop = at + 1 if preceding else at + window // 2 + 1
    found = tfi(stream, at, window, preceding=preceding)
    causal = tfi(stream, at, preceding=True)
    for place in np.ndindex(planes.shape[1:]):
        column = planes[(slice(None), *place)]
        begin, end = interval_of(column[first:stop], at - first)
        assert found[place] == (np.float32(1 / (end - begin)) if begin >= 0 else 0)
        begin, end = interval_of(column[: at + 1], at)
        assert causal[place] == (np.float32(1 / (end - begin)) if begin >= 0 else 0)


@settings(max_examples=100, deadline=None)
@given(streams, st.integers(0, 10**6), st.integers(0, 60))
def test_tfp_is_the_mean_of_the_cycles_there_are(planes: np.ndarray, pick: int, half: int) -> None:
    stream, at = Viform.from_planes(planes, CLOCK), pick % len(planes)
    inside = planes[max(at - half, 0) : at + half + 1]
    found = tfp(stream, at, 2 * half + 1)
    assert np.allclose(found, inside.mean(axis=0), atol=1e-6)
    before = planes[max(at - half, 0) : at + 1]
    assert np.allclose(tfp(stream, at, half + 1, preceding=True), before.mean(axis=0), atol=1e-6)


@settings(max_examples=50, deadline=None)
@given(streams, st.integers(-5, 130), st.integers(1, 200))
def test_spike_cycles_lists_every_spike(planes: np.ndarray, first: int, length: int) -> None:
    stream = Viform.from_planes(planes, CLOCK)
    places = list(np.ndindex(planes.shape[1:]))
    first = min(first, len(planes) - 1)
    some = spike_cycles(stream, places, (first, first + length))
    for (r, c), cycles, inside in zip(places, spike_cycles(stream, places), some, strict=True):
        assert np.array_equal(cycles, np.flatnonzero(planes[:, r, c]))
        assert np.array_equal(inside, cycles[(cycles >= first) & (cycles < first + length)])


def test_tau_is_255_less_the_interval_clipped() -> None:
    planes = np.zeros((600, 1, 4), np.uint8)
    planes[[10, 11], 0, 0] = 1  # tau 1
    planes[[10, 110], 0, 1] = 1  # tau 100
    planes[[10, 510], 0, 2] = 1  # beyond 255
    stream = Viform.from_planes(planes, CLOCK)
    assert tau_image(stream, 11).tolist() == [[254, 155, 0, 0]]
    # Normalised by the longest interval, 500: 255 - round(255 tau / 500).
    assert tau_image(stream, 11, None).tolist() == [[254, 204, 0, 0]]
    assert tau_image(stream, 11, 1000).tolist() == [[255, 229, 127, 0]]


def test_bad_instants_and_windows_are_one_line() -> None:
    stream = Viform.from_planes(np.ones((50, 2, 2), np.uint8), CLOCK)
    for at in (-1, 50, 10**9):
        with pytest.raises(InputError, match="--at must be a cycle from 0 to 49"):
            tfi(stream, at)
    for window in (0, 2, -3, 40):
        with pytest.raises(InputError, match="--window must be odd and at least 1"):
            tfp(stream, 10, window)
