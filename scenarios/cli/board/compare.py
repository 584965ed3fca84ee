"""`viform board compare`: a board, or its Verilog, against the cycle model bit by bit."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.board.line import (
    Baud,
    Csr,
    Faults,
    Level,
    Log,
    LowLatency,
    PortName,
    TimeScale,
    connected,
)
from scenarios.cli.output import Json, make_progress, print_document

__all__ = ["board_compare"]


def board_compare(
    port: PortName = "virtual",
    baud: Baud = 115_200,
    csr: Csr = None,
    frames: Annotated[int, typer.Option(min=1, help="to capture and compare")] = 8,
    assignments: Annotated[
        list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="registers, before")
    ] = None,
    log: Log = None,
    time_scale: TimeScale = None,
    low_latency: LowLatency = False,
    level: Level = "bytes",
    fault: Faults = None,
    lockstep: Annotated[
        bool,
        typer.Option("--lockstep", help="the Verilog in Verilator, clock by clock; no port"),
    ] = False,
    rows: Annotated[int, typer.Option(min=1, max=4095, help="of --lockstep")] = 32,
    columns: Annotated[int, typer.Option(min=1, max=4096, help="of --lockstep")] = 32,
    lanes: Annotated[int, typer.Option(help="of --lockstep, 32 or 64")] = 32,
    seed: Annotated[int, typer.Option(min=0, help="of --lockstep's random program")] = 1,
    pixels: Annotated[float, typer.Option(min=1, help="pixel-cycles of --lockstep")] = 1e7,
    until: Annotated[int | None, typer.Option(min=1, help="clock at which --lockstep ends")] = None,
    trace: Annotated[
        Path | None, typer.Option(help="of --lockstep: waveforms about a difference, .fst or .vcd")
    ] = None,
    sources: Annotated[
        Path | None, typer.Option(help="of --lockstep: a folder of Verilog; ours when absent")
    ] = None,
    json: Json = False,
) -> None:
    """Hold a board's bits against the cycle model under its settings; exit 1 with the first wrong
    bit's frame, row and column. --lockstep holds the Verilog against it, clock by clock."""
    from cosim import InputError

    if lockstep:
        if port != "virtual" or fault or assignments or log is not None:
            raise InputError(
                "--port, --fault, --set and --log", "left out with --lockstep", "given",
                "leave them out: --lockstep runs the Verilog itself; for a board leave out "
                "--lockstep",
            )  # fmt: skip
        _lockstep(rows, columns, lanes, seed, pixels, until, trace, sources, json)
        return
    if trace is not None or sources is not None or until is not None:
        raise InputError(
            "--trace, --sources and --until", "given with --lockstep", "without", "add --lockstep"
        )
    from rtl_model.bringup.bench.frames import capture_and_compare
    from scenarios.cli.board.regs import assignment

    writes = [assignment(text) for text in assignments or ()]
    with connected(
        port, baud, csr, log, time_scale, json, level=level, faults=fault, low_latency=low_latency
    ) as line:
        for name, value in writes:
            line.board.write(name, value)
        taken, burst = capture_and_compare(line.board, frames)
    wrong = burst.wrong
    if json:
        print_document({
            "ok": wrong is None, "frames": frames, "bits_compared": burst.got.size,
            "bits_wrong": 0 if wrong is None else wrong.bits,
            "first_wrong": None if wrong is None else wrong.document(),
            "settings": taken.settings, "retries": taken.retries,
        })  # fmt: skip
    elif wrong is None:
        print(f"{frames} frames, {burst.got.size} bits, none wrong")
    else:
        print(f"{wrong.text}; {wrong.mend}")
    if wrong is not None:
        raise typer.Exit(1)


def _lockstep(
    rows: int, columns: int, lanes: int, seed: int, pixels: float, until: int | None,
    trace: Path | None, sources: Path | None, json: bool,
) -> None:  # fmt: skip
    from cosim import InputError
    from cosim.run.folder import check_trace_file
    from rtl_model.lockstep import Program, run
    from rtl_model.verilated import BuildFailed

    if lanes not in (32, 64):
        raise InputError("--lanes", "32 or 64", str(lanes), "choose one")
    if trace is not None:  # it is written at the end alone, where a difference was found
        check_trace_file(trace)
    program = Program(rows, columns, lanes, seed)
    progress = make_progress()
    progress.start("pixel-cycles", int(pixels))
    try:
        outcome = run(
            program, pixels=float("inf") if until is not None else pixels, until=until,
            sources=sources, waves=trace,
            progress=lambda clock, done: progress.advance(done),
        )  # fmt: skip
    except BuildFailed as fault:
        if sources is None:  # the design's own: a fault of ours
            raise
        kept = "" if fault.kept is None else f" (all that {fault.tool} said: {fault.kept})"
        raise InputError(
            f"--sources {sources}", "Verilog that compiles", f"refused: {fault.first}",
            f"mend that line{kept}",
        ) from fault  # fmt: skip
    finally:
        progress.close()
    found = outcome.difference
    if json:
        print_document({
            "ok": found is None, "clocks": outcome.clock, "pixel_cycles": outcome.pixels,
            "spikes": outcome.coverage.spikes, "seed": seed,
            "difference": None if found is None else {
                "text": str(found), "what": found.what, "clock": found.clock,
                "frame": found.frame, "row": found.row, "column": found.column,
                "verilog": found.verilog, "model": found.model,
                "reproducer": found.reproducer,
                "waves": None if found.waves is None else str(found.waves),
            },
        })  # fmt: skip
    elif found is None:
        print(f"{outcome.pixels} pixel-cycles in {outcome.clock} clocks, no difference")
        if trace is not None:
            print(f"without one there are no waveforms: {trace} was not written")
    else:
        print(found)
    if found is not None:
        raise typer.Exit(1)
