"""The machine of a latched chip whose planes pass its digital readout to a host."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from cosim import Clock, InputError
from cosim.clock import seconds_to_ps
from cosim.compute.opencl import Device, choose_device
from cosim.files.raw import RAW_SIZE
from cosim.plan.error import Finding
from cosim.run.chain import BlockChain
from cosim.run.machine import Machine, Outcome, Page, Recording, Run, Study
from cosim.run.progress import Progress
from cosim.run.result import Throughput
from rtl_model.readout.buffer import ROW_BYTES, Needs, RowBuffer, needed_rate
from rtl_model.readout.report import (
    FIGURE,
    loss_note,
    readout_latency,
    readout_line,
    readout_metrics,
    readout_section,
)
from rtl_model.readout.scan import BIT_RATE, ScanTiming, Window
from rtl_model.readout.stage import ScanStage
from scenarios.assemble.behind.link.ends import Later, bare
from scenarios.assemble.behind.machine import ChainMachine
from scenarios.assemble.schema.scenario import AnyScenario, LinkScenario, Scenario
from sensor.sections.readout import ReadoutSection
from sensor.sections.sensor import SensorSection

SCAN, _RECORDER = "scan", "recorder"
"""Names of stages: the readout, and the one that it stands before."""


@dataclass(frozen=True, eq=False)
class ReadoutMachine:
    """A latched chip with its digital readout; see `Machine`.

    The stage stands before the recorder, in the chain of the chip's own machine. So the recorded
    stream, and a code, a display or a receiver behind it, have what the host gets. The check of the
    plan compares the chip's own bits.

    Attributes:
        inner: the machine of the chip, with what stands behind it.
        setup: the readout.
        cycles: length of the stream.
        scanner: OpenCL device of the scan; None for numpy.
        lead: cycles of the chain before the first one of the stream.
    """

    inner: Machine
    setup: ReadoutSetup
    cycles: int
    scanner: Device | None
    lead: int

    @property
    def toml(self) -> str:
        return self.inner.toml

    @property
    def notes(self) -> Sequence[str]:
        return self.inner.notes

    @property
    def device(self) -> str:
        return self.inner.device

    @property
    def length(self) -> int:
        return self.inner.length

    @property
    def unit(self) -> str:
        return self.inner.unit

    @property
    def bits(self) -> int:
        rows = self.setup.timing.blocks // 2
        own = self.cycles * rows * ROW_BYTES * 8 if self.setup.section.file else 0
        return self.inner.bits + own

    def check(self, progress: Progress) -> list[Finding]:
        return self.inner.check(progress)

    def keep(self, effects: Sequence[str]) -> ReadoutMachine:
        return replace(self, inner=self.inner.keep(effects))

    def chain(self, folder: Path) -> BlockChain:
        chain = self.inner.chain(folder)
        assert isinstance(chain, BlockChain)
        stage = ScanStage(
            self.setup.buffer(), self.cycles, folder, self.scanner, self.setup.section.file
        )
        stages: dict[str, Any] = {}
        for name, each in chain.stages.items():
            if name == _RECORDER:
                stages[SCAN] = Later(stage, self.lead, self.cycles) if self.lead else stage
            stages[name] = each
        chain.stages = stages
        return chain

    def shortfall(self, recording: Recording) -> list[Finding]:
        return self.inner.shortfall(recording)

    def judge(self, recording: Recording, progress: Progress) -> Outcome:
        outcome, stage = self.inner.judge(recording, progress), _stage_of(recording)
        lost = loss_note(stage, self.setup.needed_bps)
        speeds = []
        if not recording.resumed:
            offered = stage.buffer.offered * ROW_BYTES * 8
            speeds = [Throughput("readout", offered / recording.seconds[SCAN], "bit/s")]
        return replace(
            outcome,
            outcome="degraded" if lost and outcome.outcome == "ok" else outcome.outcome,
            metrics=outcome.metrics | readout_metrics(stage, self.setup.section.lanes),
            latency=[*readout_latency(stage), *outcome.latency],
            throughput=[*outcome.throughput, *speeds],
            files=[*outcome.files, *stage.names],
            notes=[*outcome.notes, *([] if lost is None else [lost])],
            table=[*outcome.table, readout_line(stage), ""] if outcome.table else [],
        )

    def page(self, run: Run) -> Page:
        page, stage = self.inner.page(run), _stage_of(run.recording)
        section = readout_section(stage, self.setup.section.lanes, run.folder)
        return replace(page, sections=[*page.sections, section], files=[*page.files, FIGURE])

    def close(self) -> None:
        self.inner.close()


def _stage_of(recording: Recording) -> ScanStage:
    """The stage of the readout, without what puts it into the clock of its chain."""
    found = bare(recording.chain.stages[SCAN])
    assert isinstance(found, ScanStage)
    return found


def with_readout(setup: ReadoutSetup | None, machine: Machine, device: str | None) -> Machine:
    """A machine of a latched chip with its readout; unchanged without one.

    Args:
        setup: the readout.
        machine: machine of a scene before the chip, or of a link that it films.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
    """
    if setup is None:
        return machine
    lead, cycles = 0, machine.length
    if isinstance(machine, ChainMachine):  # the chain may count the cycles of a link
        lead, cycles = machine.behind.lead, machine.feed.cycles
    return ReadoutMachine(machine, setup, cycles, choose_device(device), lead)


@dataclass(frozen=True)
class ReadoutStudy:
    """A study of a machine with a readout; see `Study`. What its link loses is no error of the
    simulation, so the ladder is the machine's own.

    Attributes:
        inner: the study of the machine.
        setup: the readout.
        cycles: length of the run; None for a link, whose forecast says it.
    """

    inner: Study
    setup: ReadoutSetup
    cycles: int | None

    def forecast(self, progress: Progress) -> dict[str, Any]:
        document = self.inner.forecast(progress)
        cycles = document["amounts"]["cycles"] if self.cycles is None else self.cycles
        return document | {"readout": self.setup.needs(cycles)}

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return self.inner.ladder(progress)


@dataclass(frozen=True)
class ReadoutSetup:
    """The readout of a run.

    Attributes:
        section: the section [readout].
        timing: timing of the row scan, with its window.
    """

    section: ReadoutSection
    timing: ScanTiming

    @property
    def rate(self) -> int:
        """Rate of the link behind the chip, bit/s."""
        given = self.section.rate
        return BIT_RATE if given is None else round(given)

    @property
    def needed_bps(self) -> int:
        """Least rate of the link at which nothing is lost, bit/s."""
        return needed_rate(self.timing, self.section.buffer)

    def buffer(self) -> RowBuffer:
        """A new buffer."""
        return RowBuffer(self.timing, self.rate, self.section.buffer)

    def needs(self, cycles: int) -> dict[str, Any]:
        """The key `readout` of `viform plan --json`, for a run of `cycles` cycles."""
        return Needs.of(self.buffer(), cycles, self.section.file).document()


def refuse_readout(scenario: AnyScenario, command: str) -> None:
    """Raises InputError for a scenario with [readout], for commands without one."""
    if getattr(scenario, "readout", None) is not None:
        raise InputError(
            "readout", f"absent for viform {command}", "given",
            "leave it out: there is no host in this command",
        )  # fmt: skip


def readout_of(scenario: AnyScenario) -> ReadoutSetup | None:
    """The readout of a scenario; None without one. Raises InputError for one that its chip cannot
    have."""
    if not isinstance(scenario, Scenario | LinkScenario) or scenario.readout is None:
        return None
    section, sensor = scenario.readout, scenario.sensor
    _check_chip(sensor, isinstance(scenario, LinkScenario))
    spans = []
    for name, size in (("rows", RAW_SIZE[1]), ("columns", RAW_SIZE[0])):
        first, stop = getattr(section, name) or (0, size)
        if stop > size:
            raise InputError(
                f"readout.{name}", f"[first, stop) within 0 to {size}", str([first, stop]),
                f"write [{min(first, size - 1)}, {size}]",
            )  # fmt: skip
        spans.append((first, stop - 1))
    timing = ScanTiming(Clock.from_hz(sensor.clock), Window(*spans))
    return ReadoutSetup(section, timing)


def _check_chip(sensor: SensorSection, steered: bool) -> None:
    """Raises InputError for a chip without such a readout. steered: whether a link may steer it."""
    chip = sensor.own_chip
    if (chip.width, chip.height) != RAW_SIZE:
        own = [f"sensor.{side}" for side in ("width", "height") if getattr(sensor, side)]
        without = f" without {' and '.join(own)}" if own else ""
        raise InputError(
            "readout", f"given with a chip of {RAW_SIZE[0]} x {RAW_SIZE[1]} pixels, whose markers "
            "are known", f"with {chip.width} x {chip.height}",
            f"set sensor.chip=spiketwo{without}, or leave it out",
        )  # fmt: skip
    if any(write.window is not None for write in sensor.writes or ()):
        raise InputError(
            "the windows of sensor.writes", "absent with a [readout], whose window is fixed",
            "given", "use readout.rows, or leave the readout out",
        )  # fmt: skip
    if steered and sensor.clock_steering is not False:
        raise InputError(
            "sensor.clock_steering", "false with a [readout]: a shortened tick has no room for its "
            "scan", "on", "write --set sensor.clock_steering=false",
        )  # fmt: skip


def run_cycles(scenario: AnyScenario) -> int | None:
    """Cycles of a run with a scene; None for that of a link, which its plan determines."""
    if not isinstance(scenario, Scenario):
        return None
    return Clock.from_hz(scenario.sensor.clock).cycles_in(seconds_to_ps(scenario.duration))
