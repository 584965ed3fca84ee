"""Frames through FIFO, AXI4 and DDR: rules of the bus, the two ways compared, throughput."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imagers.common.scenery import Still
from imagers.ebaps.board.axi import (
    BURST_BEATS,
    AxiRules,
    Beat,
    Burst,
    ReadMaster,
    Signals,
    burst_address,
    bursts_of,
    region_offset,
)
from imagers.ebaps.board.crossing import Clocks, Path, burst_clocks, memory_load, transfer
from imagers.ebaps.board.fifo import AsyncFifo
from imagers.ebaps.board.memory import BurstMemory, Ddr, DdrPort
from imagers.ebaps.board.timing import REGIONS, region_bytes
from imagers.ebaps.device.imager import Ebaps
from imagers.ebaps.pixels import EbapsPixels
from tests.imagers.ebaps.clocked_memory import ClockedMemory
from tests.imagers.ebaps.ideal_memory import IdealMemory

MHZ = 1_000_000
QUIET = Signals(None, True, None, True, False, True, None, True, None, True)


def picture(seed: int, shape: tuple[int, int] = (8, 40)) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 65_536, shape, np.uint16)


class TestAddresses:
    def test_regions_and_bursts(self) -> None:
        assert [region_offset(n) for n in range(5)] == [2_621_440 * n for n in range(5)]
        assert burst_address(0x1000, 4, 1024) == 0x1000 + 4 * 2_621_440 + 1024
        bursts = list(bursts_of(0, 4, region_bytes()))
        assert len(bursts) == 2560 and {beats for _, beats in bursts} == {64}
        assert bursts[-1].address + 1024 == 5 * 2_621_440
        assert list(bursts_of(0, 0, 1030)) == [Burst(0, 64), Burst(1024, 1)]
        with pytest.raises(ValueError, match="0 to 4"):
            region_offset(5)

    def test_no_burst_of_a_frame_crosses(self) -> None:
        for address, beats in bursts_of(0x3000, 3, region_bytes(), 256):
            assert address // 4096 == (address + 16 * beats - 1) // 4096


class TestRules:
    """A rule that is broken is told; one that is not, is not."""

    def faults(self, *signals: dict[str, object]) -> list[str]:
        rules = AxiRules()
        for changed in signals:
            rules.see(QUIET._replace(**changed))
        return rules.faults

    def test_valid_stays(self) -> None:
        held = {"aw": Burst(0, 1), "awready": False}
        assert self.faults(held, held, {"aw": Burst(0, 1)}) == []
        assert "clock 1: AWVALID" in self.faults(held, {})[0]
        assert "AWVALID" in self.faults(held, {"aw": Burst(16, 1)})[0]
        beat = {"w": Beat(1, 1, True), "wready": False}
        assert "WVALID" in self.faults(beat, {"w": Beat(2, 1, True)})[0]
        wrote = [{"aw": Burst(0, 1), "w": Beat(1, 1, True)}, {"b": True, "bready": False}]
        assert self.faults(*wrote, {"b": True}) == []
        assert "BVALID fell" in self.faults(*wrote, {})[0]

    def test_bursts(self) -> None:
        for channel in ("aw", "ar"):
            assert self.faults({channel: Burst(4096 - 16, 1)}) == []
            assert "crosses" in self.faults({channel: Burst(4096 - 16, 2)})[0]
            assert self.faults({channel: Burst(0, 256)}) == []
            assert "257 beats" in self.faults({channel: Burst(0, 257)})[0]
            assert "0 beats" in self.faults({channel: Burst(16, 0)})[0]

    def test_last_beats_and_answers(self) -> None:
        asked, more, last = {"aw": Burst(0, 2)}, {"w": Beat(0, 1, False)}, {"w": Beat(0, 1, True)}
        assert self.faults(asked, more, last, {"b": True}) == []
        assert self.faults(more, last, asked, {"b": True}) == []  # data may come first
        assert "beat 1 of a burst of 2" in self.faults(asked, last)[0]
        assert "WLAST was low" in self.faults(asked, more, more)[0]
        assert "BVALID before" in self.faults(asked, more, {"b": True})[0]
        asked, more, last = {"ar": Burst(0, 2)}, {"r": Beat(0, 1, False)}, {"r": Beat(0, 1, True)}
        assert self.faults(asked, more, last) == []
        assert "RLAST" in self.faults(asked, last)[0]
        assert "RLAST" in self.faults(asked, more, more)[0]
        assert "without an address" in self.faults(more)[0]

    def test_a_frame_from_a_crooked_bias_crosses(self) -> None:
        done = transfer(Ddr(512), Path(bias=512), write=(0, picture(1, (32, 80))), read=None)
        assert done.done and any("crosses 4 KiB" in fault for fault in done.faults)
        with pytest.raises(ValueError, match="multiple of 4096"):
            BurstMemory(bias=512)
        with pytest.raises(ValueError, match="divide 4096"):
            BurstMemory(beats=48)


class TestTwoWays:
    @settings(max_examples=12, deadline=None)
    @given(
        st.integers(0, 2**31 - 1),
        st.tuples(st.integers(1, 9), st.integers(1, 61)),
        st.sampled_from([1, 4, 16, 64]),
        st.floats(0, 0.7),
        st.tuples(st.integers(5, 60), st.integers(100, 400), st.integers(20, 200)),
        st.integers(0, 4),
    )
    def test_bytes_and_bursts_are_the_same(
        self, seed: int, shape: tuple[int, int], beats: int, stall: float,
        mhz: tuple[int, int, int], region: int,
    ) -> None:  # fmt: skip
        """Random shapes, bursts, clocks, phases and back-pressure."""
        clocks = Clocks(*(f * MHZ for f in mhz), phases=(seed % 999, seed % 7919, seed % 4001))
        fast = BurstMemory(bias=4096, beats=beats)
        slow = ClockedMemory(Path(4096, clocks, stall, beats=beats, seed=seed))
        old, new = picture(seed, (9, 61)), picture(seed + 1, shape)
        for memory in (fast, slow):
            memory.ddr.bytes[4096 + region_offset(region) :][: old.nbytes] = old.view(np.uint8).flat
            memory.store(region, new)
        assert np.array_equal(fast.ddr.bytes, slow.ddr.bytes)  # what lies behind the frame as well
        assert slow.last.faults == []
        assert slow.last.writes == list(bursts_of(4096, region, new.nbytes, beats))
        assert np.array_equal(fast.read(region), new) and np.array_equal(slow.read(region), new)
        assert slow.last.reads == list(bursts_of(4096, region, new.nbytes, beats))
        assert slow.last.faults == [] and slow.last.underflows == 0
        assert fast.bursts == slow.bursts

    def test_whole_frames(self) -> None:
        memory, plain = BurstMemory(), IdealMemory()
        for region in range(REGIONS):
            frame = picture(region, (1024, 1280))
            memory.store(region, frame)
            plain.store(region, frame)
        for region in range(REGIONS):
            assert np.array_equal(memory.read(region), plain.read(region))
            begin = region_offset(region)
            there = memory.ddr.bytes[begin : begin + region_bytes()]
            assert np.array_equal(there, plain.read(region).view(np.uint8).ravel())
        assert memory.bursts == 10 * 2560

    def test_one_rd_en_keeps_five_frames_together(self) -> None:
        memory = BurstMemory()
        frames = [picture(n) for n in range(REGIONS)]
        for region, frame in enumerate(frames):
            memory.store(region, frame)
        done = transfer(memory.ddr, Path(stall=0.4, seed=5), read=(range(REGIONS), frames[0].shape))
        assert all(np.array_equal(done.frames[n], frame) for n, frame in enumerate(frames))
        assert done.underflows == 0 and done.most_read <= 512
        assert sorted(done.reads) == sorted(
            burst for region in range(REGIONS) for burst in bursts_of(0, region, frames[0].nbytes)
        )

    def test_bad_frames(self) -> None:
        memory = BurstMemory()
        with pytest.raises(ValueError, match="0 to 4"):
            memory.store(5, picture(0))
        with pytest.raises(ValueError, match="uint16"):
            memory.store(0, picture(0).astype(np.int32))  # type: ignore[arg-type]
        with pytest.raises(ValueError, match="must fit 2621440"):
            memory.store(0, np.zeros((1025, 1280), np.uint16))
        with pytest.raises(KeyError):
            memory.read(0)


class TestThroughput:
    def test_clocks_of_a_burst(self) -> None:
        """The closed form against the machine: eight bursts more, nothing else in the way."""
        for beats, latency in ((32, 20), (16, 3)):
            took = {}
            for count in (8, 16):
                frame = np.zeros((count, 8 * beats), np.uint16)
                fast = Clocks(pixel=2500 * MHZ, display=1900 * MHZ)
                path = Path(clocks=fast, beats=beats, latency=latency, depth=4096)
                took[count] = (
                    transfer(Ddr(), path, write=(0, frame)).clocks,
                    transfer(Ddr(), path, read=([0], frame.shape)).clocks,
                )
            write, read = (b - a for a, b in zip(took[8], took[16], strict=True))
            assert write == 8 * burst_clocks(beats, latency)
            assert read == 8 * burst_clocks(beats, latency, write=False)

    def test_the_load_fits(self) -> None:
        load = 2560 * 30 * (87 + 5 * 86) / 200e6
        assert memory_load() == pytest.approx(load, rel=1e-12)
        assert memory_load() < 0.2

    def test_writing_goes_on_while_five_are_read(self) -> None:
        """Live pixels at 40 MHz without a pause, four darks and a live frame read, READY low in
        six clocks of ten."""
        ddr = Ddr()
        frames = [picture(n, (20, 128)) for n in range(4)]
        for n, frame in enumerate(frames):
            ddr.bytes[region_offset(n) :][: frame.nbytes] = frame.view(np.uint8).flat
        live = picture(9, (20, 128))
        done = transfer(
            ddr, Path(clocks=Clocks(phases=(3, 1, 2)), stall=0.6, seed=3),
            write=(4, live), read=(range(4), live.shape),
        )  # fmt: skip
        assert done.done and done.faults == []
        assert (done.overflows, done.underflows) == (0, 0)
        assert all(np.array_equal(done.frames[n], frame) for n, frame in enumerate(frames))
        assert np.array_equal(ddr.bytes[region_offset(4) :][: live.nbytes].view("<u2"), live.flat)
        assert BURST_BEATS <= done.most < 2 * BURST_BEATS  # of 512

    def test_too_slow_a_memory_is_told(self) -> None:
        slow = Path(clocks=Clocks(memory=2 * MHZ))
        done = transfer(Ddr(), slow, write=(0, picture(0, (110, 80))))
        assert not done.done and done.overflows > 0

    def test_bad_settings(self) -> None:
        with pytest.raises(ValueError, match="below 1"):
            DdrPort(Ddr(), stall=1)
        with pytest.raises(ValueError, match="0 or more"):
            Ddr(-1)
        with pytest.raises(ValueError, match="room for a burst"):
            ReadMaster([AsyncFifo(64, prog_empty=1, prog_full=60)])
        with pytest.raises(ValueError, match="1 to 256"):
            transfer(Ddr(), Path(beats=257, depth=1024))
        with pytest.raises(IndexError, match="beyond the memory"):
            ddr = Ddr()
            ddr.write(ddr.bytes.size - 8, 0, 0xFFFF)


def test_the_imager_films_the_same_through_every_memory() -> None:
    pixels = EbapsPixels((6, 24))
    scene = Still(np.full((6, 24), 1e-4))
    films = []
    for memory in (IdealMemory(), None, ClockedMemory(Path(stall=0.5))):
        camera = Ebaps(pixels, memory=memory)
        camera.store_darks()
        kept = frozenset(pixels.effects)
        films.append([f.values for f in camera.film(scene, 3 * 10**11, seed=3, kept=kept)])
    assert len(films[0]) == 8 and isinstance(Ebaps(pixels).memory, BurstMemory)
    for film in films[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(film, films[0], strict=True))
