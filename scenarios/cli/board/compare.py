"""`viform board compare`: compares a board, or its Verilog, bit by bit with the cycle model."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

import typer

from cosim.run.shown import make_progress
from scenarios.cli.board.connection import BoardOptions, connect
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell


@dataclass(frozen=True)
class LockstepOptions:
    """Options of --lockstep."""

    rows: Annotated[int, typer.Option(min=1, max=4095, help="rows of --lockstep, pixels")] = 32
    columns: Annotated[int, typer.Option(min=1, max=4096, help="columns of --lockstep, pixels")] = (
        32
    )
    lanes: Annotated[int, typer.Option(help="lanes of --lockstep, 32 or 64")] = 32
    seed: Annotated[int, typer.Option(min=0, help="seed of --lockstep's random program")] = 1
    pixels: Annotated[float, typer.Option(min=1, help="pixel-cycles of --lockstep")] = 1e7
    until: Annotated[int | None, typer.Option(min=1, help="clock at which --lockstep ends")] = None
    trace: Annotated[
        Path | None, typer.Option(help="waveforms of --lockstep around a difference, .fst or .vcd")
    ] = None
    sources: Annotated[
        Path | None,
        typer.Option(help="folder of Verilog for --lockstep; the design's when absent"),
    ] = None


@expand_options
def board_compare(
    options: BoardOptions,
    verilog: LockstepOptions,
    frames: Annotated[
        int | None, typer.Option(min=1, help="frames to capture and compare", show_default="8")
    ] = None,
    levels: Annotated[
        int | None,
        typer.Option(help="then also read and compare the charges, in so many levels up to 128"),
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="register to write before"),
    ] = None,
    lockstep: Annotated[
        bool,
        typer.Option(
            "--lockstep", help="compare the Verilog in Verilator, clock by clock, without a port"
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Compare a board's bits with the cycle model under the board's settings. Exit 1 with frame,
    row and column of the first wrong bit. --lockstep compares the Verilog, clock by clock."""
    from cosim import InputError

    if lockstep:
        if options != BoardOptions() or assignments or frames is not None or levels is not None:
            raise InputError(
                "--frames, --levels, --set and the options of the line", "left out with --lockstep",
                "given", "leave them out, because --lockstep runs the Verilog; for a board leave "
                "out --lockstep",
            )  # fmt: skip
        _lockstep(verilog, json)
        return
    if verilog != LockstepOptions():
        raise InputError(
            ", ".join(f"--{field.name}" for field in fields(verilog)), "given with --lockstep",
            "without", "leave them out, because a board has its own size, or add --lockstep",
        )  # fmt: skip
    frames = 8 if frames is None else frames
    from rtl_model.bringup.bench.frames import capture_and_compare, read_and_compare
    from rtl_model.host import check_levels
    from scenarios.cli.board.regs import assignment

    if levels is not None:
        check_levels(levels, "--levels")
    writes = [assignment(text) for text in assignments or ()]
    with connect(options, json) as connection:
        for name, value in writes:
            connection.board.write(name, value)
        captured, burst = capture_and_compare(connection.board, frames)
        levels_wrong = None
        if levels is not None:
            reading, expected = read_and_compare(connection.board, levels)
            levels_wrong = int((reading.level != expected).sum())
    wrong = burst.wrong
    ok = wrong is None and not levels_wrong
    if json:
        print_document({
            "ok": ok, "frames": frames, "bits_compared": burst.got.size,
            "bits_wrong": 0 if wrong is None else wrong.bits,
            "first_wrong": None if wrong is None else wrong.document(),
            "settings": captured.settings, "retries": captured.retries,
            "levels": levels, "levels_wrong": levels_wrong,
        })  # fmt: skip
    elif wrong is None:
        tell(f"{frames} frames, {burst.got.size} bits, none wrong")
    else:
        tell(f"{wrong.text}; {wrong.remedy}")
    if levels_wrong is not None and not json:
        tell(
            f"{expected.size} charges in {levels} levels after {reading.frames} frames, "
            f"{levels_wrong or 'none'} wrong"
        )
    if not ok:
        raise typer.Exit(1)


def _lockstep(options: LockstepOptions, json: bool) -> None:
    from cosim import InputError
    from cosim.run.folder import check_trace_file
    from rtl_model.lockstep import Program, run
    from rtl_model.verilated import BuildFailed

    if options.lanes not in (32, 64):
        raise InputError("--lanes", "32 or 64", str(options.lanes), "choose one")
    if options.trace is not None:  # checked now, because it is written at the end only
        check_trace_file(options.trace)
    program = Program(options.rows, options.columns, options.lanes, options.seed)
    progress = make_progress()
    progress.start("pixel-cycles", int(options.pixels))
    try:
        outcome = run(
            program, pixels=options.pixels if options.until is None else float("inf"),
            until=options.until, sources=options.sources, waves=options.trace,
            progress=lambda clock, done: progress.advance(done),
        )  # fmt: skip
    except BuildFailed as fault:
        if options.sources is None:  # a fault of the project's Verilog, not of the input
            raise
        log = "" if fault.log is None else f" (output of {fault.tool}: {fault.log})"
        raise InputError(
            f"--sources {options.sources}", "Verilog that compiles", f"refused: {fault.first}",
            f"correct that line{log}",
        ) from fault  # fmt: skip
    finally:
        progress.close()
    difference = outcome.difference
    if json:
        print_document({
            "ok": difference is None, "clocks": outcome.clock, "pixel_cycles": outcome.pixels,
            "spikes": outcome.coverage.spikes, "seed": options.seed,
            "difference": None if difference is None else {
                "text": str(difference), "what": difference.what, "clock": difference.clock,
                "frame": difference.frame, "row": difference.row, "column": difference.column,
                "verilog": difference.verilog, "model": difference.model,
                "reproducer": difference.reproducer,
                "waves": None if difference.waves is None else str(difference.waves),
            },
        })  # fmt: skip
    elif difference is None:
        tell(f"{outcome.pixels} pixel-cycles in {outcome.clock} clocks, no difference")
        if options.trace is not None:
            tell(f"no waveforms without a difference: {options.trace} was not written")
    else:
        print(difference)
    if difference is not None:
        raise typer.Exit(1)
