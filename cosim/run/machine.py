"""What a kind of machine provides so that it can be planned, run, checked and reported.

Every run goes one way: assemble, trial, record, verify, judge, report. The way itself is written
once (`scenarios/run.py`) over the protocols here; a part of the system implements them for the
machines that it simulates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from cosim.run.progress import Progress
from cosim.run.result import Error, Latency, Metric, Result, Throughput

__all__ = [
    "UNKNOWN", "BrokenPromise", "Chain", "Finding", "Machine", "Options", "Outcome", "Page",
    "Recording", "Run",
]  # fmt: skip

UNKNOWN = Error(None, None, None)
"""The error of a run that was compared with nothing."""


@dataclass(frozen=True)
class Options:
    """Options of the command line that a machine is assembled with.

    Attributes:
        device: part of an OpenCL device's name, "numba", or None for the default device.
        resume: whether the run continues in a folder that an interrupted run has left.
        trace: file that waveforms are written to, None for none.
    """

    device: str | None = None
    resume: bool = False
    trace: Path | None = None


@dataclass(frozen=True)
class Finding:
    """A bound of the plan that a measurement exceeded, and so an effect that must be kept.

    Attributes:
        effect: name of the effect to reinstate.
        message: one line for the user.
        promised, measured: the bound, and the upper limit of the measurement; None if unknown.
        tile: number of the tile, None if the finding concerns the whole plane.
    """

    effect: str
    message: str
    promised: float | None = None
    measured: float | None = None
    tile: int | None = None


class BrokenPromise(Exception):
    """Raised while a chain runs, as soon as a bound of its plan is exceeded."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        super().__init__(", ".join(finding.effect for finding in findings))
        self.findings = list(findings)


@dataclass(frozen=True)
class Recording:
    """A chain that has run to its end.

    Attributes:
        seconds: wall time of each stage, s.
        throughput: speed of the stages; empty if a part of the run was done earlier.
    """

    seconds: dict[str, float]
    throughput: list[Throughput] = field(default_factory=list)


class Chain(Protocol):
    """The stages of a machine, from source to sink, recording into a run's folder.

    Attributes:
        checkpoint: file that exists while the chain is not finished, and that it resumes from.
    """

    checkpoint: Path

    def run(self, resume: bool, progress: Progress) -> Recording:
        """Runs to the end. Raises Interrupted, BrokenPromise, or InputError (full disk)."""
        ...

    def save(self) -> None:
        """Writes the checkpoint of the chain's end, for a run that is interrupted later."""
        ...

    def discard(self) -> None:
        """Removes the checkpoint and the recording, before the run is done again."""
        ...


@dataclass(frozen=True)
class Outcome:
    """What a machine says of its recording: the machine's part of `result.json`.

    Attributes:
        outcome: "ok", "degraded" or "failed".
        files: names of the files that recording and judging have written, in the run's folder.
        notes: what the user must know, found during or after the run.
        verdict: lines that stand before the metrics on the terminal.
        table: lines that stand in place of most metrics on the terminal.
        simulated_s: simulated time, s.
    """

    outcome: str
    simulated_s: float
    error: Error = UNKNOWN
    kept: list[str] = field(default_factory=list)
    left_out: list[dict[str, Any]] = field(default_factory=list)
    metrics: dict[str, Metric] = field(default_factory=dict)
    latency: list[Latency] = field(default_factory=list)
    throughput: list[Throughput] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    verdict: list[str] = field(default_factory=list)
    table: list[str] = field(default_factory=list)
    renderer: str | None = None


@dataclass(frozen=True)
class Run:
    """A run that is judged, for its report.

    Attributes:
        folder: the run's folder.
        result: what `result.json` will say, so far.
        seconds: wall time of each stage, s; a report may add its own.
        notes: all notes, in the order in which the user has seen them.
        reinstated: findings that led to another recording.
        began: time.perf_counter() at the command's start.
    """

    folder: Path
    result: Result
    seconds: dict[str, float]
    notes: list[str]
    reinstated: list[Finding]
    began: float


@dataclass(frozen=True)
class Page:
    """A machine's part of the report; the frame around it is the same for all.

    Attributes:
        title, subtitle: of the page.
        cards: HTML of the large figures at the top.
        sections: HTML of the sections, in their order.
        again: HTML that says how the run is repeated; None for the section that fits any run.
        files: names of the files written for the report, in the run's folder.
    """

    title: str
    subtitle: str
    cards: str
    sections: list[str]
    again: str | None = None
    files: list[str] = field(default_factory=list)


class Machine(Protocol):
    """A system that is checked, planned and ready to run.

    Attributes:
        toml: the resolved scenario, as TOML.
        notes: what the user must know before the run.
        device: what the simulation runs on, for the result.
        length, unit: size of the run for messages, such as 2560 "cycles".
        bits: upper limit of the recording's size on disk, bits.
    """

    toml: str
    notes: Sequence[str]
    device: str
    length: int
    unit: str
    bits: int

    def trial(self, progress: Progress) -> list[Finding]:
        """Checks the plan on patches before anything is recorded; [] if it holds or if the check
        is done beside the recording."""
        ...

    def keep(self, effects: Sequence[str]) -> Machine:
        """The same machine planned anew, with these effects kept."""
        ...

    def chain(self, folder: Path) -> Chain: ...

    def shortfall(self) -> list[Finding]:
        """Effects to reinstate because the whole error exceeds the tolerance, after the chain."""
        ...

    def judge(self, folder: Path, recording: Recording, progress: Progress) -> Outcome: ...

    def page(self, run: Run) -> Page: ...

    def close(self) -> None:
        """Releases devices, ports and renderers."""
        ...
