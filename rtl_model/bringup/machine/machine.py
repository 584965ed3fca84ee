"""The machine of a [board] scenario: bring-up, capture, comparison with the cycle model."""

from __future__ import annotations

import html
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from cosim import InputError
from cosim.config.amounts import count
from cosim.plan.error import Finding
from cosim.run.chain import STREAM
from cosim.run.machine import Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Error, Metric, Throughput
from rtl_model.bringup.bench.endpoint import VIRTUAL, csr_map, open_endpoint
from rtl_model.bringup.machine.chain import LOG, BoardChain
from rtl_model.bringup.machine.section import BoardSection
from rtl_model.bringup.machine.waves import checked_trace
from rtl_model.bringup.report.page import TITLE, make_sections
from rtl_model.bringup.report.summary import simulated, subtitle
from rtl_model.geometry import Geometry
from rtl_model.host.ether import is_udp
from rtl_model.registers.design import NO_DEVICES
from rtl_model.virtual import nominal_clock

_SIDE, _LANES = 32, 32  # default size of a virtual board
_MOST_WORDS = 1 << 20  # largest capture memory of a virtual board


class BoardMachine:
    """Implements `cosim.run.machine.Machine`.

    The outcome is "failed" if a stage fails or a captured bit is wrong. The report names it.
    """

    notes: Sequence[str] = ()
    unit = "stages"

    def __init__(self, section: BoardSection, seed: int, toml: str, trace: Path | None) -> None:
        """Starts the virtual board if the section names one.

        Args:
            section: the board, its port and the frames to capture.
            seed: seed of the image's noise.
            toml: the resolved scenario, as TOML.
            trace: file for the waveforms of a virtual board, None for none.

        Raises InputError for a section that cannot be used.
        """
        self.toml, self._section, self._seed = toml, section, seed
        geometry = _virtual_geometry(section) if section.port == VIRTUAL else None
        self._trace = checked_trace(trace, geometry)
        # It fails here, before the run starts.
        csr_map(None if section.csr is None else Path(section.csr), NO_DEVICES)
        self.bits = 0 if geometry is None else section.frames * geometry.rows * geometry.columns
        self._stack = ExitStack()
        endpoint = open_endpoint(
            section.port, None if is_udp(section.port) else section.baud, section.time_scale,
            level="bytes" if geometry is None else section.level, faults=section.faults,
            geometry=geometry, dtr=section.dtr, rts=section.rts,
        )  # fmt: skip
        self._endpoint = self._stack.enter_context(endpoint)
        self.length = len(self._endpoint.stages)
        self.device = (
            f"board at {self._endpoint.url}" if geometry is None
            else f"virtual board, level {section.level}"
        )  # fmt: skip

    def check(self, progress: Progress) -> list[Finding]:
        """Nothing: a board has no plan."""
        return []

    def keep(self, effects: Sequence[str]) -> BoardMachine:
        """The machine itself: a board has no plan."""
        return self

    def chain(self, folder: Path) -> BoardChain:
        return BoardChain(self._section, self._seed, self._endpoint, self._trace, folder)

    def shortfall(self, recording: Recording) -> list[Finding]:
        """Nothing: a board has no tolerance."""
        return []

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        chain: BoardChain = recording.chain
        report, image = chain.report, chain.image
        frames = report.figure("patterns", "frames_compared") or 0
        bits = report.figure("patterns", "bits_compared") or 0
        wrong = report.figure("patterns", "bits_wrong")
        rate = report.figure("patterns", "capture_bytes_per_s")
        files, throughput, simulated_s = [LOG], [], 0.0
        if image is not None:
            burst, captured = image.burst, image.captured
            frames, bits = frames + len(burst.got), bits + burst.got.size
            wrong = (wrong or 0) + (0 if burst.wrong is None else burst.wrong.bits)
            rate = captured.bytes / max(captured.seconds, 1e-9)
            throughput = [Throughput("capture", rate, "B/s")]
            files.append(STREAM)
            simulated_s = self._section.frames / image.clock.hz
        passed = report.ok and image is not None and image.burst.wrong is None
        notes = [] if chain.fault is None else [f"the image was not captured: {chain.fault}"]
        if self._endpoint.simulated:
            notes.append(
                "the board is simulated: its rates are those of the simulation, which delays no "
                f"byte, and not those of {self._line}"
            )
        if report.cause is not None:
            notes.append(f"stage {report.failed_stage}: {report.cause}")
        return Outcome(
            outcome="ok" if passed else "failed",
            error=Error(None, "a board is brought up, nothing is simulated", None),
            simulated_s=simulated_s,
            metrics={
                "frames_compared": Metric(frames, "1"),
                "bits_compared": Metric(bits, "1"),
                "bits_wrong": Metric(wrong, "1"),
                "round_trips_per_s": Metric(
                    report.figure("counters", "round_trips_per_s")
                    or report.figure("link", "round_trips_per_s"),
                    "1/s",
                    "the stage that counts them did not pass",
                ),
                "capture_bytes_per_s": Metric(rate, "B/s", "no image was captured"),
                "stages_passed": Metric(sum(s.outcome == "ok" for s in report.stages), "1"),
            },
            throughput=throughput,
            files=files,
            notes=notes,
            views=report,
        )

    @property
    def _line(self) -> str:
        over_udp = "link" in self._endpoint.stages
        return "a network" if over_udp else f"a line of {self._section.baud} baud"

    def page(self, run: Run) -> Page:
        page = make_sections(run.outcome.views, run.folder)
        frames = run.outcome.metrics["frames_compared"].value or 0
        compared = (
            "<h2>Comparison with the cycle model</h2>"
            f"<p>{count(frames)} frames were compared with the cycle model, bit by bit.</p>"
        )
        if self._trace is not None:
            compared += f"<p>Waveforms: {html.escape(str(self._trace.path))}.</p>"
        return Page(
            TITLE, subtitle(run.outcome.views), simulated(run.outcome.views), page.cards,
            [*page.sections, compared], good="Whether the board is right",
            unmeasured="There is nothing to estimate: the board is compared with the cycle model "
            "bit by bit.", files=page.files,
        )  # fmt: skip

    def close(self) -> None:
        """Stops the virtual board."""
        self._stack.close()


def _virtual_geometry(section: BoardSection) -> Geometry:
    """A build whose capture memory holds the frames. Raises InputError for too many frames."""
    size = Geometry(
        section.rows or _SIDE, section.columns or _SIDE, section.lanes or _LANES,
        nominal_clock(section.level, section.baud), section.baud,
    )  # fmt: skip
    words = section.frames * size.rows * size.record_words
    if words > _MOST_WORDS:
        most = _MOST_WORDS // (size.rows * size.record_words)
        raise InputError(
            "board.frames", f"at most {most} of {size.rows} x {size.columns}, for which a board "
            "has memory", str(section.frames), "take fewer or a smaller board",
        )  # fmt: skip
    return size._replace(capture_words=max(size.capture_words, 1 << (words - 1).bit_length()))
