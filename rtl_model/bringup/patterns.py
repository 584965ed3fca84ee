"""Stage patterns: bursts of every pattern, captured and held against the cycle model bit by bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from rtl_model.bringup.bench import Bench, Burst
from rtl_model.bringup.stage import Figures, StageFault
from rtl_model.bringup.wrong_bits import compare
from rtl_model.host import Board, Captured, capture, pattern

__all__ = ["check_patterns", "image_of", "take", "whole_frames"]

_CASES: tuple[tuple[str, int, int, int], ...] = (
    # name, pattern, level, threshold level: each fires in some ticks and not in others
    ("constant", 1, 200, 0),
    ("ramp", 2, 96, 0),
    ("checker", 3, 170, 0),
    ("memory", 0, 0, 0),
)


def whole_frames(bench: Bench) -> int:
    """Frames that the capture memory holds, at most those asked for; 0 where it holds none."""
    size = bench.geometry
    return min(bench.frames, size.capture_words // (size.record_words * size.rows))


def image_of(rows: int, columns: int) -> npt.NDArray[np.uint8]:
    """Returns an image in which no two rows and no two columns are alike, (rows, columns) uint8."""
    row, column = np.ogrid[:rows, :columns]
    return ((row * 37 + column * 101 + (row * column) % 59) % 256).astype(np.uint8)


def take(
    bench: Bench,
    board: Board,
    name: str,
    settings: dict[str, int],
    image: npt.NDArray[np.uint8] | None,
    frames: int,
) -> tuple[Captured, Burst]:
    """Takes a burst from frame 0 and no charge, under registers `settings` (names without
    `sensor_`), and holds it against the cycle model. The bench keeps the burst."""
    from rtl_model.cycle import Settings, planes

    for key, value in settings.items():
        board.write(f"sensor_{key}", value)
    taken = capture.burst(board, frames, clear=True)
    must = planes(bench.geometry, Settings(**_plain(settings)), image, frames)
    if taken.planes.shape != must.shape:
        raise StageFault(
            "frames-lost",
            f"{name}: {len(taken.planes)} of {frames} frames were captured, {taken.lost} rows "
            "found no room",
            "take fewer frames",
        )
    burst = Burst(name, taken.planes, must, compare(taken.planes, must, bench.geometry.lanes))
    bench.bursts.append(burst)
    return taken, burst


def check_patterns(bench: Bench) -> Figures:
    """Constant, ramp, checker and an uploaded image, each as a burst. StageFault wrong-bits with
    the first wrong bit's place and the shape of all of them."""
    board = Board(bench.bone, bench.csr)
    size = bench.geometry
    frames = whole_frames(bench)
    rows = (size.rows - 1) << 16
    if frames == 0:
        fit = size.capture_words // size.record_words
        if fit == 0:
            raise StageFault(
                "memory",
                f"the capture memory of {size.capture_words} words holds no row",
                "build the board with more capture_words",
            )
        frames, rows = 1, (min(fit, size.rows) - 1) << 16
    image = image_of(size.rows, size.columns)
    repeated = pattern.upload(board, image)
    figures: Figures = {
        "frames_compared": 0, "bits_compared": 0, "bits_wrong": 0, "upload_repeats": repeated,
    }  # fmt: skip
    moved, spent, retries = 0, 0.0, 0
    base = {
        "threshold": 0, "clock_select": 0, "reset_rule": 0, "rows": rows,
        "columns": (size.columns - 1) << 16, "tick_clocks": size.tick_clocks,
    }  # fmt: skip
    worst: Burst | None = None
    for name, source, level, threshold in _CASES:
        given = base | {"pattern": source, "level": level, "threshold": threshold}
        taken, burst = take(bench, board, name, given, image, frames)
        moved, spent = moved + taken.bytes, spent + taken.seconds
        retries += taken.retries
        figures["frames_compared"] += frames
        figures["bits_compared"] += burst.got.size
        if burst.wrong is not None:
            figures["bits_wrong"] += burst.wrong.bits
            worst = worst or burst
    figures |= {
        "capture_bytes": moved,
        "capture_bytes_per_s": moved / max(spent, 1e-9),
        "capture_retries": retries,
    }
    if worst is not None and worst.wrong is not None:
        figures["first_wrong"] = worst.wrong.document()
        raise StageFault(
            "wrong-bits", f"pattern {worst.name}: {worst.wrong.text}", worst.wrong.mend, figures
        )
    return figures


def _plain(settings: dict[str, int]) -> dict[str, Any]:
    """Registers as `cycle.Settings` names them."""
    made: dict[str, Any] = {}
    for key, value in settings.items():
        if key in ("rows", "columns"):
            made[key] = (value & 0xFFFF, value >> 16)
        elif key != "tick_clocks":
            made[key] = value
    return made
