"""The nine drive signals: closed form against a clock-by-clock machine, exposure, trace."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from imagers.common.scenery import Still
from imagers.ebaps.board.timing import Timing
from imagers.ebaps.device.drive import (
    DRIVES,
    HCLK_ROWS,
    LAG,
    READING,
    Drive,
    drive_records,
    late_resets,
    merged,
    row_times,
)
from imagers.ebaps.device.exposure import DEFAULT_EXPOSURE, STEP, ExposureRule
from imagers.ebaps.device.imager import Ebaps
from imagers.ebaps.pixels import EbapsPixels
from tests.imagers.ebaps.naive_drive import dense, disturbed, exposed_rows, intervals
from tests.imagers.vcd import read_vcd

SMALL = Timing(columns=96, rows=5, rate=61_000)
"""655 or 656 clocks a period, 480 of them read."""


class TestClockByClock:
    @pytest.mark.parametrize(
        "exposures",
        [(2400, 7300, 12_000), (12_000, 12_000, 12_000), (2500, 2525, 2425), (9600, 4800, 2400)],
    )
    def test_closed_form_equals_the_counters(self, exposures: tuple[int, ...]) -> None:
        drive = Drive(SMALL)
        levels = dense(SMALL, exposures, SMALL.vsync(len(exposures) + 2))
        frames = list(enumerate(exposures))
        for name in READING:
            parts = [drive.reading(name, n) for n, _ in frames]
            if name in ("RST", "T"):
                parts += [drive.resetting(name, *frame) for frame in frames]
            made = [tuple(pair) for pair in np.transpose(merged(parts)).tolist()]
            assert made == intervals(levels[name]), name
        assert [drive.vsync(*frame) for frame in frames] == intervals(levels["VSYNC"])
        assert [drive.shifting(n) for n, _ in frames] == intervals(levels["hclk_on"])

    def test_records_are_the_same_edges(self) -> None:
        exposures = (2500, 9600, 12_000)
        levels = dense(SMALL, exposures, SMALL.vsync(5))
        records = drive_records(list(enumerate(exposures)), SMALL)
        assert records == sorted(records, key=lambda record: record.ps)
        for name in levels:
            mine = [(r.ps, r.value) for r in records if r.signal == name.lower()]
            rises = [(SMALL.ps(clock), 1) for clock, _ in intervals(levels[name])]
            falls = [(SMALL.ps(clock), 0) for _, clock in intervals(levels[name])]
            assert sorted(mine) == sorted(rises + falls)
        clocked = [r.ps for r in records if r.signal == "hclk" and r.value]
        assert clocked == [
            SMALL.ps(SMALL.vsync(1) + LAG + n) for n in range(HCLK_ROWS * SMALL.columns)
        ]

    def test_disturbed_rows(self) -> None:
        drive = Drive(SMALL)
        found = set()
        for exposure in range(2400, 12_000, 25 * 7):
            for following in (2400, exposure, 11_000):
                rows = drive.disturbed_rows(1, exposure, following)
                assert rows == disturbed(drive, 1, exposure, following)
                found.add(rows)
        assert {0, 1, 2, 3, 4} <= found


class TestWholeArray:
    def test_exposure_is_the_duty_of_vsync(self) -> None:
        drive, timing = Drive(), Timing()
        for exposure in (1_000_000, 16_384_000, 32_768_000, 1_234_567):
            rise, fall = drive.vsync(3, exposure)
            assert set(drive.exposed(3, exposure).tolist()) == {fall - rise}
            assert fall - rise == exposure * 40 // 1000
            begin, end = timing.row_times(3, exposure, 1024)
            mine = np.array([timing.ps(c) for c in drive.resetting("T", 3, exposure)[1].tolist()])
            assert set((mine - begin).tolist()) == {48 * 25_000}
            assert drive.reading("T", 3)[1][-1] * 25_000 - end[-1] == 48 * 25_000

    def test_counts_and_order(self) -> None:
        drive, timing = Drive(), Timing()
        assert len(DRIVES) == 9
        assert drive.pulses("HCLK", 0) == 1280 * 1024
        assert {drive.pulses(name, 0) for name in READING} == {1024}
        rises = [drive.reading(n, 0)[0][7] for n in ("VCLK", "RST", "RD1", "T", "RD2", "HSYNC")]
        assert rises == sorted(rises)
        begin, end = drive.shifting(0)
        assert end == timing.ready(0) + LAG
        assert end < timing.vsync(2)  # all read before the next frame's first row
        assert drive.reading("HSYNC", 0)[0][0] == begin

    def test_the_loop_never_disturbs_a_row(self) -> None:
        """All exposures that steps reach from T_default, and those two steps from them."""
        drive, rule = Drive(), ExposureRule()
        reached, ahead = set(), [DEFAULT_EXPOSURE]
        while ahead:
            exposure = ahead.pop()
            if exposure not in reached:
                reached.add(exposure)
                ahead += [rule.clip(exposure + STEP), rule.clip(exposure - STEP)]
        assert len(reached) == 150  # three grids: from T_default, from T_max, from T_min
        for exposure in reached:
            for steps in (-2, -1, 0, 1, 2):
                after = rule.clip(exposure + steps * STEP)
                assert not any(drive.disturbed_rows(k, exposure, after) for k in range(3))
        # one clock more does: 512 rows are reset while the others are read
        assert drive.disturbed_rows(0, DEFAULT_EXPOSURE + 25, DEFAULT_EXPOSURE + 25) == 512
        others = [DEFAULT_EXPOSURE + 25 * n for n in range(1280)]
        # SEL lasts 64 clocks and T 8: 71 places where they meet, but for T upon T, for two frames
        assert sum(drive.disturbed_rows(0, e, e) > 0 for e in others) == 2 * 70

    def test_a_step_up_resets_two_frames_at_once(self) -> None:
        """0.64 ms is more than the 0.565 ms of blanking."""
        drive, timing = Drive(), Timing()
        blanking = timing.vsync(1) - timing.readout_clocks
        for k in range(3):
            assert drive.resets_at_once(k, DEFAULT_EXPOSURE, DEFAULT_EXPOSURE + STEP) == 3
            assert drive.resets_at_once(k, DEFAULT_EXPOSURE, DEFAULT_EXPOSURE) == 0
            assert drive.resets_at_once(k, DEFAULT_EXPOSURE, DEFAULT_EXPOSURE - STEP) == 0
            assert drive.resets_at_once(k, DEFAULT_EXPOSURE, DEFAULT_EXPOSURE + blanking * 25) == 0
            for more in (2, 1281, 1282):  # periods differ by a clock
                following = DEFAULT_EXPOSURE + (blanking + more) * 25
                first = drive.resetting("T", k, DEFAULT_EXPOSURE)[0]
                second = drive.resetting("T", k + 1, following)[0]
                late = int((first + timing.columns > second[0]).sum())
                assert drive.resets_at_once(k, DEFAULT_EXPOSURE, following) == late > 0

    def test_rows_too_short(self) -> None:
        with pytest.raises(ValueError, match="80 clocks"):
            Drive(Timing(columns=79))
        assert drive_records([]) == []


class TestLateResets:
    @pytest.mark.parametrize("seed", range(4))
    def test_rows_gather_what_a_shift_register_clock_by_clock_gives_them(self, seed: int) -> None:
        """Random exposures of three frames, 100 to 480 clocks: from none to four rows at once."""
        rng = np.random.default_rng(seed)
        met = 0
        for trial in range(12):
            spans = [(100, 481), (100, 481), (100, 481)] if trial % 2 else [(100, 160), (400, 481)]
            drawn = [int(rng.integers(*span)) for span in (*spans, (100, 481))[:3]]
            exposures = tuple(25 * n for n in drawn)
            around = [(None, *exposures[:2]), exposures, (*exposures[1:], None)]
            for frame, three in enumerate(around):
                late = late_resets(SMALL, frame, three)
                own = SMALL.exposure_clocks(exposures[frame])
                assert (own - late).tolist() == exposed_rows(SMALL, exposures, frame)
                begin, end = row_times(SMALL, frame, three, SMALL.rows)
                assert np.abs((end - begin) - (own - late) * 25_000).max() <= 1
                met += int((late > 0).sum())
        assert met > 0

    def test_the_loop_s_step_up(self) -> None:
        """Three rows before it 853 clocks late, two after it 427; a step down none."""
        timing = Timing()
        low, high = DEFAULT_EXPOSURE, DEFAULT_EXPOSURE + STEP
        before = late_resets(timing, 1, (low, low, high))
        after = late_resets(timing, 2, (low, high, high))
        assert np.flatnonzero(before).tolist() == [1021, 1022, 1023]
        assert np.flatnonzero(after).tolist() == [0, 1]
        apart = timing.rise(2, high) - timing.rise(1, low)
        assert set(before[1021:]) == {apart % 1280} and set(after[:2]) == {1280 - apart % 1280}
        assert not late_resets(timing, 1, (low, low, low)).any()
        assert not late_resets(timing, 1, (high, high, low)).any()
        assert not late_resets(timing, 1, (None, low, None)).any()

    def test_the_pixels_have_it(self) -> None:
        """In the dark the loop steps up: the first two rows of each frame that shows a step gather
        10.7 us less, in their times and, under a light of their own, in their values."""
        pixels = EbapsPixels((8, 4096 // 8))
        kept = frozenset({"direct light"})  # mean light alone
        light = 2.0 * pixels.photoelectrons(1.0) ** -1 / 16e-3
        camera = Ebaps(pixels)
        camera.write("ebaps_window_low", 65_535)
        camera.write("ebaps_window_high", 65_535)
        scene = Still(np.full(pixels.shape, light))
        frames = list(camera.film(scene, 4 * 10**11, seed=1, kept=kept))
        stood = [frame.state["exposure_ns"] for frame in frames]
        steps = [n for n in range(1, len(stood)) if stood[n] > stood[n - 1]]
        assert len(steps) >= 3
        for n, frame in enumerate(frames):
            seconds = (frame.end - frame.begin) * 1e-12
            nominal = frame.state["exposure_ns"] * 1e-9
            late = [10.675e-6] * 2 if n in steps else []
            assert frame.state["rows_reset_late"] == len(late)
            want = nominal - np.array(late + [0.0] * (8 - len(late)))
            assert seconds == pytest.approx(want, abs=30e-9)
            value = pixels.silicon.black + 0.8 * pixels.tube.gain(1500.0) * 20.0 * (
                pixels.photoelectrons(light) * want
            )
            assert frame.values.mean(axis=1) == pytest.approx(value, rel=0.02)
            assert np.abs(np.diff(frame.values[2:].mean(axis=1))).max() < 1
            share = frame.values[:2].mean() - pixels.silicon.black
            whole = frame.values[2:].mean() - pixels.silicon.black
            assert share / whole == pytest.approx((want[0] / nominal), abs=1e-4)


def test_trace_of_the_imager(tmp_path: Path) -> None:
    camera = Ebaps(EbapsPixels((8, 16)))
    camera.write("ebaps_loop", 0)
    scene = Still(np.zeros((8, 16)))
    path = tmp_path / "a.vcd"
    frames = list(camera.film(scene, 10**11, seed=1, kept=frozenset(), trace=path))
    found = read_vcd(path.read_text())
    assert {name.lower() for name in DRIVES} <= set(found)
    drive, timing = Drive(), Timing()
    for name in ("SEL", "HSYNC"):
        rises = [ps for ps, value in found[name.lower()][1] if value]
        wanted = [timing.ps(c) for f in frames for c in drive.reading(name, f.number)[0].tolist()]
        assert rises == wanted
    duty = [ps for ps, _ in found["vsync"][1][1:]]
    assert duty == [timing.ps(c) for f in frames for c in drive.vsync(f.number, DEFAULT_EXPOSURE)]
