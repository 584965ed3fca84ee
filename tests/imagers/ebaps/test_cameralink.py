"""Camera Link: the table of the specification, frames there and back, wrong lengths."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.errors import InputError
from imagers.ebaps.board.cameralink import (
    CHANNELS,
    DVAL,
    FVAL,
    LVAL,
    PAIRS,
    PORTS,
    SPARE,
    WORD_BITS,
    LinkTiming,
    deserialise,
    frame_words,
    pixels_of,
    read_frames,
    serialise,
    words_of,
)
from imagers.ebaps.board.timing import Timing

SMALL = LinkTiming(columns=9, rows=5, clock_hz=3001, rate=30)


def picture(seed: int, rows: int = 5, columns: int = 9) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 65_536, (rows, columns), np.uint16)


class TestTable:
    def test_28_bits_in_5_channels(self) -> None:
        """Document 002, section 2; each TxIN once, in ports and in pairs."""
        assert (WORD_BITS, CHANNELS) == (28, 5)
        control = [SPARE, LVAL, FVAL, DVAL]
        assert control == [23, 24, 25, 26]
        assert sorted(sum(PORTS, ()) + tuple(control)) == list(range(28))
        assert sorted(sum(PAIRS, ())) == list(range(28))

    def test_words_by_hand(self) -> None:
        high = 7 << 24
        for bit, place in enumerate([0, 1, 2, 3, 4, 6, 27, 5, 7, 8, 9, 12, 13, 14, 10, 11]):
            pixel = np.array([1 << bit], np.uint16)
            assert words_of(pixel)[0] == high | 1 << place
        every = np.arange(65_536, dtype=np.uint16)
        words = words_of(every)
        assert np.array_equal(pixels_of(words), every)
        assert not (words & ~np.uint32(0x0F007FFF)).any()  # C and the spare are 0
        assert not (words >> 15 & 0x1FF).any()

    def test_serial_bits_by_hand(self) -> None:
        bits = serialise(np.array([1 << 7 | 1 << 23, 1 << 26 | 1 << 0 | 1 << 27], np.uint32))
        text = ["".join(map(str, row)) for row in bits.tolist()]
        assert text == [
            "10000000000001", "00000000000000", "00000001000000", "10000000000001",
            "11000111100011",
        ]  # fmt: skip


class TestThereAndBack:
    @settings(max_examples=60, deadline=None)
    @given(st.integers(0, 2**32 - 1), st.integers(1, 40), st.integers(0, 6), st.integers(0, 6))
    def test_cut_within_words(self, seed: int, count: int, front: int, back: int) -> None:
        words = np.random.default_rng(seed).integers(0, 1 << 28, count, np.uint32)
        bits = serialise(words)
        cut = bits[:, front : bits.shape[1] - back]
        first, last = int(front > 0), count - int(back > 0)
        if last > first:
            assert np.array_equal(deserialise(cut), words[first:last])
        else:
            with pytest.raises(InputError, match="clock pair"):
                deserialise(cut)

    def test_frames_over_the_pairs(self) -> None:
        frames = [picture(n) for n in range(4)]
        stream = np.concatenate(
            [part for n, frame in enumerate(frames) for part in frame_words(frame, SMALL, n)]
        )
        assert stream.size == SMALL.frame_start(4)
        back = deserialise(serialise(stream)[:, 3:])  # begins within frame 0
        got = list(read_frames([back, np.zeros(1, np.uint32)], 9, 5))
        assert [a.tolist() for a in got] == [b.tolist() for b in frames[1:]]
        draw = random.Random(1)
        for _ in range(20):  # however the words come in
            cuts = sorted(draw.randrange(stream.size) for _ in range(9))
            parts = np.split(np.concatenate([np.zeros(2, np.uint32), stream]), cuts)
            got = list(read_frames(parts, 9, 5))
            assert [a.tolist() for a in got] == [b.tolist() for b in frames]

    @pytest.mark.parametrize("every", [16, pytest.param(1, marks=pytest.mark.slow)])
    def test_a_whole_frame(self, every: int) -> None:
        """All its words; every sixteenth line, or all, bit by bit over the pairs."""
        timing = LinkTiming()
        frame = picture(7, 1024, 1280)
        parts = list(frame_words(frame, timing))
        back = [deserialise(serialise(w)) if n % every == 0 else w for n, w in enumerate(parts)]
        lead = np.zeros(1, np.uint32)
        (got,) = read_frames([lead, *back], 1280, 1024)
        assert np.array_equal(got, frame)
        assert sum(part.size for part in parts) == 2_833_333
        sent = sum(int((part >> LVAL & part >> DVAL & 1).sum()) for part in parts)
        assert sent / 2_833_333 == pytest.approx(timing.utilisation, rel=1e-6)


class TestTiming:
    def test_figures(self) -> None:
        timing = LinkTiming()
        assert timing.pixel_rate == 39_321_600
        assert round(timing.utilisation, 4) == 0.4626
        assert (timing.pair_rate, timing.bits_per_second) == (595_000_000, 2_380_000_000)
        assert 1 - LinkTiming(clock_hz=85_000_000 // 2).utilisation < 0.08
        assert Timing().blanking == pytest.approx(0.01696, abs=1e-9)  # of a 40 MHz pixel clock
        assert timing.line_clocks * 1024 <= timing.frame_start(1)
        assert min(timing.frame_blank(n) for n in range(30)) > timing.line_blank > 0
        assert timing.frame_start(30) == timing.clock_hz

    def test_refused(self) -> None:
        with pytest.raises(ValueError, match="clock of blanking"):
            LinkTiming(clock_hz=39_321_600)
        with pytest.raises(ValueError, match="above 0"):
            LinkTiming(rows=0)
        with pytest.raises(ValueError, match="must be 5 x 9"):
            next(frame_words(picture(0, 4), SMALL))


class TestWrongInput:
    @pytest.mark.parametrize(
        "given_",
        [
            np.zeros((4, 70), np.uint8), np.zeros(70, np.uint8), np.zeros((5, 0), np.uint8),
            np.zeros((5, 70), np.uint8), np.full((5, 70), 2, np.uint8), np.zeros((5, 70)),
            np.full((5, 70), -1, np.int8), "bits", [[1, 0], [1]] * 0, None,
        ],
    )  # fmt: skip
    def test_no_recording(self, given_: object) -> None:
        with pytest.raises(InputError) as caught:
            deserialise(given_)  # type: ignore[arg-type]
        assert "\n" not in str(caught.value)

    @settings(max_examples=60, deadline=None)
    @given(st.integers(0, 2**32 - 1), st.integers(0, 80), st.integers(0, 4))
    def test_a_flipped_clock_bit_is_seen(self, seed: int, place: int, rows: int) -> None:
        bits = serialise(np.random.default_rng(seed).integers(0, 1 << 28, 12, np.uint32))
        assert deserialise(bits).size == 12
        bits[4, place] ^= 1
        with pytest.raises(InputError, match="clock pair"):
            deserialise(bits)

    @settings(max_examples=60, deadline=None)
    @given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 12))
    def test_wrong_lengths(self, seed: int, columns: int, rows: int) -> None:
        parts = [np.zeros(1, np.uint32), *frame_words(picture(seed), SMALL)]
        if (columns, rows) == (9, 5):
            assert len(list(read_frames(parts, columns, rows))) == 1
            return
        with pytest.raises(InputError) as caught:
            list(read_frames(parts, columns, rows))
        text = str(caught.value)
        assert ("line 0" in text) == (columns != 9) and "\n" not in text

    @settings(max_examples=100, deadline=None)
    @given(st.lists(st.integers(0, 2**32 - 1), max_size=60), st.integers(1, 6), st.integers(1, 6))
    def test_any_words(self, words: list[int], columns: int, rows: int) -> None:
        """Garbage ends in frames of the right size or in one line."""
        try:
            for frame in read_frames([np.array(words, np.uint32)], columns, rows):
                assert frame.shape == (rows, columns)
        except InputError as error:
            assert "\n" not in str(error)

    def test_lost_words(self) -> None:
        """A word lost anywhere in a frame is told, but in blanking."""
        parts = np.concatenate([np.zeros(1, np.uint32), *frame_words(picture(3), SMALL)])
        (good,) = read_frames([parts], 9, 5)
        for place in range(1, parts.size):
            less = np.delete(parts, place)
            if parts[place] >> DVAL & 1:
                with pytest.raises(InputError, match="9 pixels, not 8"):
                    list(read_frames([less], 9, 5))
            else:
                (got,) = read_frames([less], 9, 5)
                assert np.array_equal(got, good)
