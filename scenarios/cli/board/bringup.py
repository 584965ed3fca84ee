"""`viform board bringup` checks a board stage by stage; `replay` prints a log of the line, or
replays it through the stages without the board."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.run.shown import SilentProgress
from scenarios.cli.board.connection import (
    BoardOptions,
    Csr,
    endpoint_of,
    known_map,
    warn_of_latency,
)
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell

if TYPE_CHECKING:
    from rtl_model.bringup.bench.stage import Stage
    from rtl_model.host.replay import LogEvent

_PRINTED = 4  # most words of a transaction that are printed


@expand_options
def board_bringup(
    options: BoardOptions,
    out: Annotated[
        Path | None, typer.Option(help="folder for report.html and junit.xml, created if missing")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, max=4096, help="frames in each captured burst")] = 8,
    all_stages: Annotated[
        bool, typer.Option("--all", help="continue after a failed stage, if possible")
    ] = False,
    json: Json = False,
) -> None:
    """Bring a board up: port, bytes, identity, counters, registers, PRBS, pixel patterns, threshold
    sweep, frame timing; over UDP also packet loss, longest packets and payload rate. Exit 1 if a
    stage fails, with its cause."""
    from cosim import InputError
    from rtl_model.bringup.run import BringUp, bring_up
    from rtl_model.host.bone import check_answers
    from rtl_model.host.ether import is_udp

    csr = known_map(options.csr)
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as exc:
            actual = f"{out} ({exc.strerror})"
            raise InputError("--out", "a folder", actual, "choose another") from exc

    def report_stage(stage: Stage) -> None:
        if stage.figures.get("low_latency") is False:
            warn_of_latency(stage.figures["port"])
        if not json:
            print_stage(stage)

    with endpoint_of(options) as endpoint:
        bring_up_options = BringUp(
            baud=endpoint.baud,
            csr=csr,
            stop_at_first=not all_stages,
            simulated=endpoint.simulated,
            time_scale=endpoint.time_scale,
            frames=frames,
            low_latency=options.low_latency,
            lines=endpoint.lines,
            log=options.log,
        )
        if is_udp(endpoint.url):
            check_answers(endpoint.url, endpoint.simulated, endpoint.time_scale)
        report = bring_up(endpoint.url, bring_up_options, report_stage, SilentProgress().note)
    files: list[str] = []
    if out is not None:
        from rtl_model.bringup.report.page import write_board_report

        files = write_board_report(report, out)
    if json:
        print_document(report.document() | {"files": [str(out / f) for f in files] if out else []})
    else:
        tell("the board passes every stage" if report.ok else f"not passed: {report.cause}")
        for name in files:
            tell(f"{'written':<12} {out}/{name}")
    if not report.ok:
        raise typer.Exit(1)


def print_stage(stage: Stage) -> None:
    """Prints the line of a stage that has run."""
    if stage.outcome == "left out":
        return
    mark = "ok" if stage.outcome == "ok" else "FAILED"
    text = stage.cause if stage.cause is not None else _short(stage)
    tell(f"{mark:<7} {stage.name:<10} {stage.seconds:7.2f} s  {text}")
    sys.stdout.flush()


def _short(stage: Stage) -> str:
    from rtl_model.bringup.report.summary import stage_text

    return stage_text(stage)


def board_replay(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="file written with --log")],
    csr: Csr = None,
    judge: Annotated[
        bool, typer.Option("--bringup", help="repeat the bring-up over the log")
    ] = False,
    frames: Annotated[
        int | None,
        typer.Option(
            min=1, max=4096, help="frames in the bring-up's bursts; as in the log when absent"
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Print the transactions of a log with register names, or repeat the bring-up over it."""
    from cosim import InputError
    from rtl_model.host import ReplayPort, default_map, is_pty

    if frames is not None and not judge:
        raise InputError("--frames", "given with --bringup", "without", "add --bringup")
    port = ReplayPort(log)  # refuses a file that is not a log
    known = known_map(csr)
    if judge:
        if port.over_udp:
            raise InputError(
                "the log of --bringup", "one of a serial line", f"{log}, of packets over UDP",
                "leave out --bringup: repeated packets depend on time, which a log cannot replay",
            )  # fmt: skip
        from rtl_model.bringup.run import BringUp, bring_up

        simulated = is_pty(port.logged_port) if port.simulated is None else port.simulated
        options = BringUp(
            baud=port.baud, csr=known, simulated=simulated, time_scale=port.time_scale or 1.0,
            frames=frames or port.frames or 8,
        )  # fmt: skip
        report = bring_up(port, options, (lambda stage: None) if json else print_stage)
        if json:
            print_document(report.document())
        elif not report.ok:
            tell(f"not passed: {report.cause}")
        if not report.ok:
            raise typer.Exit(1)
        return
    names = {entry.address: name for name, entry in (known or default_map()).registers.items()}
    rows = [{**event.model_dump(), "text": _text(event, names)} for event in port.events]
    faults = sum(row.get("fault") is not None for row in rows)
    if json:
        print_document({"ok": True, "events": rows, "faults": faults})
        return
    begun = rows[0]["monotonic"]
    for row in rows:
        tell(f"{row['monotonic'] - begun:10.6f} s  {row['text']}")
    end = ", the last line is cut off" if port.cut else ""
    tell(f"{len(rows)} events, {faults} answers with a fault{end}")


def _text(event: LogEvent, names: dict[int, str]) -> str:
    """The event in one line."""
    from rtl_model.host.replay import Answer, Datagram, Opened, Request, Stray

    if isinstance(event, Request):
        name = names.get(int(event.address, 0), event.address)
        written = f" = {_words(bytes.fromhex(event.hex)[6:])}"
        access = f"reads {name}" if event.command.startswith("read") else f"writes {name}{written}"
        return access + (f", {event.words} words" if event.words > 1 else "")
    if isinstance(event, Answer):
        fault = f", FAULT {event.fault}" if event.fault else ""
        return f"  answer {_words(bytes.fromhex(event.hex))}{fault}"
    if isinstance(event, Stray):
        return f"  stray {event.hex}"
    if isinstance(event, Opened):
        rate = "" if event.baud is None else f" at {event.baud} baud"
        return f"{event.port}{rate}, {event.wall}"
    if isinstance(event, Datagram):
        return f"{event}: {_packet(bytes.fromhex(event.hex), names)}"
    return f"{event.event} {event.value}"


def _packet(data: bytes, names: dict[int, str]) -> str:
    """The accesses of an Etherbone packet."""
    from rtl_model.host.ether import Malformed, parse

    try:
        packet = parse(data)
    except Malformed as exc:
        return f"not understood ({exc})"
    if packet.probe or packet.reply:
        return "reply to a probe" if packet.reply else "probe"
    parts = []
    for record in packet.records:
        if record.written.size:
            words = record.written.tobytes()
            at = record.write_address
            parts.append(f"writes {names.get(at, f'{at:#x}')} = {_words(words)}")
        if record.reads.size:
            at, count = int(record.reads[0]), record.reads.size
            more = f", {count} words" if count > 1 else ""
            parts.append(f"reads {names.get(at, f'{at:#x}')}{more}")
    return "; ".join(parts) or "nothing"


def _words(data: bytes) -> str:
    if not data:
        return "nothing"
    words = [data[n : n + 4].hex() for n in range(0, len(data), 4)]
    return " ".join(words[:_PRINTED]) + (f" .. ({len(words)})" if len(words) > _PRINTED else "")
