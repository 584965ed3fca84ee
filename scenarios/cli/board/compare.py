"""Comparisons with the cycle model, bit by bit: of a board or its Verilog (`viform board compare`),
and of the Verilog of a source and its stream (`stream`)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from cosim.run.shown import SilentProgress, make_progress
from scenarios.cli.board.connection import BoardOptions, connect
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell

if TYPE_CHECKING:
    from rtl_model.stream.program import Case


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
    from scenarios.cli.board.line import assignment

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


@dataclass(frozen=True)
class StreamOptions:
    """Options of the build and its inputs."""

    rows: Annotated[int, typer.Option(min=1, max=4095, help="rows of pixels")] = 32
    columns: Annotated[int, typer.Option(min=1, max=4096, help="columns of pixels")] = 32
    lanes: Annotated[int, typer.Option(help="pixels of a tile, 32 or 64")] = 32
    depth: Annotated[int, typer.Option(help="depth of the ring buffer, beats, a power of two")] = 64
    pixels: Annotated[
        int | None, typer.Option(help="external: of a memory word, 1, 2, 4 (when absent) or 8")
    ] = None
    latency: Annotated[
        int | None, typer.Option(min=1, max=1000, help="external: clocks of a read, 5 when absent")
    ] = None
    clocks: Annotated[int, typer.Option(min=1, max=10**7, help="clocks to compare at least")] = (
        50_000
    )
    seed: Annotated[int, typer.Option(min=0, help="seed of the random inputs")] = 1


@expand_options
def board_stream(
    source: Annotated[
        Literal["array", "external", "lines"],
        typer.Argument(
            metavar="SOURCE",
            help="array: pixels in the FPGA; external: with an external memory; lines: a sensor's "
            "data lanes",
        ),
    ],
    options: StreamOptions,
    sources: Annotated[
        Path | None, typer.Option(help="a folder of Verilog; the design's when absent")
    ] = None,
    json: Json = False,
) -> None:
    """Compare the Verilog of a source and its AXI4-Stream with the cycle model, at every clock,
    under random back-pressure, settings and faults of the lanes. Exit 1 at a difference."""
    from cosim import InputError
    from rtl_model.stream.lockstep import beats, run
    from rtl_model.stream.program import Case
    from rtl_model.verilated import BuildFailed

    given = {name: value for name, value in asdict(options).items() if value is not None}
    _check(case := Case(source, **given), given)
    SilentProgress().note(f"comparing {options.clocks} clocks of viform_stream_{source}")
    try:
        outcome = run(case, sources=sources)
    except BuildFailed as fault:
        if sources is None:  # a fault of the project's Verilog, not of the input
            raise
        raise InputError(
            f"--sources {sources}", "Verilog that compiles", f"refused: {fault.first}",
            "correct that line",
        ) from fault  # fmt: skip
    last = outcome.outputs[-1]
    moved = len(beats(case, outcome.outputs))
    difference = outcome.difference
    if json:
        names = ("clock", "output", "verilog", "model")
        print_document({
            "ok": difference is None, "source": source, **_build(case),
            "compared": outcome.clocks, "beats": moved, "lost_planes": int(last[4]),
            "lost_rows": int(last[5]),
            "difference": None if difference is None else dict(zip(names, difference, strict=True)),
        })  # fmt: skip
    elif difference is None:
        tell(
            f"{outcome.clocks} clocks, {moved} beats, {last[5]} rows of {last[4]} planes lost to a "
            "full ring, no difference"
        )
    else:
        clock, output, verilog, model = difference
        tell(f"clock {clock}: {output} is {verilog} in the Verilog, {model} in the model")
    if difference is not None:
        raise typer.Exit(1)


def _build(case: Case) -> dict[str, object]:
    """The options of the document; those of another source are None."""
    values = asdict(case)
    foreign = () if case.source == "external" else ("pixels", "latency")
    names = StreamOptions.__dataclass_fields__
    return {name: None if name in foreign else values[name] for name in names}


def _check(case: Case, given: Collection[str]) -> None:
    """Refuses what the Verilog does not support, and options of another source."""
    from cosim import InputError

    if case.source != "external" and {"pixels", "latency"} & set(given):
        raise InputError(
            "--pixels and --latency", "given with external", f"with {case.source}",
            "leave them out",
        )  # fmt: skip
    if case.lanes not in (32, 64):
        raise InputError("--lanes", "32 or 64", str(case.lanes), "choose one")
    if case.pixels not in (1, 2, 4, 8):
        raise InputError("--pixels", "1, 2, 4 or 8", str(case.pixels), "choose one")
    least = case.geometry.tiles + 1
    if case.depth < least or case.depth & (case.depth - 1):
        raise InputError(
            "--depth", f"a power of two of at least {least}, which holds a row", str(case.depth),
            f"take {1 << (least - 1).bit_length()}",
        )  # fmt: skip
