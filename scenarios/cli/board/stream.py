"""`viform board stream`: compares the Verilog of a source and its stream with the cycle model."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from cosim.run.shown import SilentProgress
from scenarios.cli.options import expand_options
from scenarios.cli.output import Json, print_document, tell

if TYPE_CHECKING:
    from rtl_model.stream.program import Case


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
