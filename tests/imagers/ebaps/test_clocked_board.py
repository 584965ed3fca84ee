"""The board within a film: frames arrive bit for bit; clocks that are too slow are told."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from imagers.common.scenery import Still
from imagers.ebaps.board.adc_lines import AdcLines
from imagers.ebaps.board.crossing import Clocks
from imagers.ebaps.board.timing import Timing
from imagers.ebaps.board_report import board_latency, board_metrics, board_rows
from imagers.ebaps.device.clocked_board import Board
from imagers.ebaps.device.imager import Ebaps
from imagers.ebaps.pixels import EbapsPixels

MHZ = 1_000_000
SHAPE = (12, 100)
LINES = AdcLines(50.0, 1000.0)
SMALL = Timing(columns=100, rows=20, rate=10_000)
"""Of a link that carries little more than the pixels of a frame."""


def film(
    frames: int = 1,
    *,
    until: int = 240,
    darks: bool = True,
    shape: tuple[int, int] = SHAPE,
    **board: Any,
):
    """The board after a film of `until` ms, and the frames; 0 frames: no board. Frame n is read
    (n + 1)/30 s + 33 ms after power-on, and 5 + `frames` frames pass the board."""
    pixels = EbapsPixels(shape)
    board.setdefault("timing", SMALL)
    made = Board(frames, board.pop("lines", LINES), **board) if frames else None
    camera = Ebaps(pixels, board=made)
    if darks:
        camera.store_darks()
    scene = Still(np.full(shape, 5e-4))
    kept = frozenset(pixels.effects)
    taken = [f.values for f in camera.film(scene, until * 10**9, seed=3, kept=kept)]
    return made, taken


def test_frames_arrive_bit_for_bit_and_are_those_without_a_board() -> None:
    board, frames = film(2, until=280, timing=Timing())
    assert board.faults == [] and not board.clocked
    f = board.figures
    assert (f.delivered, f.wrong, f.bit_errors) == (2, 0, 0)
    # Four darks, a live frame, and two live ones while the one before is read.
    assert [len(t.frames) for t in f.transfers] == [0, 0, 0, 0, 0, 5, 5]
    _, plain = film(0, until=280)
    assert all(np.array_equal(a, b) for a, b in zip(frames, plain, strict=True))
    made = board_metrics(board)
    assert made["link_use"].value == pytest.approx(0.4626, abs=1e-4)  # printed: 46 %
    assert made["pixel_blanking"].value == pytest.approx(0.017, abs=5e-4)
    # 6 x 80 MB/s of 3.2 GB/s, less the tail of a short frame.
    assert made["memory_use"].value == pytest.approx(0.15, rel=0.05)
    assert 64 <= made["fifo_most"].value < 128
    bursts = 6 * -(-2 * 1200 // 1024)
    assert all(len(t.writes) + len(t.reads) == bursts for t in f.transfers[5:])
    for row in board_latency(board):
        assert 0 < row.min_us <= row.median_us <= row.max_us
    assert len(board_latency(board)) == 4 and len(board_rows(board)) == 10


def test_without_darks_the_live_region_alone_is_read() -> None:
    board, _ = film(1, darks=False)
    assert board.faults == []
    assert [sorted(t.frames) for t in board.figures.transfers] == [[], [4]]


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        (
            {"clocks": Clocks(memory=MHZ), "shape": (20, 100), "depth": 128, "darks": False},
            "write FIFO overflowed",
        ),
        (
            {"clocks": Clocks(memory=30 * MHZ), "timing": Timing()},
            "Mpixel/s, less than the 39.3 Mpixel/s",
        ),
        (
            {"clocks": Clocks(display=39 * MHZ), "timing": Timing()},
            "a link clock of 39 MHz is too slow: 30 frames/s",
        ),
        ({"lines": AdcLines(1700.0, 1000.0), "darks": False}, "bits from the converter are wrong"),
        ({"lines": AdcLines(8000.0, 1000.0), "darks": False}, "found no eye on line"),
        ({"frames": 9}, "of 9 frames went through the board: lengthen duration"),
    ],
)
def test_what_is_too_slow_is_told(changed: dict[str, Any], says: str) -> None:
    board, _ = film(**changed)
    assert any(says in fault for fault in board.faults)
    if "link clock" in says:  # a lost frame counts with all its pixels
        assert board.figures.wrong == board.figures.pixels == 1200


def test_stalls_and_deep_fifos_change_nothing() -> None:
    board, frames = film(1, stall=0.5, depth=128)
    assert board.faults == []
    _, plain = film(0)
    assert np.array_equal(frames[5], plain[5])
