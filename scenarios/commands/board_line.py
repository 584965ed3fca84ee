"""What the commands of `viform board` share: their options, the board behind a port, and how a
fault of the line ends a command."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenarios.commands.output import print_document

if TYPE_CHECKING:
    from rtl_model.geometry import Geometry
    from rtl_model.host import Board, CsrMap
    from rtl_model.virtual import VirtualBoard

__all__ = [
    "VIRTUAL", "Baud", "Csr", "Faults", "Level", "Line", "Log", "Opened", "PortName", "TimeScale",
    "connected", "failed_line", "opened", "virtual_board",
]  # fmt: skip

VIRTUAL = "virtual"
"""The port that stands for a board in a simulator, started for the command."""

PortName = Annotated[
    str,
    typer.Option("--port", help="a device, any URL of pyserial, or `virtual`: one is started"),
]
Baud = Annotated[int, typer.Option(help="of the line")]
Csr = Annotated[
    Path | None, typer.Option(help="csr.csv of the design that is loaded; ours when absent")
]
Log = Annotated[Path | None, typer.Option(help="written: every transaction, with its time")]
TimeScale = Annotated[
    float | None,
    typer.Option(help="seconds of ours to a second of a simulated board's clock"),
]
Level = Annotated[str, typer.Option(help="of --port virtual: bytes, pins, or model (no Verilator)")]
Faults = Annotated[
    list[str] | None,
    typer.Option("--fault", help="of --port virtual; see `viform board virtual --help`"),
]


@dataclass(frozen=True)
class Opened:
    """A port that can be opened: a real one, or a virtual board's that runs."""

    url: str
    baud: int
    simulated: bool | None
    time_scale: float


@dataclass(frozen=True)
class Line:
    """A board that is spoken to."""

    board: Board
    opened: Opened


def virtual_board(
    *,
    baud: int,
    level: str = "bytes",
    faults: list[str] | None = None,
    geometry: Geometry | None = None,
) -> VirtualBoard:
    """A virtual board, not yet begun. InputError for a level or a fault that is none."""
    from cosim import InputError
    from rtl_model.geometry import Geometry
    from rtl_model.virtual import LEVELS, VirtualBoard, nominal_clock

    known = next((name for name in LEVELS if name == level), None)
    if known is None:
        raise InputError("--level", "one of " + ", ".join(LEVELS), repr(level), "choose one")
    size = geometry or Geometry(clock_hz=nominal_clock(known, baud), baud=baud)
    if size.bit_clocks < 4:
        must = f"at most a quarter of the virtual board's clock, {size.clock_hz // 4}"
        raise InputError("--baud", must, str(baud), "lower it")
    return VirtualBoard(size, level=known, faults=faults or ())


@contextmanager
def opened(
    port: str,
    baud: int,
    time_scale: float | None,
    *,
    level: str = "bytes",
    faults: list[str] | None = None,
    geometry: Geometry | None = None,
) -> Iterator[Opened]:
    """What to open for `--port`; a virtual board lives as long as the block."""
    from cosim import InputError

    if time_scale is not None and not 0 < time_scale < 1e6:
        raise InputError("--time-scale", "above 0", str(time_scale), "1 is a real board's")
    if baud <= 0:
        raise InputError("--baud", "above 0", str(baud), "115200 is common")
    if port != VIRTUAL:
        if faults or level != "bytes":
            raise InputError(
                "--fault and --level", "given with --port virtual", f"with {port}", "leave them out"
            )
        yield Opened(port, baud, None, time_scale or 1.0)
        return
    with virtual_board(baud=baud, level=level, faults=faults, geometry=geometry) as board:
        yield Opened(board.port, baud, True, time_scale or board.time_scale)


def csr_of(csr: Path | None) -> CsrMap | None:
    """The map of `--csr`, None for our own. InputError for a file that is none."""
    from rtl_model.host import read_csr

    return None if csr is None else read_csr(csr)


@contextmanager
def connected(
    port: str,
    baud: int,
    csr: Path | None,
    log: Path | None,
    time_scale: float | None,
    json: bool,
    **virtual: Any,
) -> Iterator[Line]:
    """A board to speak to. A fault of the line ends the command with exit 1 and its cause: a line
    on standard error, or the document."""
    from rtl_model.host import Board, LineFault, Recorder, Uartbone, open_port

    known = csr_of(csr)
    with ExitStack() as stack:
        try:
            place = stack.enter_context(opened(port, baud, time_scale, **virtual))
            raw = open_port(place.url, baud)
            stack.callback(raw.close)
            recorder = None if log is None else stack.enter_context(Recorder(log, raw))
            bone = Uartbone(raw, baud=baud, time_scale=place.time_scale, log=recorder)
            yield Line(Board(bone, known), place)
        except LineFault as fault:
            raise failed_line(fault, json) from None


def failed_line(fault: Any, json: bool) -> typer.Exit:
    """Tells a LineFault, and returns what ends the command."""
    import sys

    if json:
        print_document({"ok": False, "kind": fault.cause.value, "cause": str(fault)})
    else:
        print(f"viform: {fault}", file=sys.stderr)
    return typer.Exit(1)
