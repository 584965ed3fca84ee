"""`.raw`: the layout bit by bit, captures that start and stop anywhere, lost and damaged blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import Clock, InputError, Viform
from cosim.files import notes_of, open_stream, write_stream
from cosim.files.raw import TABLE, Table, markers, write_raw
from cosim.spikes.viform import unpack_planes

FRAME, BLOCK, BLOCKS = 128_000, 64, 2000
CYCLES = 34
"""Of the capture that most tests read: more than one word."""


@pytest.fixture(scope="module")
def planes() -> np.ndarray:
    """(34, 1000, 1000) spikes."""
    words = np.random.default_rng(7).integers(0, 2**32, (2, 1000, 1000), np.uint32)
    return unpack_planes(words, 0, CYCLES)


def formula(planes: np.ndarray) -> bytes:
    """The format from its definition: rows of 1024 bits, with a marker at the end of each half."""
    rows = np.zeros((len(planes), 1000, 1024), np.uint8)
    rows[..., :500], rows[..., 512:1012] = planes[..., :500], planes[..., 500:]
    for row in range(1000):
        line, lower = (row - 499, 1) if row >= 500 else (500 - row, 0)
        for half in (0, 1):
            word = line << 4 | (2 * lower + half) << 14
            last = 512 * half + 496
            for bit in range(4, 16):
                rows[:, row, last + bit] = word >> bit & 1
    return np.packbits(rows.reshape(len(planes), -1), axis=1, bitorder="little").tobytes()


@pytest.fixture(scope="module")
def capture(planes: np.ndarray) -> bytes:
    return formula(planes)


def read(path: Path) -> np.ndarray:
    stream = open_stream(path)
    assert stream.shape == (1000, 1000)
    words = stream.read_words(0, -(-stream.cycles // 32))
    return unpack_planes(words, 0, stream.cycles)


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as refused:
        read(path)
    assert len(str(refused.value).splitlines()) == 1
    return str(refused.value)


def test_the_table_names_every_half_row_once_and_starts_where_frames_start() -> None:
    for pair in (TABLE.channel * 1000 + TABLE.line, TABLE.row * 2 + TABLE.half):
        assert len(set(pair.tolist())) == BLOCKS
    assert (TABLE.channel.min(), TABLE.channel.max()) == (0, 3)
    assert (TABLE.line.min(), TABLE.line.max()) == (1, 500)
    assert (TABLE.channel[0], TABLE.line[0]) == (0, 500)
    assert (TABLE.channel[-1], TABLE.line[-1]) == (3, 500)


def test_a_marker_is_where_the_format_says() -> None:
    one = Table(*(np.array([n]) for n in (3, 500, 999, 1)))
    word = int(markers(one)[0])
    assert ((word >> 4) & 0x3FF, word >> 14, word & 15) == (500, 3, 0)


def test_what_is_written_is_the_format_and_is_read(tmp_path: Path, planes, capture) -> None:
    path = tmp_path / "a.raw"
    write_raw(Viform.from_planes(planes, Clock(40_000)), path)
    assert path.read_bytes() == capture
    assert len(capture) == CYCLES * FRAME
    np.testing.assert_array_equal(read(path), planes)
    stream = open_stream(path)
    assert (stream.cycles, stream.clock, notes_of(stream)) == (CYCLES, Clock(40_000), ())
    np.testing.assert_array_equal(unpack_planes(stream.read_words(1, 2), 0, 2), planes[32:])


@pytest.mark.parametrize("before", [0, 64, 64 * 777, FRAME - 64, 1, 127_001])
@pytest.mark.parametrize("after", [0, 64, 30_001])
def test_a_capture_may_start_and_stop_anywhere(
    tmp_path: Path, planes, capture, before: int, after: int
) -> None:
    path = tmp_path / "a.raw"
    path.write_bytes(capture[FRAME - before if before else FRAME : 3 * FRAME + after])
    np.testing.assert_array_equal(read(path), planes[1:3])
    said = [f"{before} before the first whole frame"] if before else []
    said += [f"{after} after the last"] if after else []
    expected = (f"bytes of {path} left out: {', '.join(said)}",) if said else ()
    assert notes_of(open_stream(path)) == expected


@pytest.mark.parametrize(
    ("frame", "block", "lost", "keeps"),
    [(0, 1999, 1, 0), (1, 0, 1, 1), (2, 500, 17, 2), (2, 1990, 30, 2), (3, 1999, 1, 3)],
)
def test_lost_blocks_are_named(
    tmp_path: Path, capture, frame: int, block: int, lost: int, keeps: int
) -> None:
    path = tmp_path / "a.raw"
    at = frame * FRAME + block * BLOCK
    path.write_bytes(capture[:at] + capture[at + lost * BLOCK : 5 * FRAME])
    n = (block + lost) % BLOCKS
    if frame == 0:  # the next frame is the first whole one
        assert refusal(path) == (
            f"{path} must be whole up to its first whole frame, not one with lost or damaged "
            f"blocks at byte {at - BLOCK}; leave them out: tail -c +{at + 1} {path} > OUT.raw"
        )
        return
    assert refusal(path) == (
        f"{path} must be channel {TABLE.channel[block]} line {TABLE.line[block]} at byte {at} in "
        f"frame {frame}, not channel {TABLE.channel[n]} line {TABLE.line[n]}, blocks lost: "
        f"{lost}; keep what comes before frame {frame}: head -c {keeps * FRAME} {path} > OUT.raw"
    )
    path.write_bytes(path.read_bytes()[: keeps * FRAME])
    assert open_stream(path).cycles == keeps


@pytest.mark.parametrize("frame", [0, 2, 4])
@pytest.mark.parametrize(("block", "bit"), [(0, 4), (3, 15), (1234, 13), (1999, 14)])
def test_a_damaged_marker_is_named(
    tmp_path: Path, capture, frame: int, block: int, bit: int
) -> None:
    path = tmp_path / "a.raw"
    at = frame * FRAME + block * BLOCK
    content = bytearray(capture[: 5 * FRAME + 100 * BLOCK])
    content[at + 62 + bit // 8] ^= 1 << bit % 8
    path.write_bytes(content)
    text = refusal(path)
    if frame != 2:  # both ends are looked at before anything is asked for
        with pytest.raises(InputError):
            open_stream(path)
    if (frame, block) == (0, 0):
        assert f"lost or damaged blocks at byte {at};" in text
    elif frame == 0:  # the frame after it is whole, so what comes before is no frame
        assert f"at byte {at}" in text
    else:
        assert (
            f"must be channel {TABLE.channel[block]} line {TABLE.line[block]} at byte {at}" in text
        )
        assert f" in frame {frame}, not " in text
        assert text.split("; ")[0].endswith(("a damaged marker", "out of order"))


def test_a_capture_with_damage_in_its_only_frame_is_refused(tmp_path: Path, capture) -> None:
    path = tmp_path / "a.raw"
    content = bytearray(capture[:FRAME])
    content[700 * BLOCK + 63] ^= 0x80
    path.write_bytes(content)
    assert refusal(path) == (
        f"{path} must be channel 0 line 150 at byte 44800 in frame 0, not channel 2 line 150, a "
        "damaged marker; take another capture"
    )


@pytest.mark.parametrize(
    ("content", "given"),
    [
        (b"", "0 bytes; take a longer capture"),
        (bytes(FRAME - 1), "127999 bytes; take a longer capture"),
        (bytes(2 * FRAME), "one without the markers of a frame; name a stream without markers"),
        (np.random.default_rng(1).bytes(3 * FRAME), "one without the markers of a frame; name a"),
        (
            b"\x40\x1f" * (FRAME // 2 + 200),
            "one without the markers of a frame; name a",
        ),
    ],
)
def test_what_is_no_capture_is_refused(tmp_path: Path, content: bytes, given: str) -> None:
    path = tmp_path / "a.raw"
    path.write_bytes(content)
    says = f"{path} must be 1000x1000 raw words with a whole frame of 128000 bytes, not {given}"
    assert refusal(path).startswith(says)


def test_another_size_is_refused(tmp_path: Path, random_stream, capture) -> None:
    with pytest.raises(InputError) as refused:
        write_stream(random_stream(), tmp_path / "a.raw")
    assert str(refused.value) == (
        "the size of a .raw stream must be 1000x1000, not 8x3; use .npz or .zarr"
    )
    assert not list(tmp_path.iterdir())
    (tmp_path / "a.raw").write_bytes(capture[:FRAME])
    with pytest.raises(InputError, match="--size must be 1000x1000 for"):
        open_stream(tmp_path / "a.raw", (400, 250))


def test_damage_is_refused_or_changes_pixels_alone(
    tmp_path_factory, damage, planes, capture
) -> None:
    path = tmp_path_factory.mktemp("damaged") / "a.raw"

    @settings(max_examples=60)
    @given(st.data())
    def holds(data: st.DataObject) -> None:
        path.write_bytes(damage(data, capture[: 2 * FRAME]))
        try:
            found = read(path)
        except InputError as exc:
            assert len(str(exc).splitlines()) == 1
            return
        n = len(found)
        assert n in (1, 2)
        # A marker ends each block, so no change reaches beyond the blocks that it touches.
        changed = min(
            (found != planes[at : at + n]).reshape(n * BLOCKS, 500).any(axis=1).sum()
            for at in range(3 - n)
        )
        assert changed <= 2

    holds()
