"""Sequences that break off, and spikes that leave the symbols' phase open."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from cosim import Viform
from link.layout import Layout, pilots
from link.mode import EVERY_RATE, Mode
from link.receiving.phasing import fit_timing, nudge
from link.receiving.pilots.clocking import clock_by_pilots
from link.receiving.pilots.sequence import PilotSignal
from link.receiving.receiver import Receiver
from link.receiving.synthesis import Levels, Witnesses
from link.timing import Timing
from link.verdict import Cause
from tests.link.receiving.test_receiving import DATA, receive
from tests.link.receiving.toy import CLOCK, MODE, small

ROWS = 60


def signal(*parts: tuple[int, int]) -> PilotSignal:
    """Of pilots that fire in every tick they are on in, two ticks to a symbol: stretches of the
    sequence from tick to tick, one behind another."""
    shown = np.repeat(pilots(), 2).astype(np.float64)
    bits = np.concatenate([shown[a:b] for a, b in parts])[:, None] * np.ones(4)
    return PilotSignal(0, bits, np.arange(4) * ROWS / 4, np.full(4, 20))


@pytest.mark.parametrize(
    ("parts", "lit", "first"),
    [
        (((0, 200),), (0, 200), 0),
        (((0, 110), (0, 110)), (0, 110), 0),
        (((0, 110), (150, 260)), (0, 110), 0),
        (((0, 60), (300, 480)), (60, 240), -240),
    ],
    ids=["whole", "twice", "gap", "late"],
)
def test_a_sequence_is_found_on_one_side_of_a_break(
    parts: tuple[tuple[int, int], ...], lit: tuple[int, int], first: int
) -> None:
    given = signal(*parts)
    got = clock_by_pilots(given, Layout(MODE), ROWS, (0, len(given.bits)))
    assert got is not None
    middle = (got.lit[0] + got.lit[1]) // 4 - first // 2
    assert abs(float(got.timing.start(middle, 0)) - first - 2 * middle) < 0.05
    assert abs(got.timing.period - 2) < 1e-3
    if got.broken:
        assert max(abs(a - b) for a, b in zip(got.lit, lit, strict=True)) <= 24


def test_no_sequence_is_found_in_chance() -> None:
    rng = np.random.Generator(np.random.Philox(key=3))
    bits = rng.random((400, 4))
    given = PilotSignal(0, bits, np.arange(4) * ROWS / 4, np.full(4, 20))
    assert clock_by_pilots(given, Layout(MODE), ROWS, (0, 400)) is None


def witnesses(first: float, cells: int = 30, ticks: int = 43) -> Witnesses:
    """Pixels with hard reset and 1.4 thresholds a tick, without noise, of symbols of one tick:
    fifty of each cell."""
    rng = np.random.Generator(np.random.Philox(key=4))
    even = rng.random((cells, 24)) < 0.5
    light = np.stack([even, ~even], 2).reshape(cells, 48).astype(np.float64)
    bits = np.zeros((cells, ticks), np.uint8)
    charge = np.zeros(cells)
    for k in range(-2, ticks):
        at = 14 + k - first
        n = int(np.floor(at))
        share = at - n
        charge += 1.4 * ((1 - share) * light[:, n] + share * light[:, n + 1])
        fired = charge >= 1
        charge[fired] = 0
        if k >= 0:
            bits[:, k] = fired
    every: npt.NDArray[np.intp] = np.repeat(np.arange(cells), 50)
    rows = np.tile(np.linspace(0, ROWS, 50), cells)
    return Witnesses(rows, rows, light[every], 0, bits[every], 14, cells)


def test_a_period_that_the_spikes_leave_open_is_that_of_the_pilots() -> None:
    w = witnesses(12.0)
    told = Timing(12.0, 1.00001, 0.0, ROWS)
    got = fit_timing(w, told, 400.0).timing
    # a tenth of a tick over what the pilots were seen for, and three of those at most
    assert abs(got.period / told.period - 1) < 3 * 0.1 / 400
    # so little that no symbol of this transmission slips
    assert abs(got.period - 1) * 300 < 0.25


@pytest.mark.parametrize("late", [0.0, 0.1, 0.45])
def test_a_phase_is_kept_where_the_spikes_leave_it_open(late: float) -> None:
    """Late by so much, or in time: spikes are the same, up to what 1.4 thresholds leave."""
    w, levels = witnesses(12.0), Levels(1.4, 1e-4, "hard", 0.0)
    held = nudge(w, Timing(12.0 + late, 1.0, 0.0, ROWS), levels)
    assert held == 0.0
    moved = nudge(w, Timing(12.0 - 0.45, 1.0, 0.0, ROWS), levels)
    assert 0.45 - 0.4 / 1.4 < moved < 0.45 + 1 / 1.4  # into what explains them


@pytest.mark.slow
def test_a_short_transmission_shown_twice_arrives() -> None:
    toy = small(DATA[:3000])
    planes, stop = toy.planes(), 14 + toy.sent.planes
    got = receive(toy, np.concatenate([planes[20:stop], planes[13:]]))
    assert got.verdict.whole, got.verdict
    assert got.delivered == (DATA[:3000], "a.bin")


@pytest.mark.slow
def test_a_gap_is_named_and_what_lies_behind_it_is_read() -> None:
    data = np.random.Generator(np.random.Philox(key=8)).bytes(100_000)
    toy = small(data, mode=Mode(256, 256, 2, 2, "8b10b", 32))
    planes = toy.planes()
    short = receive(toy, np.concatenate([planes[:170], planes[177:]]))
    assert short.verdict.whole, short.verdict
    assert short.delivered == (data, "a.bin")
    much = receive(toy, np.concatenate([planes[:140], planes[241:]]))
    assert much.verdict.cause is Cause.INTERRUPTED, much.verdict
    assert much.delivered is None and much.frames_right > 0


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "stop"), [(140, 241), (200, 350), (300, 450)])
def test_a_gap_is_named_where_each_block_has_a_rate(begin: int, stop: int) -> None:
    """Blocks of low rates hold fewer frames, all of which arrive; missing ticks or dark ones."""
    mode = Mode(256, 256, 2, 2, "scrambled", None, adaptive=True)
    rates = [EVERY_RATE.index(rate) for rate in (0.7, 0.75, 0.65, 0.6, 0.7, 0.8)] * 2
    data = np.random.Generator(np.random.Philox(key=8)).bytes(200_000)
    toy = small(data, mode=mode, overhead=0.05, rates=rates)
    planes = toy.planes()
    dark = planes.copy()
    dark[begin:stop] = 0
    for each in (np.concatenate([planes[:begin], planes[stop:]]), dark):
        got = receive(toy, each)
        assert got.verdict.cause is Cause.INTERRUPTED, got.verdict
        assert got.frames_right > 0


@pytest.mark.slow
def test_what_lies_behind_a_few_missing_ticks_is_read_where_each_block_has_a_rate() -> None:
    mode = Mode(256, 256, 2, 2, "scrambled", None, adaptive=True)
    rates = [EVERY_RATE.index(rate) for rate in (0.7, 0.75, 0.65, 0.6, 0.7, 0.8)] * 2
    data = np.random.Generator(np.random.Philox(key=8)).bytes(200_000)
    planes = (toy := small(data, mode=mode, overhead=0.05, rates=rates)).planes()
    got = receive(toy, np.concatenate([planes[:170], planes[177:]]))
    assert got.delivered == (data, "a.bin"), got.verdict


@pytest.mark.parametrize("most", [0.4, 4])
def test_searches_after_interruptions_are_limited_by_the_recording(
    monkeypatch: pytest.MonkeyPatch, most: float
) -> None:
    monkeypatch.setattr("link.receiving.receiver._SEARCHED", most)
    data = np.random.Generator(np.random.Philox(key=8)).bytes(100_000)
    toy = small(data)
    toy.cycles = 450
    planes = toy.planes()
    gap = (np.arange(450) >= 150) & ((np.arange(450) - 150) % 97 < 7)
    receiver = Receiver(planes.shape[1:])
    receiver.step(Viform.from_planes(planes[~gap], CLOCK))
    text = receiver.finish().verdict.text
    ticks = int((~gap).sum())
    assert receiver.searched <= most * ticks
    limited = f": the limit of {most} times the recording's {ticks}" in text
    assert limited == (most < 1)
    if receiver.searches:
        assert f", in {receiver.searched} ticks" in text


def test_what_a_panel_shows_after_a_file_is_not_lost() -> None:
    """It goes on with cells by chance: three more groups of 20 ticks."""
    toy = small(DATA)
    planes, stop = toy.planes(), 14 + toy.sent.planes
    rng = np.random.Generator(np.random.Philox(key=12))
    later = planes[stop - 60 : stop].copy()
    middle = later[:, 40:-40, 40:-40]
    middle ^= rng.random(middle.shape) < 0.4
    got = receive(toy, np.concatenate([planes[:stop], later, planes[stop:]]))
    assert got.delivered == (DATA, "a.bin")
    assert got.frames_read == toy.sent.outbox.frames == got.frames_right, got.verdict
    assert f"{got.frames_right} frames of {got.frames_right}" in got.verdict.text
