"""The protocols by which every kind of machine is planned, run, checked and reported.

Every run has the same steps: assemble, check, record, judge, report. `scenarios/run.py`
implements these steps once, with the protocols in this file. Each part of the system implements the
protocols for the machines that it simulates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

from cosim.plan.error import Finding
from cosim.run.progress import Progress
from cosim.run.result import Error, Latency, Metric, Result, Throughput

UNKNOWN = Error(None, None, None)
"""The error of a run without a comparison."""
NO_REPORT: Final = "none"
REPORTS: Final = ("page", NO_REPORT)
"""What is made beside the recordings and result.json: images, figures and a page, or nothing."""


@dataclass(frozen=True)
class Options:
    """Options of the command line for the assembly of a machine.

    Attributes:
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        resume: whether the run continues in the folder of an interrupted run.
        trace: file for waveforms, None for none.
        store: how streams are compressed, one of `cosim.files.STORES`; the bits are the same.
        workers: processes on this machine that simulate the chip in bands of rows; None for none.
        scheduler: address of a Dask scheduler, whose workers do so; None for none.
        report: what is made of the recordings, one of `REPORTS`; the result is the same.
    """

    device: str | None = None
    resume: bool = False
    trace: Path | None = None
    store: str = "fast"
    workers: int | None = None
    scheduler: str | None = None
    report: str = REPORTS[0]


class Chain(Protocol):
    """The stages of a machine, from source to sink, which record into the folder of a run.

    Attributes:
        checkpoint: file from which an unfinished chain resumes; it exists only until the end.
    """

    @property
    def checkpoint(self) -> Path: ...

    def load(self, progress: Progress) -> bool:
        """Restores the state at the checkpoint, or, with a note, at the one before if a file that
        it builds on is lost or damaged. Returns False, with a note, if neither is sound: then the
        chain has no checkpoint any more, and begins at its start. Raises
        InputError for a checkpoint of another run."""
        ...

    def run(self, progress: Progress) -> dict[str, float]:
        """Runs to the end; returns the wall time of each stage, s. Raises Interrupted,
        BrokenPromise, or InputError (full disk)."""
        ...

    def save(self) -> None:
        """Writes a checkpoint at the end of the chain, in case the run is interrupted after it."""
        ...

    def discard(self) -> None:
        """Removes the recording and the checkpoint, before the chain is repeated."""
        ...


@dataclass(frozen=True)
class Recording:
    """A chain that has run to its end.

    Attributes:
        chain: the chain, with its data in memory.
        folder: folder of the run.
        seconds: wall time of each stage, s; judging and reporting add theirs.
        resumed: whether the run was resumed, so that speeds are unknown.
    """

    chain: Any
    folder: Path
    seconds: dict[str, float]
    resumed: bool


@dataclass(frozen=True)
class Outcome:
    """Evaluation of a recording by its machine: the machine's part of `result.json`.

    Attributes:
        outcome: "ok", "degraded" or "failed".
        simulated_s: simulated time, s.
        error: the simulation against full physics.
        kept, left_out: effects of the plan.
        metrics: measured figures by name.
        latency: latencies in the simulated machine.
        throughput: speeds of the simulation.
        files: names of the files written by recording and judging, in the folder of the run.
        notes: information for the user from the run and its evaluation.
        verdict: lines printed before the metrics on the terminal.
        table: lines printed in place of most metrics on the terminal.
        renderer: name of the renderer, None for none.
        views: data of the recording for the machine's page.
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
    """A run after its evaluation, for the report.

    Attributes:
        folder: folder of the run.
        result: content of `result.json` so far.
        recording, outcome: the recording, and its evaluation.
        notes: all notes, in the order in which the user has received them.
        reinstated: findings that led to another recording.
        began: time.perf_counter() at the start of the command.
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
    """A machine's part of the report; all machines share the frame around it.

    Texts are plain, cards and sections those of `cosim.report.parts`.

    Attributes:
        title: title of the scenario.
        subtitle: description of the machine in one line.
        simulated: what was simulated, in sentences that a newcomer understands.
        cards: (CSS class, figure, what it is) of the main figures of the machine.
        sections: HTML of the sections, in their order; each begins with <h2>.
        good: the question that the cards answer.
        quality: how to read the cards, one or two sentences.
        unmeasured: why the error of the simulation is not known, where it is not.
        commands: command lines that reproduce single results; the frame adds the one that repeats
            the run.
        commands_do: HTML of one sentence on the output of these commands.
        files: names of the files written for the report, in the folder of the run.
    """

    title: str
    subtitle: str
    simulated: str
    cards: list[tuple[str, str, str]]
    sections: list[str]
    good: str = "How good the camera is"
    quality: str = ""
    unmeasured: str = "It was not measured in this run."
    commands: list[str] = field(default_factory=list)
    commands_do: str = ""
    files: list[str] = field(default_factory=list)


class Machine(Protocol):
    """A system that is checked, planned and ready to run.

    Attributes:
        toml: the resolved scenario, as TOML.
        notes: information for the user before the run.
        device: device of the simulation, for the result.
        length, unit: length of the run for messages, such as 2560 "cycles".
        bits: upper limit of the size of the recording on disk, bits.
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

    def check(self, progress: Progress) -> list[Finding]:
        """Checks the plan on patches before the recording. Returns [] if the plan holds, or if the
        check runs along with the recording."""
        ...

    def keep(self, effects: Sequence[str]) -> Machine:
        """The same machine with a new plan that keeps these effects. It takes over the open
        resources of this one, which must not be used any more."""
        ...

    def chain(self, folder: Path) -> Chain:
        """The stages, which record into a folder."""
        ...

    def shortfall(self, recording: Recording) -> list[Finding]:
        """Effects to reinstate because the error of the recording exceeds the tolerance."""
        ...

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        """Evaluates a recording."""
        ...

    def page(self, run: Run) -> Page:
        """The machine's part of the report."""
        ...

    def close(self) -> None:
        """Releases devices, ports and renderers."""
        ...


class Study(Protocol):
    """A machine that is planned and measured without a run."""

    def forecast(self, progress: Progress) -> dict[str, Any]:
        """The document of `viform plan`: effects kept and left out, bounds and predicted cost."""
        ...

    def ladder(self, progress: Progress) -> dict[str, Any]:
        """The document of `viform accuracy`: error against run time over a ladder of tolerances."""
        ...
