"""A run of one of the other imagers: filmed, checked, judged, reported."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim import Interrupted
from cosim.report.png import write_png
from cosim.run.folder import (
    PUT_BACK,
    begin_folder,
    check_room,
    check_trace_file,
    claimed,
    mend,
    output_folder,
)
from cosim.run.progress import Progress
from cosim.run.result import Error, Metric, Result, Throughput, write_result
from rtl_model.imagers.run.filming import Filmed, film_as_promised
from rtl_model.imagers.run.machine import Machine
from rtl_model.imagers.run.planning import Ready, ready_imager
from rtl_model.imagers.run.store import FRAMES, read_frame
from rtl_model.imagers.run.tape import TAPE
from scenarios.assemble.loading import to_toml
from scenarios.assemble.scenario import ImagerScenario

__all__ = ["ImagerRun", "run_imager"]

PICTURES = 8
"""Frames, evenly spaced, that become pictures of their own."""
_TAPED = 2
"""Copies of a frame on disk while a run is not finished: what the pixels gave, and the frame."""


@dataclass(frozen=True, eq=False)
class ImagerRun:
    """What a report is made of. pictures: numbers of the frames in images/, in order. trace: where
    the waveforms were written."""

    result: Result
    folder: Path
    filmed: Filmed
    pictures: list[int]
    notes: list[str]
    trace: Path | None
    began: float

    @property
    def run(self) -> Ready:
        return self.filmed.run

    def frame(self, n: int) -> Any:
        """Values of the n-th frame, (rows, W) uint16."""
        return read_frame(self.folder / FRAMES, n)


def run_imager(
    name: str,
    scenario: ImagerScenario,
    out: Path | None,
    *,
    resume: bool = False,
    progress: Progress,
    began: float,
    report: Callable[[ImagerRun], list[str]],
    trace: Path | None = None,
    machine: Machine | None = None,
) -> tuple[Result, Path]:
    """Runs a scenario and writes its folder, `result.json` last. machine: the imager; of the
    scenario's own kind when None. trace: waveforms of its sequencer's first frames, .fst or .vcd.

    Raises InputError for input that cannot be used (nothing is written then), Interrupted.
    """
    if machine is None:
        from rtl_model.imagers.run.kinds import machine_of

        machine = machine_of(scenario)
    place = output_folder(name, out, resume)
    if trace is not None:
        check_trace_file(trace)
    run = ready_imager(name, scenario, machine)
    rows, columns = machine.shape
    check_room(place, 16 * rows * columns * run.expected.frames * _TAPED)
    with claimed(name, out, resume) as folder:
        begin_folder(folder, to_toml(scenario))
        notes = [*run.view.notes, *run.view.degraded]
        for note in notes:
            progress.note(note)
        filmed = film_as_promised(run, folder, resume, progress, trace)
        try:
            progress.start("report", 1)
            result = _result(filmed)
            notes += [f"{effect} was put back" for effect in filmed.put_back]
            if not filmed.taken:
                notes.append("no frame was ready before the run's end: lengthen duration")
                progress.note(notes[-1])
            pictures = _pictures(filmed, folder)
            result.files += [f"images/frame-{n:05d}.png" for n in pictures]
            if trace is not None:
                notes.append(f"waveforms of the sequencer: {trace}")
            result.files += report(ImagerRun(result, folder, filmed, pictures, notes, trace, began))
            result.files.append("result.json")
            progress.advance(1)
            result.run_time_s = time.perf_counter() - began
            write_result(folder, result)
            for left in (TAPE, PUT_BACK):
                (folder / left).unlink(missing_ok=True)
        except KeyboardInterrupt:
            done = len(filmed.taken)
            raise Interrupted(done, done, mend(folder), "frames") from None
    return result, folder


def _result(filmed: Filmed) -> Result:
    run, patches = filmed.run, filmed.patches
    scenario, taken = run.scenario, filmed.taken
    error, out = filmed.error, list(run.plan.left_out)
    told = Error(None, "no frame of the run was looked at", None)
    if error is not None:
        kind = "nothing was left out" if not out else (
            "relative error of the mean and of the noise of a pixel value, the larger; worst of "
            f"{patches.seen} patches, everything kept against the plan, same random numbers"
        )  # fmt: skip
        if out and filmed.decided is not None:
            kind += f"; {filmed.decided.told()}"
        told = Error(error.value, kind, (error.low, error.high))
    pixels = sum(t.shape[0] * t.shape[1] for t in taken)
    simulated = run.stop * 1e-12
    metrics = {
        "frames": Metric(len(taken), "1"),
        "frame_rate": Metric(_rate(taken), "Hz"),
        **(run.machine.metrics(taken, run.view, filmed.imager) if taken else {}),
    }
    seconds = max(filmed.seconds["imager"], 1e-9)
    throughput = []
    if taken and not filmed.resumed:
        throughput = [
            Throughput("imager", pixels / seconds, "pixel-frames/s"),
            Throughput("imager frames", len(taken) / seconds, "frames/s"),
        ]
    short = error is not None and out and error.high > scenario.tolerance
    return Result(
        scenario=run.name,
        outcome="ok" if taken and not short and not run.view.degraded else "degraded",
        seed=scenario.seed,
        device="numba on this processor",
        simulated_s=simulated,
        tolerance=scenario.tolerance,
        error=told,
        kept=[e for e in run.pixels.effects if e in run.kept],
        left_out=[
            {
                "effect": row.effect, "bound": row.bound, "kind": row.kind,
                "measured": getattr(patches.measured(row.effect), "value", None),
            }
            for row in run.plan.rows if row.effect in out
        ],
        metrics=metrics,
        latency=run.machine.latency(taken, run.view) if taken else [],
        throughput=throughput,
        files=["scenario.toml", *([FRAMES] if taken else [])],
    )  # fmt: skip


def _rate(taken: list[Any]) -> float | None:
    """Frames a second, median over the run."""
    if len(taken) < 2:
        return None
    step = float(np.median(np.diff([t.ready for t in taken])))
    return 1e12 / step if step > 0 else None


def _pictures(filmed: Filmed, folder: Path) -> list[int]:
    """Frames as 8-bit grey pictures, linear, full scale white."""
    if not filmed.taken:
        return []
    (folder / "images").mkdir(exist_ok=True)
    for old in (folder / "images").glob("frame-*.png"):
        old.unlink()
    last = len(filmed.taken) - 1
    chosen = sorted({round(n * last / (PICTURES - 1)) for n in range(PICTURES)})
    scale = ((1 << filmed.run.pixels.bits) - 1) / 255
    for n in chosen:
        values = read_frame(folder / FRAMES, n)
        picture = np.rint(values / scale).astype(np.uint8)
        write_png(folder / f"images/frame-{n:05d}.png", picture)
    return chosen
