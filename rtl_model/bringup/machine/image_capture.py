"""Capture of the run's image from a board that has passed its bring-up."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from cosim import Clock, InputError
from rtl_model.bringup.bench.bench import Burst
from rtl_model.bringup.bench.endpoint import Endpoint, csr_map
from rtl_model.bringup.bench.frames import capture_and_compare, frame_clock
from rtl_model.bringup.machine.image import make_image
from rtl_model.bringup.machine.section import BoardSection
from rtl_model.geometry import Geometry
from rtl_model.host import Board, Captured, opened_bone, pattern


class ImageCapture(NamedTuple):
    """Captured frames of the image.

    Attributes:
        captured: the frames with their timing.
        burst: comparison of the frames with the cycle model.
        clock: frame clock.
    """

    captured: Captured
    burst: Burst
    clock: Clock


def capture_image(endpoint: Endpoint, section: BoardSection, seed: int) -> ImageCapture:
    """Uploads the image of `seed` and captures `section.frames` frames.

    Raises InputError for a board of another size than the section states, LineFault.
    """
    with opened_bone(
        endpoint.url,
        section.baud,
        simulated=endpoint.simulated,
        time_scale=endpoint.time_scale,
        lines=endpoint.lines,
    ) as (bone, _):
        board = Board(bone, csr_map(None if section.csr is None else Path(section.csr)))
        size = board.info().geometry
        _check_size(section, size)
        for register, value in _registers(size).items():
            board.write(register, value)
        pattern.upload(board, make_image(size, seed))
        captured, burst = capture_and_compare(board, section.frames)
        return ImageCapture(captured, burst, frame_clock(board))


def _registers(size: Geometry) -> dict[str, int]:
    """Registers during the capture: all pixels, 40 kHz, a reset that keeps the residual charge."""
    return {
        "sensor_threshold": 0,
        "sensor_clock_select": 0,
        "sensor_reset_rule": 0,
        "sensor_rows": (size.rows - 1) << 16,
        "sensor_columns": (size.columns - 1) << 16,
        "sensor_tick_clocks": size.tick_clocks,
        "sensor_pattern": 0,
        "capture_source": 0,
    }


def _check_size(section: BoardSection, size: Geometry) -> None:
    """Raises InputError for a board of another size, or with too little memory."""
    for name in ("rows", "columns", "lanes"):
        required, actual = getattr(section, name), getattr(size, name)
        if required is not None and required != actual:
            raise InputError(
                f"board.{name}", f"{actual}, as the board has", str(required),
                "leave it out, or load another build",
            )  # fmt: skip
    most = size.capture_words // (size.rows * size.record_words)
    if section.frames > most:
        raise InputError(
            "board.frames", f"at most {most}, for which this board has memory",
            str(section.frames), "take fewer",
        )  # fmt: skip
