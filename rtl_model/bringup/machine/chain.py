"""The one stage of a board's chain: bring-up, then the capture of an image into the stream."""

from __future__ import annotations

import time
from pathlib import Path

from cosim import Interrupted, Viform
from cosim.files.recorder import write_zarr
from cosim.run.chain import STREAM
from cosim.run.folder import how_to_resume
from cosim.run.progress import Progress
from rtl_model.bringup.bench.endpoint import Endpoint, csr_map
from rtl_model.bringup.bench.stage import Report, Stage
from rtl_model.bringup.machine.image_capture import ImageCapture, capture_image
from rtl_model.bringup.machine.section import BoardSection
from rtl_model.bringup.machine.waves import Trace, write_waves
from rtl_model.bringup.run import BringUp, bring_up
from rtl_model.host import LineFault

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
            csr=csr_map(None if section.csr is None else Path(section.csr)),
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
