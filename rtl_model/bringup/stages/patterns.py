"""Stage patterns: captures a burst of every pattern and compares it with the cycle model."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rtl_model.bringup.bench.bench import Bench, Burst
from rtl_model.bringup.bench.frames import compare_burst
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.host import Board, Captured, capture, pattern

_CASES: tuple[tuple[str, int, int, int], ...] = (
    # name, pattern, level, threshold level; every pixel fires in some ticks and not in others
    ("constant", 1, 200, 0),
    ("ramp", 2, 96, 0),
    ("checker", 3, 170, 0),
    ("memory", 0, 0, 0),
)


def _frames_that_fit(bench: Bench) -> int:
    """Number of frames that fit in the capture memory, at most `bench.frames`; 0 if none fits."""
    size = bench.geometry
    return min(bench.frames, size.capture_words // (size.record_words * size.rows))


def _distinct_image(rows: int, columns: int) -> npt.NDArray[np.uint8]:
    """An image without equal rows or columns, (rows, columns) uint8."""
    row, column = np.ogrid[:rows, :columns]
    return ((row * 37 + column * 101 + (row * column) % 59) % 256).astype(np.uint8)


def _capture_burst(
    bench: Bench,
    board: Board,
    name: str,
    registers: dict[str, int],
    image: npt.NDArray[np.uint8],
    frames: int,
) -> tuple[Captured, Burst]:
    """Captures a burst, compares it with the cycle model and adds the comparison to the bench.

    The burst starts with frame 0 and without charge. Raises StageFault frames-lost.

    Args:
        bench: the board under test.
        board: its registers.
        name: name of the test pattern.
        registers: registers written before the burst, by name.
        image: contents of the pattern memory, (rows, columns).
        frames: number of frames.
    """
    for register, value in registers.items():
        board.write(register, value)
    captured = capture.burst(board, frames, clear=True)
    size = bench.geometry
    if captured.planes.shape != (frames, size.rows, size.columns):
        raise StageFault(
            "frames-lost",
            f"{name}: {len(captured.planes)} of {frames} frames were captured, "
            f"{captured.lost} rows did not fit in the memory",
            "take fewer frames",
        )
    burst = compare_burst(name, captured, size, registers, image)
    bench.bursts.append(burst)
    return captured, burst


def check_patterns(bench: Bench) -> Figures:
    """Captures one burst each of constant, ramp, checker and an uploaded image.

    Raises StageFault memory, frames-lost, or wrong-bits, which names the first wrong bit and the
    shape of all of them.
    """
    board = Board(bench.bone, bench.csr)
    size = bench.geometry
    frames = _frames_that_fit(bench)
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
    image = _distinct_image(size.rows, size.columns)
    repeated = pattern.upload(board, image)
    figures: Figures = {
        "frames_compared": 0, "bits_compared": 0, "bits_wrong": 0, "upload_repeats": repeated,
    }  # fmt: skip
    moved, spent, retries = 0, 0.0, 0
    base = {
        "sensor_clock_select": 0, "sensor_reset_rule": 0, "sensor_rows": rows,
        "sensor_columns": (size.columns - 1) << 16, "sensor_tick_clocks": size.tick_clocks,
    }  # fmt: skip
    worst: Burst | None = None
    for name, source, level, threshold in _CASES:
        registers = base | {
            "sensor_threshold": threshold, "sensor_pattern": source, "sensor_level": level,
        }  # fmt: skip
        captured, burst = _capture_burst(bench, board, name, registers, image, frames)
        moved, spent = moved + captured.bytes, spent + captured.seconds
        retries += captured.retries
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
            "wrong-bits", f"pattern {worst.name}: {worst.wrong.text}", worst.wrong.remedy, figures
        )
    return figures
