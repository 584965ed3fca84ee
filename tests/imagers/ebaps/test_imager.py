"""The whole EBAPS: loop, KEY, darks, registers and frames together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.errors import InputError
from cosim.frames import Frame
from imagers.common.registers import line_of
from imagers.common.scenery import Course, Still
from imagers.ebaps.board.timing import LIVE, Timing, region_bytes
from imagers.ebaps.device.imager import Ebaps
from imagers.ebaps.device.sequencer import DESIGN, bus_target
from imagers.ebaps.pixels import Chart, EbapsPixels, wanted_exposure
from tests.imagers.ebaps.ideal_memory import IdealMemory
from tests.rtl_model.registers.checks import faults

SHAPE = (24, 64)
PIXELS = EbapsPixels(SHAPE)
KEPT = frozenset(PIXELS.effects)
QUIET = KEPT - {"shot noise", "electron loss", "gain spread", "ion events", "read noise"}
SECOND = 10**12
NIGHT = sum(Chart(3e-3).plane) / 2
"""Lux on the plane."""


def still(lux: float, *knots: tuple[int, float]) -> Still:
    return Still(np.full(SHAPE, lux), Course(knots) if knots else Course())


def filmed(imager: Ebaps, scene: Still, seconds: float, kept: frozenset[str] = KEPT) -> list[Frame]:
    return list(imager.film(scene, int(seconds * SECOND), seed=2, kept=kept))


def imager(**registers: int) -> Ebaps:
    made = Ebaps(PIXELS)
    for name, value in registers.items():
        made.write(f"ebaps_{name}", value)
    return made


class TestExposure:
    def test_it_settles_inside_the_window(self) -> None:
        """3e-3 lx, -1500 V: with darks taken at the exposure that it rests at."""
        frames = filmed(imager(refresh=1), still(NIGHT), 3.0)
        live = [f for f in frames if not f.state["key"]][-10:]
        assert all(f.state["settled"] for f in live)
        assert all(24_000 <= f.state["mean"] <= 25_600 for f in live)
        assert len({f.exposure for f in live}) == 1
        assert live[-1].state["dark_exposure_ns"] == live[-1].state["exposure_ns"]

    def test_it_hunts_where_analysis_says(self) -> None:
        """Light that wants 3.25 ms, between two points of the grid, a step apart."""
        wanted = wanted_exposure(PIXELS, NIGHT, 24_800)
        camera = imager(subtract=0, exposure=4_000_000, window_low=24_000, window_high=24_200)
        frames = filmed(camera, still(NIGHT * wanted / 3.25e-3), 1.0, QUIET)
        seen = [f.state["exposure_ns"] for f in frames[-16:]]
        assert len(set(seen)) == 2 and max(seen) - min(seen) == 640_000
        assert not any(f.state["settled"] for f in frames[-16:])

    @pytest.mark.parametrize(("lux", "end", "flag"), [
        (0.0, 32_768_000, "too_dark"), (NIGHT * 1e4, 1_000_000, "too_bright"),
    ])  # fmt: skip
    def test_it_clips(self, lux: float, end: int, flag: str) -> None:
        last = filmed(imager(), still(lux), 3.8)[-1]
        assert last.state["exposure_ns"] == end and last.state[flag] == 1
        assert last.exposure == end * 1000

    def test_a_frame_changes_the_one_after_next(self) -> None:
        frames = filmed(imager(loop=3), still(0.0), 0.5)
        assert [f.state["exposure_ns"] for f in frames[:4]] == [
            16_384_000, 16_384_000, 17_024_000, 17_664_000,
        ]  # fmt: skip
        waits = filmed(imager(), still(0.0), 0.5)
        assert [f.state["exposure_ns"] for f in waits[:5]] == [
            16_384_000, 16_384_000, 17_024_000, 17_024_000, 17_664_000,
        ]  # fmt: skip

    def test_the_loop_can_be_switched_off_and_the_host_rules(self) -> None:
        camera = imager(loop=0, exposure=5_000_000)
        camera.write("ebaps_exposure", 7_000_000, at=SECOND // 10)
        got = [f.state["exposure_ns"] for f in filmed(camera, still(0.0), 0.4)]
        # Frame 3 begins at 0.1 s: a write at that instant still counts for it.
        assert got[:5] == [5e6, 5e6, 5e6, 7e6, 7e6]
        assert camera.read("ebaps_exposure") == 7_000_000

    def test_out_of_range_is_clipped_with_the_frame(self) -> None:
        assert filmed(imager(loop=0, exposure=10), still(0.0), 0.1)[0].exposure == 10**9
        long = filmed(imager(loop=0, exposure=60_000_000), still(0.0), 0.1)[0]
        assert long.exposure == 32_768 * 10**6


class TestDarks:
    @pytest.mark.parametrize("seconds", [0.2, 0.21])  # at a VSYNC, and between two
    def test_key_stores_four_and_the_loop_stands_still(self, seconds: float) -> None:
        camera = imager()
        frames = filmed(camera, still(NIGHT), seconds)
        exposure = frames[-1].state["next_exposure_ns"]
        camera.store_darks()
        frames = filmed(camera, still(NIGHT), 0.6)
        keys = [f.number for f in frames if f.state["key"]]
        assert len(keys) == 4 and keys == list(range(keys[0], keys[0] + 4))
        assert {f.state["exposure_ns"] for f in frames if f.state["key"]} == {exposure}
        # The shutter is closed for them: black and dark current, no light.
        level = PIXELS.mean_variance(0.0, exposure * 1e-9)[0]
        assert all(abs(f.state["mean"] - level) < 200 for f in frames if f.state["key"])
        live = [f for f in frames if f.number > keys[-1]]
        for f in live:
            assert f.state["raw_mean"] - f.state["mean"] == pytest.approx(level, abs=200)

    def test_corrected_is_live_less_the_mean_of_four(self) -> None:
        memory = IdealMemory()
        camera = Ebaps(PIXELS, memory=memory)
        camera.write("ebaps_loop", 0)
        camera.store_darks()
        frames = filmed(camera, still(NIGHT), 0.3)
        total = sum(memory.read(n).astype(int) for n in range(4))
        live = memory.read(LIVE).astype(int)
        assert (frames[-1].values == np.clip(live - (total >> 2), 0, 65_535)).all()
        darks = [f.values for f in frames if f.state["key"]]
        for region, dark in enumerate(darks):
            assert (memory.read(region) == dark).all()

    def test_no_subtraction_before_four_are_there_nor_when_switched_off(self) -> None:
        camera = imager(loop=0)
        camera.write("ebaps_key", 1, at=1)
        camera.write("ebaps_key", 0, at=SECOND // 11)  # three frames
        assert all(f.state["mean"] == f.state["raw_mean"] for f in filmed(camera, still(0.0), 0.4))
        camera.store_darks()
        camera.write("ebaps_subtract", 0)
        assert filmed(camera, still(0.0), 0.8)[-1].state["mean"] > 3000

    def test_with_the_shutter_open_light_is_stored(self) -> None:
        """What the board does when nobody covers the lens: the picture takes itself away."""
        camera = imager(loop=0, shutter=0)
        camera.store_darks()
        frames = filmed(camera, still(NIGHT), 0.4, QUIET)
        assert max(f.state["mean"] for f in frames[5:]) < 100  # of 15 000: noise, clipped at zero

    def test_stale_darks_are_told(self) -> None:
        camera = imager(loop=0)
        camera.store_darks()
        filmed(camera, still(0.0), 0.3)
        assert camera.read("ebaps_status") >> 3 & 3 == 1
        assert camera.read("ebaps_dark_exposure") == 16_384_000
        camera.write("ebaps_high_voltage", 1000)
        filmed(camera, still(0.0), 0.5)
        assert camera.read("ebaps_status") >> 3 & 3 == 3


class TestWhole:
    def test_thirty_frames_a_second_rolling(self) -> None:
        frames = filmed(imager(loop=0), still(NIGHT), 1.1)
        assert len(frames) == 32  # the first is ready 66.1 ms after power-on
        t = Timing()
        for f in frames:
            assert (np.diff(f.begin) == 32 * 10**6).all() and (np.diff(f.end) == 32 * 10**6).all()
            assert f.ready == t.ps(t.ready(f.number))
            assert f.end[0] == t.ps(t.vsync(f.number + 1))

    def test_it_can_be_filmed_in_pieces(self) -> None:
        scene = still(NIGHT, (0, 1.0), (SECOND // 3, 4.0))
        whole = filmed(imager(), scene, 1.0)
        camera, pieces = imager(), []
        for end in (0.01, 0.3, 0.301, 0.7, 1.0):
            pieces += filmed(camera, scene, end)
        assert [f.number for f in pieces] == [f.number for f in whole]
        assert all((a.values == b.values).all() for a, b in zip(pieces, whole, strict=True))

    def test_high_voltage_makes_the_light_seen(self) -> None:
        """Gain register by register: the mean over black follows the tube's gain."""
        signals = []
        for volts in (0, 700, 1500):
            camera = imager(loop=0, high_voltage=volts)
            frame = filmed(camera, still(NIGHT), 0.07, QUIET)[0]
            black = PIXELS.at(volts=0.0).mean_variance(0.0, 16.384e-3)[0]
            signals.append(frame.state["mean"] - black)
        gain = PIXELS.tube.gain
        assert abs(signals[0]) < 100
        assert signals[2] / signals[1] == pytest.approx(gain(1500) / gain(700), rel=0.1)
        assert filmed(imager(high_voltage=2000), still(0.0), 0.07)[0].state["high_voltage"] == 1500

    def test_trace(self, tmp_path: Path) -> None:
        camera = imager(loop=0)
        path = tmp_path / "a.vcd"
        list(camera.film(still(0.0), SECOND // 5, seed=1, kept=KEPT, trace=path))
        lines = path.read_text().splitlines()
        t = Timing()
        for frame in range(3):
            assert f"#{t.ps(t.rise(frame, 16_384_000))}" in lines
            assert f"#{t.ps(t.vsync(frame + 1))}" in lines

    def test_five_regions(self) -> None:
        assert region_bytes() == 1280 * 1024 * 2
        with pytest.raises(ValueError, match="0 to 4"):
            IdealMemory().store(5, np.zeros((1, 1), np.uint16))

    def test_bad_input_is_one_line(self) -> None:
        camera = imager()
        filmed(camera, still(0.0), 0.1)
        for wrong in (
            lambda: camera.write("ebaps_gain", 1),
            lambda: camera.write("ebaps_mean", 1),
            lambda: camera.write("ebaps_key", 1, at=5),
            lambda: camera.read("nothing"),
        ):
            with pytest.raises(InputError) as told:
                wrong()
            assert "\n" not in str(told.value)
        with pytest.raises(ValueError, match="must fit"):
            Ebaps(EbapsPixels((2000, 10)))


class TestRegisters:
    def test_the_table_is_sound(self) -> None:
        assert faults(DESIGN.registers, DESIGN.memories, DESIGN.values) == []
        assert "ebaps_exposure" in DESIGN.csr_csv()
        assert "takes effect with the next" in DESIGN.document()

    def test_the_sequencer_alone_settles(self) -> None:
        """Without pixels, behind the bus: the loop climbs to 19.584 ms, the first point inside."""
        alone = bus_target()
        bus = line_of(alone)
        assert bus is not None
        alone.advance(40_000_000)
        assert alone.registers.read("ebaps_exposure") == 19_584_000
        assert 24_000 <= alone.registers.read("ebaps_mean") <= 25_600
        assert alone.registers.read("ebaps_status") & 1
        alone.reset(40_000_000)
        ready = Timing().ready(0)
        alone.advance(40_000_000 + ready)
        assert alone.registers.read("ebaps_frames") == 0
        alone.advance(40_000_000 + ready + 1)
        assert alone.registers.read("ebaps_frames") == 1
