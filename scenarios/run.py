"""One run of any kind: assemble, trial, record, verify, judge, report.

A bound of the plan that a measurement exceeds reinstates its effect, and the recording is made
again. `result.json` comes last, so that a folder that holds one is complete.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass
from pathlib import Path

from cosim import InputError, Interrupted
from cosim.files.whole import whole
from cosim.run.folder import (
    REINSTATED,
    begin_folder,
    check_room,
    claim_folder,
    how_to_resume,
    output_folder,
)
from cosim.run.machine import BrokenPromise, Finding, Machine, Options, Outcome, Recording, Run
from cosim.run.progress import Progress
from cosim.run.result import Result, dumps, write_result
from scenarios.assemble.machine import assemble
from scenarios.assemble.schema.scenario import AnyScenario
from scenarios.report import write_report

__all__ = ["Done", "run_scenario"]

Report = Callable[[Machine, Run], list[str]]
REPORT: Report = write_report


@dataclass(frozen=True)
class Done:
    """A finished run: its result and folder, and what its machine says on a terminal."""

    result: Result
    folder: Path
    outcome: Outcome


def run_scenario(
    name: str,
    scenario: AnyScenario,
    out: Path | None,
    *,
    options: Options,
    progress: Progress,
    began: float,
    report: Report | None = None,
) -> Done:
    """Runs a scenario of any kind and writes its folder.

    Args:
        name: short name of the scenario.
        scenario: checked scenario.
        out: folder to make; runs/<name>-<n> if None.
        options: of the command line.
        progress: receives progress and notes.
        began: time.perf_counter() at the command's start.
        report: writes figures and report.html and returns their names; REPORT by default.

    Raises InputError for input that cannot be used (nothing has been written then), Interrupted.
    """
    place = output_folder(name, out, options.resume)
    with ExitStack() as stack:
        machine = assemble(name, scenario, options, progress)
        stack.callback(lambda: machine.close())  # of the machine as it is then
        check_room(place, machine.bits)
        folder = stack.enter_context(claim_folder(name, out, options.resume))
        machine, recording, reinstated = _record(machine, folder, options, progress)
        finished = False
        try:
            progress.start("images and report", 2)
            outcome = machine.judge(recording, progress)
            result = _result(name, scenario, machine, outcome)
            progress.advance(1)
            for note in outcome.notes:
                progress.note(note)
            found = [finding.message for finding in reinstated]
            notes = [*machine.notes, *found, *outcome.notes]
            run = Run(folder, result, recording, outcome, notes, reinstated, began)
            result.files += (report or REPORT)(machine, run)
            result.files.append("result.json")
            progress.advance(2)
            result.run_time_s = time.perf_counter() - began
            write_result(folder, result)
            for leftover in (recording.chain.checkpoint, folder / REINSTATED):
                leftover.unlink(missing_ok=True)
            finished = True
        except KeyboardInterrupt:
            raise Interrupted(
                machine.length, machine.length, how_to_resume(folder), machine.unit
            ) from None
        finally:
            if not finished:  # whatever the reason, the recording is not lost
                with suppress(OSError):  # a full disk
                    recording.chain.save()
    return Done(result, folder, outcome)


def _record(
    machine: Machine, folder: Path, options: Options, progress: Progress
) -> tuple[Machine, Recording, list[Finding]]:
    """Records until every bound of the plan holds; the machine as it is then, its recording, and
    the findings that led to another one."""
    record = folder / REINSTATED
    resume = options.resume and machine.chain(folder).checkpoint.exists()  # else it starts afresh
    findings = _reinstated_before(record) if resume else []
    if findings:
        machine = machine.keep([finding.effect for finding in findings])
    announced = bool(findings)
    while True:
        new = machine.trial(progress)
        if not new:
            chain = machine.chain(folder)
            if resume:
                chain.load()  # refused before anything is overwritten
            begin_folder(folder, machine.toml)
            if not announced:
                for note in machine.notes:
                    progress.note(note)
                announced = True
            try:
                recording = Recording(chain, folder, chain.run(progress), resume)
                new = machine.shortfall(recording)
            except BrokenPromise as exc:
                new = exc.findings
            if not new:
                return machine, recording, findings
            chain.discard()
        findings += new
        for finding in new:
            progress.note(finding.message)
        with whole(record) as part:
            part.write_text(dumps([asdict(f) for f in findings]), encoding="utf-8")
        machine, resume = machine.keep([finding.effect for finding in findings]), False


def _reinstated_before(path: Path) -> list[Finding]:
    """The findings of a run that is resumed, up to its interruption."""
    if not path.exists():
        return []
    try:
        return [Finding(**found) for found in json.loads(path.read_text(encoding="utf-8"))]
    except (OSError, ValueError, TypeError) as exc:
        raise InputError(
            REINSTATED, "the one that this run wrote", "a damaged file",
            f"remove {path.parent} and run it afresh",
        ) from exc  # fmt: skip


def _result(name: str, scenario: AnyScenario, machine: Machine, outcome: Outcome) -> Result:
    return Result(
        scenario=name,
        outcome=outcome.outcome,
        seed=scenario.seed,
        device=machine.device,
        simulated_s=outcome.simulated_s,
        tolerance=getattr(scenario, "tolerance", 0.0),
        renderer=outcome.renderer,
        error=outcome.error,
        kept=outcome.kept,
        left_out=outcome.left_out,
        metrics=outcome.metrics,
        latency=outcome.latency,
        throughput=outcome.throughput,
        files=["scenario.toml", *outcome.files],
    )
