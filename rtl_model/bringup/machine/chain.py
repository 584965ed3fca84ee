"""The one stage of a board's chain: bring-up, then the capture of the run's image into the
stream.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

from cosim import Clock, InputError, Interrupted, Viform
from cosim.files.recorder import write_zarr
from cosim.run.chain import STREAM
from cosim.run.folder import how_to_resume
from cosim.run.progress import Progress
from rtl_model.bringup.bench.bench import Burst
from rtl_model.bringup.bench.endpoint import Endpoint, csr_map
from rtl_model.bringup.bench.frames import capture_and_compare, frame_clock
from rtl_model.bringup.bench.stage import Report, Stage
from rtl_model.bringup.machine.section import BoardSection
from rtl_model.bringup.machine.waves import Trace, make_image, write_waves
from rtl_model.bringup.run import BringUp, bring_up
from rtl_model.geometry import Geometry
from rtl_model.host import Board, Captured, LineFault, opened_bone, pattern
from rtl_model.registers.design import NO_DEVICES

LOG = "line.jsonl"
"""File of a run's folder that lists every transaction on the line."""


class BoardChain:
    """Implements `cosim.run.machine.Chain`.

    It has no checkpoint: the board may have changed since an interruption, so every stage runs
    again.

    Attributes:
        report: report of the bring-up, once the chain has run.
        image: the captured frames; None if a stage or the capture failed.
        fault: the line's fault that ended the capture, None if there was none.
    """

    report: Report

    def __init__(
        self, section: BoardSection, seed: int, endpoint: Endpoint, trace: Trace | None,
        folder: Path,
    ) -> None:  # fmt: skip
        self._section, self._seed, self._endpoint = section, seed, endpoint
        self._trace, self._folder = trace, folder
        self.checkpoint = folder / "checkpoint.json"
        self.image: ImageCapture | None = None
        self.fault: LineFault | None = None
        self._stages = 0

    def load(self, progress: Progress) -> bool:
        """Does nothing: there is never a checkpoint."""
        return False

    def save(self) -> None:
        """Does nothing: there is never a checkpoint."""

    def discard(self) -> None:
        """Does nothing: a board has no plan, so its recording is never repeated."""

    def run(self, progress: Progress) -> dict[str, float]:
        """Brings the board up and, if every stage passes, captures the image.

        Returns the wall time of each part, s. Raises InputError for a board of another size than
        the scenario states, Interrupted.
        """
        try:
            return self._run(progress)
        except KeyboardInterrupt:
            raise Interrupted(
                self._stages, len(self._endpoint.stages), how_to_resume(self._folder), "stages"
            ) from None

    def _run(self, progress: Progress) -> dict[str, float]:
        section, endpoint = self._section, self._endpoint
        progress.start("stages", len(endpoint.stages) + 1)

        def count(stage: Stage) -> None:
            self._stages += 1
            progress.advance(self._stages)

        begin = time.perf_counter()
        options = BringUp(
            baud=section.baud,
            csr=csr_map(None if section.csr is None else Path(section.csr), NO_DEVICES),
            simulated=endpoint.simulated,
            time_scale=endpoint.time_scale,
            log=self._folder / LOG,
        )
        self.report = bring_up(endpoint.url, options, count, progress.note)
        seconds = {"bring-up": time.perf_counter() - begin}
        if self.report.ok:
            begin = time.perf_counter()
            try:
                self.image = capture_image(endpoint, section, self._seed)
            except LineFault as fault:  # a board that passed may be disconnected a moment later
                self.fault = fault
            seconds["capture"] = time.perf_counter() - begin
        if self.image is not None:
            stream = Viform.from_planes(self.image.captured.planes, self.image.clock)
            write_zarr(stream, self._folder / STREAM)
            self.report.bursts.append(self.image.burst)
        progress.advance(len(endpoint.stages) + 1)
        if self._trace is not None:
            write_waves(self._trace, self._seed)
        return seconds


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
        board = Board(bone, csr_map(None if section.csr is None else Path(section.csr), NO_DEVICES))
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
