"""A run of a link: a file crosses the air as light, is received, and both are held side by side."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cosim import Interrupted
from cosim.files import ZarrStream
from cosim.files.whole import whole
from cosim.run.chain import CHECKPOINT, STREAM
from cosim.run.folder import check_room, claimed, mend, output_folder
from cosim.run.progress import Progress
from cosim.run.result import Result, dumps, write_result
from link.evaluation.finished import LinkRun
from link.evaluation.judge import judge_link
from link.run.film import film_link
from link.run.prepare import PreparedLink, ReadyLink, prepare_link
from link.run.receive import receive_stream
from link.section import LinkScenario
from link.verdict import Cause, Verdict
from scenarios.assemble.link_loop import open_loop

__all__ = ["RECEIVED", "VERDICT", "link_verdict", "run_link"]

RECEIVED, VERDICT = "received", "verdict.json"
"""Names in a run's folder."""


def link_verdict(run: ReadyLink, received: Any) -> tuple[Verdict, bool]:
    """The verdict, and whether the file came as it was sent."""
    delivered = received.delivered
    if delivered is not None:
        if delivered == (run.payload.data, run.payload.name):
            return received.verdict, True
        told = "the receiver took other bytes for the file: nothing is handed out"
        return Verdict(Cause.NOISY, told), False
    if run.hopeless:
        told = f"{received.verdict.told}; {run.hopeless_told()}"
        return Verdict(received.verdict.cause, told), False
    if not run.sent.sent_whole and received.verdict.cause in (Cause.TRUNCATED, Cause.NOISY):
        told = (
            f"the run's duration has room for {run.sent.symbols} symbols, which do not hold the "
            f"file's {len(run.payload.data):,} bytes; lengthen duration or leave it out"
        )
        return Verdict(Cause.TOO_LARGE, told), False
    return received.verdict, False


def _hand_out(
    folder: Path, run: PreparedLink, delivered: bool, document: dict[str, Any]
) -> list[str]:
    """Writes the verdict, and the file where it is whole; their names."""
    names = [VERDICT]
    place = folder / RECEIVED / run.payload.name
    for old in (folder / RECEIVED).glob("*"):
        old.unlink()
    if delivered:
        (folder / RECEIVED).mkdir(exist_ok=True)
        with whole(place) as part:
            part.write_bytes(run.payload.data)
        names.append(f"{RECEIVED}/{run.payload.name}")
    with whole(folder / VERDICT) as part:
        part.write_text(dumps(document) + "\n", encoding="utf-8")
    return names


def run_link(
    name: str,
    scenario: LinkScenario,
    out: Path | None,
    *,
    resume: bool = False,
    device: str | None = None,
    progress: Progress,
    began: float,
    report: Callable[[LinkRun], list[str]],
) -> tuple[Result, Path]:
    """Runs a scenario of a link and writes its folder, `result.json` last.

    began: time.perf_counter() at the command's start. report: writes figures and report.html and
    returns their names. The outcome is "failed" where the file did not arrive, with the cause in
    verdict.json; `received/` then stays empty.
    Raises InputError for input that cannot be used (nothing has been written then), Interrupted.
    """
    place = output_folder(name, out, resume)
    with open_loop(scenario) as loop:
        run = prepare_link(name, scenario, device, progress)
        chip = run.setting.camera.chip
        check_room(place, run.cycles * chip.width * chip.height)
        with claimed(name, out, resume) as folder:
            if loop is not None:
                begin = time.perf_counter()
                loop.send(run.sent, progress)
                run.seconds["loop"] = time.perf_counter() - begin
            filmed, throughput = film_link(run, folder, resume, progress)
            seconds = run.seconds | filmed
            try:
                stream = ZarrStream(folder / STREAM)
                received = receive_stream(run, stream, seconds, progress)
                verdict, delivered = link_verdict(run, received)
                finished = judge_link(
                    run, folder, stream, received, verdict, delivered, seconds, throughput, began
                )
                result = finished.result
                if loop is not None:
                    result.metrics |= loop.metrics()
                    if loop.fault is not None:
                        result.outcome = "failed"
                        finished.notes.append(loop.fault)
                result.files += _hand_out(folder, run, delivered, finished.verdict_document())
                for note in finished.notes[len(run.notes) :]:
                    progress.note(note)
                result.files += report(finished)
                result.files.append("result.json")
                result.run_time_s = time.perf_counter() - began
                write_result(folder, result)
                (folder / CHECKPOINT).unlink(missing_ok=True)
            except KeyboardInterrupt:
                raise Interrupted(run.cycles, run.cycles, mend(folder)) from None
    return result, folder
