"""An imager as a machine: it implements the protocols of `cosim.run.machine`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim.plan.error import Finding, reinstated
from cosim.plan.planner import left_out_rows
from cosim.report.png import pictures_wanted, write_png
from cosim.run.machine import Outcome, Page, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Error, Metric, Throughput
from imagers.common.kind import ImagerKind
from imagers.common.model import FrameFigures
from imagers.report.page import ImagerRun, imager_page
from imagers.run.chain import FrameChain
from imagers.run.plan import DEVICE, PlannedRun, forecast, measure_ladder
from imagers.run.tape import FRAMES, read_frame

PICTURES: Final = 8
"""Number of frames, evenly spaced, that are written as PNG pictures."""
_COPIES: Final = 2
"""Copies of a frame on disk during a run: on the tape, and in the frame store."""


@dataclass(frozen=True, eq=False)
class ImagerMachine:
    """See `cosim.run.machine.Machine`.

    Attributes:
        kind: kind of the imager.
        planned: the checked and planned run.
        trace: file for the waveforms of the sequencer during the first frames; None for none.
    """

    kind: ImagerKind
    planned: PlannedRun
    trace: Path | None = None

    @property
    def toml(self) -> str:
        return self.planned.spec.toml

    @property
    def notes(self) -> list[str]:
        return [*self.planned.view.notes, *self.planned.view.degraded]

    @property
    def device(self) -> str:
        return DEVICE

    @property
    def length(self) -> int:
        return self.planned.exposures.frames

    @property
    def unit(self) -> str:
        return "frames"

    @property
    def bits(self) -> int:
        rows, columns = self.planned.model.shape
        return 16 * rows * columns * self.planned.exposures.frames * _COPIES

    def check(self, progress: Progress) -> list[Finding]:
        """No findings: the plan is checked on the exposures of the recording."""
        return []

    def keep(self, effects: Sequence[str]) -> ImagerMachine:
        return replace(self, planned=self.planned.keep(effects))

    def chain(self, folder: Path) -> FrameChain:
        specific = self.kind.design().specific if self.kind.number is not None else ()
        readable = [entry.name for entry in specific if entry.mode != "wo"]
        return FrameChain(self.planned, folder, self.trace, readable)

    def shortfall(self, recording: Recording) -> list[Finding]:
        """The omitted effect with the largest measured error, if the upper limit of the run's
        error exceeds the tolerance."""
        chain: FrameChain = recording.chain
        error, left_out = chain.error, list(self.planned.plan.left_out)
        if error is None or not left_out or error.high <= self.planned.spec.tolerance:
            return []
        measured = {name: chain.patches.measured(name) for name in left_out}
        worst = max(left_out, key=lambda name: getattr(measured[name], "high", 0.0))
        return [reinstated(worst, self.planned.spec.tolerance, error.high)]

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        planned, chain = self.planned, recording.chain
        view, frames = planned.view, chain.frames
        error, left_out = chain.error, list(planned.plan.left_out)
        short = error is not None and left_out and error.high > planned.spec.tolerance
        pictures = _write_pictures(recording.folder, len(frames), planned)
        notes = []
        if not frames and not planned.model.faults(chain.imager):
            notes.append("no frame was ready before the run's end: lengthen duration")
        if self.trace is not None:
            notes.append(f"waveforms of the sequencer: {self.trace}")
        faults = planned.model.faults(chain.imager)
        notes += [*faults, *planned.model.notes(frames)]
        metrics = {
            "frames": Metric(len(frames), "1"),
            "frame_rate": Metric(_frame_rate(frames), "Hz", "one frame has no rate"),
            **(planned.model.metrics(frames, view, chain.imager) if frames else {}),
            **view.metrics,
        }
        return Outcome(
            outcome="degraded" if not frames or short or view.degraded or faults else "ok",
            simulated_s=planned.spec.stop * 1e-12,
            error=_error(chain),
            kept=[effect for effect in planned.pixels.effects if effect in planned.kept],
            left_out=left_out_rows(
                planned.plan.absent,
                {name: getattr(chain.patches.measured(name), "value", None) for name in left_out},
            ),
            metrics=metrics,
            latency=planned.model.latency(frames, view, chain.imager) if frames else [],
            throughput=[] if recording.resumed else _throughput(frames, recording.seconds),
            files=[*([FRAMES] if frames else []), *(_picture(n) for n in pictures)],
            notes=notes,
            views=pictures,
        )  # fmt: skip

    def page(self, run: Run) -> Page:
        return imager_page(self.kind, ImagerRun(run, run.recording.chain, run.outcome.views))

    def close(self) -> None:
        """Nothing is open."""


@dataclass(frozen=True, eq=False)
class ImagerStudy:
    """See `cosim.run.machine.Study`."""

    planned: PlannedRun

    def forecast(self, progress: Progress) -> dict[str, Any]:
        return forecast(self.planned)

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return measure_ladder(self.planned, progress)


def _error(chain: FrameChain) -> Error:
    error, left_out = chain.error, chain.planned.plan.left_out
    if error is None:
        return Error(None, "no frame of the run was looked at", None)
    if not left_out:
        return Error(error.value, "nothing was left out", (error.low, error.high))
    kind = (
        "relative error of the mean and of the noise of a pixel value, the larger; worst of "
        f"{chain.patches.count} patches, everything kept against the plan, same random numbers"
    )
    if chain.decisions is not None:
        kind += f"; {chain.decisions.text()}"
    # The upper limit holds for the whole frame: where no patch was, the bound of the plan does.
    promised = float(np.max(chain.planned.plan.total))
    return Error(error.value, kind, (error.low, max(error.high, promised)))


def _throughput(frames: Sequence[FrameFigures], seconds: dict[str, float]) -> list[Throughput]:
    if not frames:
        return []
    pixels = sum(frame.shape[0] * frame.shape[1] for frame in frames)
    spent = max(seconds["imager"], 1e-9)
    return [
        Throughput("imager", pixels / spent, "pixel-frames/s"),
        Throughput("imager frames", len(frames) / spent, "frames/s"),
    ]


def _frame_rate(frames: Sequence[FrameFigures]) -> float | None:
    """Median frame rate of the run, Hz; None for fewer than two frames."""
    if len(frames) < 2:
        return None
    step = float(np.median(np.diff([frame.ready for frame in frames])))
    return 1e12 / step if step > 0 else None


def _picture(n: int) -> str:
    """Path of the picture of a frame, within the folder of the run."""
    return f"images/frame-{n:05d}.png"


def _write_pictures(folder: Path, count: int, planned: PlannedRun) -> list[int]:
    """Writes chosen frames as 8-bit grey pictures. Returns their numbers; none if the run wants
    none."""
    if not count or not pictures_wanted():
        return []
    (folder / "images").mkdir(exist_ok=True)
    for old in (folder / "images").glob("frame-*.png"):
        old.unlink()
    chosen = sorted({round(n * (count - 1) / (PICTURES - 1)) for n in range(PICTURES)})
    for n in chosen:
        values = read_frame(folder / FRAMES, n)
        write_png(folder / _picture(n), planned.model.picture(values, planned.pixels.bits))
    return chosen
