"""`viform board replay`: prints or replays a log of the line without the board."""

from __future__ import annotations

import json as json_module
from pathlib import Path
from typing import Annotated, Any

import typer

from rtl_model.bringup.bench.endpoint import csr_map
from scenarios.cli.board.connection import Csr
from scenarios.cli.output import Json, print_document

__all__ = ["board_replay"]

_PRINTED = 4  # most words of a transaction that are printed


def board_replay(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="file written with --log")],
    csr: Csr = None,
    judge: Annotated[
        bool, typer.Option("--bringup", help="repeat the bring-up over the log")
    ] = False,
    frames: Annotated[
        int | None,
        typer.Option(min=1, max=4096, help="in the bring-up's bursts; as in the log when absent"),
    ] = None,
    json: Json = False,
) -> None:
    """Print the transactions of a log with register names, or repeat the bring-up over it."""
    from rtl_model.host import ReplayPort, default_map, is_pty

    port = ReplayPort(log)  # refuses a file that is not a log
    known = csr_map(csr)
    if judge:
        from rtl_model.bringup.run import BringUp, bring_up
        from scenarios.cli.board.bringup import print_stage

        simulated = is_pty(port.logged_port) if port.simulated is None else port.simulated
        options = BringUp(
            baud=port.baud, csr=known, simulated=simulated, time_scale=port.time_scale or 1.0,
            frames=frames or port.frames or 8,
        )  # fmt: skip
        report = bring_up(port, options, (lambda stage: None) if json else print_stage)
        if json:
            print_document(report.document())
        elif not report.ok:
            print(f"not passed: {report.cause}")
        if not report.ok:
            raise typer.Exit(1)
        return
    names = {entry.address: name for name, entry in (known or default_map()).registers.items()}
    rows = [
        _row(json_module.loads(line), names)
        for line in log.read_text(encoding="ascii").splitlines()
    ]
    faults = sum(row.get("fault") is not None for row in rows)
    if json:
        print_document({"ok": True, "events": rows, "faults": faults})
        return
    begun = rows[0]["monotonic"]
    for row in rows:
        print(f"{row['monotonic'] - begun:10.6f} s  {row['text']}")
    print(f"{len(rows)} events, {faults} answers with a fault")


def _row(event: dict[str, Any], names: dict[int, str]) -> dict[str, Any]:
    """The event with its description in one line."""
    kind = event["event"]
    if kind == "write":
        address = int(event["address"], 0)
        name = names.get(address, event["address"])
        words = event["words"]
        data = bytes.fromhex(event["hex"])[6:]
        reads = event["command"].startswith("read")
        access = f"reads {name}" if reads else f"writes {name} = {_words(data)}"
        text = access + (f", {words} words" if words > 1 else "")
    elif kind == "read":
        text = f"  answer {_words(bytes.fromhex(event['hex']))}"
        text += f", FAULT {event['fault']}" if event["fault"] else ""
    elif kind == "stray":
        text = f"  stray {event['hex']}"
    elif kind == "open":
        text = f"{event['port']} at {event['baud']} baud, {event['wall']}"
    else:
        text = f"{kind} {event['value']}"
    return {**event, "text": text}


def _words(data: bytes) -> str:
    if not data:
        return "nothing"
    words = [data[n : n + 4].hex() for n in range(0, len(data), 4)]
    return " ".join(words[:_PRINTED]) + (f" .. ({len(words)})" if len(words) > _PRINTED else "")
