"""Runs a scenario of any kind: assemble, check, record, judge, report.

If a measurement exceeds a bound of the plan, the effect is reinstated and the recording is
repeated. `result.json` is written last: a folder that contains it is complete.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from shutil import rmtree

from pydantic import TypeAdapter

from cosim import InputError, Interrupted
from cosim.compute.stopping import undone
from cosim.files import NOT_KEPT, storing
from cosim.files.atomic import atomic_write, sync_tree
from cosim.plan.error import BrokenPromise, Finding
from cosim.report.figures import load_ahead
from cosim.report.png import pictures
from cosim.run.folder import (
    REINSTATED,
    begin_folder,
    check_room,
    claim_folder,
    how_to_resume,
    output_folder,
)
from cosim.run.loop import discard_checkpoints, noted_interrupts
from cosim.run.machine import NO_REPORT, Machine, Options, Outcome, Recording, Run
from cosim.run.progress import EstimatedProgress, Progress
from cosim.run.result import Metric, Result, dumps, write_result
from scenarios.assemble.machine import assemble
from scenarios.assemble.schema.scenario import AnyScenario
from scenarios.report import write_report

Report = Callable[[Machine, Run], list[str]]
REPORT: Report = write_report


@dataclass(frozen=True)
class Done:
    """A completed run.

    Attributes:
        result: content of `result.json`.
        folder: folder of the run.
        outcome: evaluation by the machine, with its lines for the terminal.
    """

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
        out: folder to create; runs/<name>-<n> if None.
        options: options of the command line.
        progress: receives progress and notes.
        began: time.perf_counter() at the start of the command.
        report: writes figures and report.html and returns their names, where options.report asks
            for a page; REPORT by default.

    Raises:
        InputError: the input cannot be used; nothing has been written.
        Interrupted: the user interrupted the run.
    """
    place = output_folder(name, out, options.resume)
    paged = options.report != NO_REPORT
    with ExitStack() as stack:
        stack.enter_context(pictures(paged))
        machine = assemble(name, scenario, options, progress)
        stack.callback(lambda: machine.close())  # the last machine: `_record` may replace it
        check_room(place, machine.bits)
        folder = stack.enter_context(claim_folder(name, out, options.resume))
        stack.enter_context(storing(options.store))
        stack.enter_context(undone(f"interrupted within a step; {how_to_resume(folder)}"))
        load_ahead(figures=report is None and paged)
        machine, recording, reinstated = _record(machine, folder, options, progress)
        interrupted = stack.enter_context(noted_interrupts())
        finished = False
        try:
            progress.start("images and report" if paged else "figures of merit", 2)
            outcome = machine.judge(recording, progress)
            if recording.resumed:
                outcome = _without_speeds(outcome)
            result = _result(name, scenario, machine, outcome)
            progress.advance(1)
            for note in outcome.notes:
                progress.note(note)
            messages = [finding.message for finding in reinstated]
            notes = [*machine.notes, *messages, *outcome.notes]
            run = Run(folder, result, recording, outcome, notes, reinstated, began)
            if paged:
                result.files += (report or REPORT)(machine, run)
            streams = [name for name in result.files if name.endswith(".zarr")]
            if options.store == NOT_KEPT:
                result.files = [name for name in result.files if name not in streams]
            result.files.append("result.json")
            progress.advance(2)
            result.run_time_s = time.perf_counter() - began
            if interrupted.is_set():  # and a library has lost the exception
                raise KeyboardInterrupt
            lost = streams if options.store == NOT_KEPT else []
            sync_tree(folder, without=lost)  # all that the result names is there before it
            write_result(folder, result)
            discard_checkpoints(recording.chain.checkpoint)
            (folder / REINSTATED).unlink(missing_ok=True)
            finished = True
            if options.store == NOT_KEPT:  # only now: without them a run cannot be resumed
                for name in streams:
                    rmtree(folder / name, ignore_errors=True)
        except KeyboardInterrupt:
            raise Interrupted(
                machine.length, machine.length, how_to_resume(folder), machine.unit
            ) from None
        finally:
            if not finished:  # after any error, the run can be resumed from its recording
                with suppress(OSError, InputError):  # a full disk, or one that is read-only
                    recording.chain.save()
    return Done(result, folder, outcome)


def _without_speeds(outcome: Outcome) -> Outcome:
    """The outcome of a resumed run: its stages have run for a part of the time only."""
    metrics = dict(outcome.metrics)
    if "camera" in metrics:
        metrics["camera"] = Metric(None, "s", "the run was resumed: only a part of it was timed")
    return replace(outcome, throughput=[], metrics=metrics)


def _record(
    machine: Machine, folder: Path, options: Options, progress: Progress
) -> tuple[Machine, Recording, list[Finding]]:
    """Records until every bound of the plan holds.

    Returns:
        The machine with its last plan, the recording, and the findings that changed the plan.
    """
    record = folder / REINSTATED
    resume = options.resume and machine.chain(folder).checkpoint.exists()  # else it starts anew
    findings = _reinstated_before(record) if resume else []
    if findings:
        machine = machine.keep([finding.effect for finding in findings])
    announced = bool(findings)
    while True:
        new = machine.check(progress)
        if not new:
            chain = machine.chain(folder)
            if resume:
                resume = chain.load(progress)  # raises InputError before a file is overwritten
            begin_folder(folder, machine.toml)
            if not announced:
                for note in machine.notes:
                    progress.note(note)
                announced = True
            try:
                recording = Recording(
                    chain, folder, chain.run(EstimatedProgress(progress, folder)), resume
                )
                new = _shortfall(machine, recording)
            except BrokenPromise as exc:
                new = exc.findings
            if not new:
                return machine, recording, findings
            chain.discard()
        findings += new
        for finding in new:
            progress.note(finding.message)
        with atomic_write(record) as part:
            part.write_text(dumps([asdict(f) for f in findings]), encoding="utf-8")
        machine, resume = machine.keep([finding.effect for finding in findings]), False


def _shortfall(machine: Machine, recording: Recording) -> list[Finding]:
    """What the check of a complete recording found. If it is interrupted or fails, the run can be
    resumed from its recording."""
    try:
        return machine.shortfall(recording)
    except BrokenPromise:
        raise
    except BaseException as exc:
        with suppress(OSError, InputError):  # a full disk, or one that is read-only
            recording.chain.save()
        if isinstance(exc, KeyboardInterrupt):
            remedy = how_to_resume(recording.folder)
            raise Interrupted(machine.length, machine.length, remedy, machine.unit) from None
        raise


def _reinstated_before(path: Path) -> list[Finding]:
    """The findings of a resumed run before its interruption."""
    if not path.exists():
        return []
    try:
        return TypeAdapter(list[Finding]).validate_json(path.read_bytes())
    except (OSError, ValueError) as exc:
        raise InputError(
            REINSTATED, "the file that this run wrote", "a damaged file",
            f"remove {path.parent} and start the run again",
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
