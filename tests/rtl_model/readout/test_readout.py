"""The row scan: its bytes pass the reader of the sensor's files and equal numpy's; its timing."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from cosim import Clock, InputError
from cosim.compute.opencl import Device, open_device
from cosim.files.raw import FRAME_BYTES, TABLE, RawStream, write_raw
from cosim.spikes.viform import Viform, Words, words_for
from rtl_model.readout import BIT_RATE, Readout, read_in_numpy
from rtl_model.readout.scan import BLOCK_PS, ScanTiming, Window

CLOCK = Clock(40_000)


@pytest.fixture(scope="module")
def device() -> Device:
    return open_device()


def random_words(cycles: int) -> Words:
    words = np.random.default_rng(7).integers(0, 2**32, (words_for(cycles), 1000, 1000), np.uint32)
    if cycles % 32:
        words[-1] &= np.uint32((1 << cycles % 32) - 1)
    return words


@pytest.mark.parametrize("cycles", [1, 37])
def test_the_reader_of_the_sensors_files_takes_the_bytes(
    tmp_path: Path, device: Device, cycles: int
) -> None:
    words = random_words(cycles)
    raw = Readout(device).read(words, cycles)
    assert raw.nbytes == cycles * FRAME_BYTES
    (tmp_path / "a.raw").write_bytes(raw.tobytes())
    write_raw(Viform(words, cycles, CLOCK), tmp_path / "b.raw")
    assert (tmp_path / "a.raw").read_bytes() == (tmp_path / "b.raw").read_bytes()
    stream = RawStream(tmp_path / "a.raw")
    assert (stream.cycles, stream.notes) == (cycles, ())
    np.testing.assert_array_equal(stream.read_words(0, len(words)), words)


@pytest.mark.parametrize(
    "window",
    [
        Window(),
        Window((0, 0), (0, 0)),
        Window((999, 999), (999, 999)),
        Window((123, 641), (471, 530)),
        Window((500, 506), (500, 999)),
    ],
)
def test_the_kernel_is_bit_true_to_numpy(device: Device, window: Window) -> None:
    words = random_words(35)
    made = Readout(device, window).read(words, 35)
    np.testing.assert_array_equal(made, read_in_numpy(words, 35, window))


def test_a_window_is_the_same_rows_of_the_whole_frame(device: Device) -> None:
    """Its blocks equal those of the full frame, with markers, and read 0 outside its columns."""
    words, window = random_words(3), Window((450, 549), (30, 700))
    kept = words.copy()
    kept[:, :, :30] = kept[:, :, 701:] = 0
    whole = Readout(device).read(kept, 3)
    rows = (TABLE.row >= 450) & (TABLE.row <= 549)
    np.testing.assert_array_equal(Readout(device, window).read(words, 3), whole[:, rows])


def test_one_spike_stands_where_the_layout_says(device: Device) -> None:
    """Pixel (3, 517) of cycle 5: bit 17 of the right half of row 3, line 497 of channel 1."""
    words = np.zeros((1, 1000, 1000), np.uint32)
    words[0, 3, 517] = 1 << 5
    raw = Readout(device).read(words, 6)
    empty = Readout(device).read(np.zeros_like(words), 6)
    changed = np.argwhere(raw != empty)
    assert changed.tolist() == [[5, 7, 2]]
    assert raw[5, 7, 2] == 1 << 1
    assert int.from_bytes(raw[5, 7, -2:].tobytes(), "little") == 1 << 14 | 497 << 4


def test_a_frame_takes_a_40_khz_cycle() -> None:
    """1000 rows of 1024 bits at 40.96 Gbit/s take 25 us, without gaps between blocks or cycles and
    without drift."""
    assert (BIT_RATE, BLOCK_PS) == (40_960_000_000, 12_500)
    timing = ScanTiming(CLOCK)
    assert timing.scan_ps == 25_000_000
    starts = np.concatenate([timing.starts(k) for k in (0, 1, 2, 3)])
    assert starts[0] == 25_000_000  # what is latched in a cycle is read in the next
    assert (np.diff(starts) == BLOCK_PS).all()


def test_fewer_rows_allow_a_shorter_cycle() -> None:
    window = Window((100, 349))
    timing = ScanTiming(Clock(160_000), window)
    assert timing.scan_ps == 250 * 25_000 == Clock(160_000).edge(1)
    assert all(b - a == BLOCK_PS for a, b in pairwise(timing.starts(12).tolist()))
    with pytest.raises(InputError, match=r"at most 160000 Hz, at which 250 rows .* not 160001 Hz"):
        ScanTiming(Clock(160_001), window)
    with pytest.raises(InputError, match="at most 40000 Hz"):
        ScanTiming(Clock(40_001))


@pytest.mark.parametrize("window", [Window((5, 4)), Window((0, 1000)), Window(columns=(-1, 3))])
def test_a_window_off_the_chip_is_refused(window: Window) -> None:
    with pytest.raises(InputError, match="first to last within 0 to 999"):
        window.checked()


def test_other_shapes_are_refused(device: Device) -> None:
    readout, words = Readout(device, Window((0, 1))), np.zeros((1, 1000, 1000), np.uint32)
    for cycles in (0, 33):
        with pytest.raises(ValueError, match="words must be"):
            readout.read(words, cycles)
    with pytest.raises(ValueError, match="bytes must be"):
        readout.read(words, 32, np.empty((32, 3, 64), np.uint8))
