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
    "Recording", "Run", "Study",
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


class Chain(Protocol):
    """The stages of a machine, from source to sink, recording into a run's folder.

    Attributes:
        checkpoint: file that exists while the chain is not finished, and that it resumes from.
    """

    @property
    def checkpoint(self) -> Path: ...

    def load(self) -> None:
        """Restores the state at the checkpoint. Raises InputError for one of another run."""
        ...

    def run(self, progress: Progress) -> dict[str, float]:
        """Runs to the end; the wall time of each stage, s. Raises Interrupted, BrokenPromise, or
        InputError (full disk)."""
        ...

    def save(self) -> None:
        """Writes the checkpoint of the chain's end, for a run that is interrupted after it."""
        ...

    def discard(self) -> None:
        """Removes the recording and the checkpoint, before the run is done again."""
        ...


@dataclass(frozen=True)
class Recording:
    """A chain that has run to its end.

    Attributes:
        chain: it, with whatever it holds in memory.
        folder: the run's folder.
        seconds: wall time of each stage, s; judging and reporting add their own.
        resumed: whether a part of the run was done earlier, so that speeds are unknown.
    """

    chain: Any
    folder: Path
    seconds: dict[str, float]
    resumed: bool


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
        views: what the machine has made of the recording for its page.
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
    views: Any = None


@dataclass(frozen=True)
class Run:
    """A run that is judged, for its report.

    Attributes:
        folder: the run's folder.
        result: what `result.json` will say, so far.
        recording, outcome: what was judged, and what was found.
        notes: all notes, in the order in which the user has seen them.
        reinstated: findings that led to another recording.
        began: time.perf_counter() at the command's start.
    """

    folder: Path
    result: Result
    recording: Recording
    outcome: Outcome
    notes: list[str]
    reinstated: list[Finding]
    began: float

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time of each stage, s."""
        return self.recording.seconds


@dataclass(frozen=True)
class Page:
    """A machine's part of the report; the frame around it is the same for all.

    Attributes:
        title: of the scenario.
        subtitle: the machine in one line.
        cards: HTML of the large figures at the top.
        sections: HTML of the sections, in their order.
        commands: command lines that make single results again, before the one that repeats the run.
        commands_do: one sentence on what these commands make.
        files: names of the files written for the report, in the run's folder.
    """

    title: str
    subtitle: str
    cards: str
    sections: list[str]
    commands: list[str] = field(default_factory=list)
    commands_do: str = ""
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

    @property
    def toml(self) -> str: ...
    @property
    def notes(self) -> Sequence[str]: ...
    @property
    def device(self) -> str: ...
    @property
    def length(self) -> int: ...
    @property
    def unit(self) -> str: ...
    @property
    def bits(self) -> int: ...

    def trial(self, progress: Progress) -> list[Finding]:
        """Checks the plan on patches before anything is recorded; [] if it holds, or if the check
        is done beside the recording."""
        ...

    def keep(self, effects: Sequence[str]) -> Machine:
        """The same machine planned anew, with these effects kept. It takes over what this one has
        opened; this one must not be used any more."""
        ...

    def chain(self, folder: Path) -> Chain: ...

    def shortfall(self, recording: Recording) -> list[Finding]:
        """Effects to reinstate because the error of the recording exceeds the tolerance."""
        ...

    def judge(self, recording: Recording, progress: Progress) -> Outcome: ...

    def page(self, run: Run) -> Page: ...

    def close(self) -> None:
        """Releases devices, ports and renderers."""
        ...


class Study(Protocol):
    """A machine that is planned and measured without a run of its own."""

    def forecast(self, progress: Progress) -> dict[str, Any]:
        """The document of `viform plan`: what is kept and left out, bounds and predicted cost."""
        ...

    def ladder(self, progress: Progress) -> dict[str, Any]:
        """The document of `viform accuracy`: error against run time at a ladder of tolerances."""
        ...
