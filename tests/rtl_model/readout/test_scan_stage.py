"""The stage of the readout in a chain: what the host gets, over losses and interruptions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import Block, Clock, InputError
from cosim.compute.opencl import Device
from cosim.files.raw import TABLE, RawStream, markers, write_raw
from cosim.run.loop import Checkpoint, LostRecording
from cosim.spikes.viform import Viform, Words, unpack_planes
from rtl_model.readout import BIT_RATE
from rtl_model.readout.buffer import RowBuffer
from rtl_model.readout.report import loss_note, readout_metrics, readout_section
from rtl_model.readout.scan import ScanTiming, Window
from rtl_model.readout.stage import LOST, RAW, ScanStage

CLOCK, CYCLES = Clock(40_000), 70
BLOCKS = (Block(0, 32), Block(32, 32), Block(64, 6))
SLOW = 30_000_000_000


@pytest.fixture(scope="module")
def words() -> Words:
    words = np.random.default_rng(5).integers(0, 2**32, (3, 1000, 1000), np.uint32)
    words[-1] &= np.uint32((1 << CYCLES % 32) - 1)
    return words


def stage(
    folder: Path, device: Device | None, rate: int = BIT_RATE, size: int = 20_000,
    window: Window | None = None, keep: bool = True,
) -> ScanStage:  # fmt: skip
    buffer = RowBuffer(ScanTiming(CLOCK, window), rate, size)
    return ScanStage(buffer, CYCLES, folder, device, keep)


def passed(made: ScanStage, words: Words, blocks: tuple[Block, ...] = BLOCKS) -> list[Words]:
    """The words of each block behind the stage."""
    out = []
    for block in blocks:
        part = words[block.start // 32 :][:1]
        out.append(made.step(Viform(part, block.cycles, CLOCK, block.start), block).words)
    return out


def test_without_loss_the_file_is_that_of_a_converted_stream(
    tmp_path: Path, device: Device, words: Words
) -> None:
    made = stage(tmp_path, device)
    out = passed(made, words)
    assert all(after is words[n : n + 1] or after.base is words for n, after in enumerate(out))
    write_raw(Viform(words, CYCLES, CLOCK), tmp_path / "converted.raw")
    assert (tmp_path / RAW).read_bytes() == (tmp_path / "converted.raw").read_bytes()
    assert made.names == [RAW, LOST] and not made.lost.any()
    assert loss_note(made, BIT_RATE) is None


def host_planes(data: bytes, lost: Any) -> Any:
    """The planes that a host rebuilds from a file with the marks of the lost rows: by the markers
    of each block alone."""
    blocks = np.frombuffer(data, np.uint8).reshape(-1, 64)
    bits = np.unpackbits(blocks, axis=1, bitorder="little")
    place = {int(marker): n for n, marker in enumerate(markers())}
    marker = blocks[:, -2].astype(int) | blocks[:, -1].astype(int) << 8
    at = np.array([place[int(m) & 0xFFF0] for m in marker])
    there = ~np.unpackbits(lost, axis=1, bitorder="little").astype(bool)
    cycle = np.repeat(np.arange(CYCLES), 2 * there.sum(axis=1))
    planes = np.zeros((CYCLES, 1000, 2, 500), np.uint8)
    planes[cycle, TABLE.row[at], TABLE.half[at]] = bits[:, :500]
    return planes.reshape(CYCLES, 1000, 1000)


def test_what_is_lost_is_missing_in_the_file_and_dark_behind(
    tmp_path: Path, device: Device, words: Words
) -> None:
    made = stage(tmp_path, device, SLOW)
    out = np.concatenate(passed(made, words))
    figures = {name: metric.value for name, metric in readout_metrics(made, 4).items()}
    data, whole = (tmp_path / RAW).read_bytes(), CYCLES * 128_000
    assert whole - len(data) == figures["readout_lost_bytes"] == 128 * made.buffer.lost > 0
    assert len(data) == figures["readout_delivered_bytes"]
    assert figures["readout_offered_bytes"] == whole
    assert figures["readout_lane_bps"] == 10.24e9
    with np.load(tmp_path / LOST) as told:
        lost, fill = told["lost"], told["fill"]
    assert np.bitwise_count(lost).sum() == made.buffer.lost
    assert fill.max() == figures["readout_buffer_peak_bytes"] <= 20_000
    planes = unpack_planes(words, 0, CYCLES)
    expected = planes * ~np.unpackbits(lost, axis=1, bitorder="little").astype(bool)[:, :, None]
    assert np.array_equal(unpack_planes(out, 0, CYCLES), expected)
    assert np.array_equal(host_planes(data, lost), expected)
    with pytest.raises(InputError, match="blocks lost"):
        RawStream(tmp_path / RAW)
    said = loss_note(made, BIT_RATE)
    assert said is not None and "from 40.96 Gbit/s on" in said
    text = readout_section(made, 4, tmp_path)
    assert "are dark in the recorded stream" in text and "4 lanes of 10.24 Gbit/s" in text


@pytest.mark.parametrize("cut", [1, 2, 3])
def test_an_interrupted_run_has_the_same_bytes_and_counts(
    tmp_path: Path, device: Device, words: Words, cut: int
) -> None:
    """Interrupted after 32 and 64 cycles, and after the last one; blocks that were written after
    the checkpoint are written again."""
    folders = tmp_path / "whole", tmp_path / "cut"
    for folder in folders:
        folder.mkdir()
    whole, before = (stage(folder, device, SLOW) for folder in folders)
    expected = passed(whole, words)
    saved = Checkpoint(tmp_path / "checkpoint.npz", "this run")
    passed(before, words, BLOCKS[:cut])
    saved.save(BLOCKS[cut - 1].stop, {"scan": before})
    if cut == 1:
        assert not (folders[1] / RAW).exists()  # nothing half-written looks whole
        passed(before, words, (BLOCKS[1],))
    if cut == 2:
        passed(before, words, (BLOCKS[2],))  # its file has its name, and is taken up again
    resumed = stage(folders[1], device, SLOW)
    saved.load({"scan": resumed})
    rest = passed(resumed, words, BLOCKS[cut:])
    for one, other in zip(expected[cut:], rest, strict=True):
        np.testing.assert_array_equal(one, other)
    names = [{path.name: path.read_bytes() for path in folder.iterdir()} for folder in folders]
    assert names[0] == names[1] and set(names[0]) == {RAW, LOST}
    assert readout_metrics(resumed, 4) == readout_metrics(whole, 4)


def test_a_checkpoint_holds_the_rows_of_cycles_that_lost_some(
    tmp_path: Path, device: Device, words: Words
) -> None:
    sound, lossy = stage(tmp_path, device), stage(tmp_path, device, SLOW)
    for made in (sound, lossy):
        passed(made, words)
        state = made.state()
        cycles = int(made.lost.any(axis=1).sum())
        assert (cycles > 0) == (made is lossy)
        assert state["lost"].nbytes == 125 * cycles and state["fill"].nbytes == 8 * CYCLES
        again = stage(tmp_path, device)
        again.lost[:] = 255
        again.restore(state)
        np.testing.assert_array_equal(again.lost, made.lost)


def test_without_a_part_of_the_file_the_run_begins_again(
    tmp_path: Path, device: Device, words: Words
) -> None:
    made = stage(tmp_path, device)
    passed(made, words, BLOCKS[:1])
    saved = Checkpoint(tmp_path / "checkpoint.npz", "this run")
    saved.save(32, {"scan": made})
    part = tmp_path / f"{RAW}.part"
    assert saved.load({"scan": stage(tmp_path, device)}) == 32
    data = part.read_bytes()
    part.write_bytes(data[:-1] + bytes([data[-1] ^ 1]) + b"what was written later")
    with pytest.raises(LostRecording, match=f"{RAW}.part must be as the run wrote it, not damaged"):
        saved.load({"scan": stage(tmp_path, device)})
    part.write_bytes(data + b"what was written later")
    assert saved.load({"scan": stage(tmp_path, device)}) == 32
    part.write_bytes(data[:-1])
    with pytest.raises(LostRecording, match=f"{RAW}.part must have 4096000 bytes, not 4095999"):
        saved.load({"scan": stage(tmp_path, device)})
    part.unlink()
    again = stage(tmp_path, device)
    with pytest.raises(LostRecording, match=f"{RAW}.part must have 4096000 bytes, not 0"):
        saved.load({"scan": again})
    passed(again, words)
    assert (tmp_path / RAW).stat().st_size == CYCLES * 128_000


def test_with_a_sound_beginning_the_run_goes_back_to_the_checkpoint_before(
    tmp_path: Path, device: Device, words: Words
) -> None:
    made, notes = stage(tmp_path, device), list[str]()
    saved = Checkpoint(tmp_path / "checkpoint.npz", "this run")
    for block in BLOCKS[:2]:
        passed(made, words, (block,))
        saved.save(block.stop, {"scan": made})
    part = tmp_path / f"{RAW}.part"
    data = part.read_bytes()
    part.write_bytes(data[:-1])
    again = stage(tmp_path, device)
    assert saved.load({"scan": again}, note=notes.append) == BLOCKS[0].stop
    (note,) = notes
    assert note.endswith("not 8191999; the run goes back to cycle 32, its checkpoint before")
    passed(again, words, BLOCKS[1:2])
    assert part.read_bytes() == data


def test_a_window_is_all_that_is_offered(tmp_path: Path, device: Device, words: Words) -> None:
    window = Window((100, 349), (250, 899))
    made = stage(tmp_path, device, SLOW, window=window)
    out = np.concatenate(passed(made, words))
    assert made.buffer.offered == CYCLES * 250 and not made.buffer.lost  # the blank time suffices
    expected = np.zeros_like(words)
    expected[:, 100:350, 250:900] = words[:, 100:350, 250:900]
    np.testing.assert_array_equal(out, expected)
    write_raw(Viform(expected, CYCLES, CLOCK), tmp_path / "converted.raw")
    whole = np.fromfile(tmp_path / "converted.raw", np.uint8).reshape(CYCLES, 1000, 128)
    assert (tmp_path / RAW).read_bytes() == whole[:, 100:350].tobytes()


def test_numpy_reads_what_the_kernel_reads(tmp_path: Path, device: Device, words: Words) -> None:
    made = []
    for name, chosen in (("kernel", device), ("numpy", None)):
        (tmp_path / name).mkdir()
        each = stage(tmp_path / name, chosen, SLOW)
        passed(each, words[2:], (Block(0, 6),))
        made.append((tmp_path / name / f"{RAW}.part").read_bytes())
    assert made[0] == made[1]


def test_without_a_file_all_else_is_the_same(tmp_path: Path, device: Device, words: Words) -> None:
    kept, plain = (stage(tmp_path, device, SLOW, keep=keep) for keep in (True, False))
    for one, other in zip(passed(kept, words), passed(plain, words), strict=True):
        np.testing.assert_array_equal(one, other)
    assert plain.names == [LOST]
    assert readout_metrics(plain, 4) == readout_metrics(kept, 4)
