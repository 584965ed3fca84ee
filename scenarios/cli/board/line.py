"""What the commands of `viform board` share: their options, a board to speak to, and how a fault of
the line ends a command."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from rtl_model.bringup.bench.endpoint import VIRTUAL, Endpoint, csr_map, open_endpoint
from scenarios.cli.output import print_document

if TYPE_CHECKING:
    from rtl_model.host import Board

__all__ = [
    "Baud", "Csr", "Faults", "Level", "Line", "Log", "LowLatency", "PortName", "TimeScale",
    "connected", "failed_line", "told_latency",
]  # fmt: skip

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
LowLatency = Annotated[
    bool,
    typer.Option("--low-latency", help="ask an FTDI adapter's driver to hand bytes on at once"),
]
Faults = Annotated[
    list[str] | None,
    typer.Option("--fault", help="of --port virtual; see `viform board virtual --help`"),
]


@dataclass(frozen=True)
class Line:
    """A board that is spoken to."""

    board: Board
    opened: Endpoint


@contextmanager
def connected(
    port: str,
    baud: int,
    csr: Path | None,
    log: Path | None,
    time_scale: float | None,
    json: bool,
    *,
    recognise: bool = False,
    low_latency: bool = False,
    **virtual: Any,
) -> Iterator[Line]:
    """A board to speak to. recognise: where no csr.csv is given, the board's first register says
    whether it is an imager of ours. low_latency: asked of the port's driver. A fault of the line
    ends the command with exit 1 and its cause: a line on standard error, or the document."""
    from rtl_model.host import Board, LineFault, Recorder, Uartbone, is_pty, open_port, recognised
    from rtl_model.host.uartbone import PATIENCE_S, SIMULATED_PATIENCE_S

    known = csr_map(csr)
    with ExitStack() as stack:
        try:
            place = stack.enter_context(open_endpoint(port, baud, time_scale, **virtual))
            raw = open_port(place.url, baud)
            stack.callback(raw.close)
            if low_latency:
                told_latency(place.url, raw.low_latency())
            scale = place.time_scale
            session = {"simulated": bool(place.simulated) or is_pty(place.url), "time_scale": scale}
            recorder = (
                None if log is None else stack.enter_context(Recorder(log, raw, session=session))
            )
            patience = SIMULATED_PATIENCE_S if place.simulated else PATIENCE_S
            bone = Uartbone(
                raw, baud=baud, time_scale=scale, patience_s=patience * max(1.0, scale),
                log=recorder,
            )  # fmt: skip
            if recognise and known is None and port != VIRTUAL:
                known = recognised(bone)
            yield Line(Board(bone, known), place)
        except LineFault as fault:
            raise failed_line(fault, json) from None


def told_latency(port: str, granted: bool) -> None:
    """Says on standard error where a port has no low-latency mode; the command goes on."""
    import sys

    if not granted:
        print(
            f"viform: {port} has no low-latency mode, as ptys and sockets have none; going on "
            "without",
            file=sys.stderr,
        )


def failed_line(fault: Any, json: bool) -> typer.Exit:
    """Tells a LineFault, and returns what ends the command."""
    import sys

    if json:
        print_document({"ok": False, "kind": fault.cause.value, "cause": str(fault)})
    else:
        print(f"viform: {fault}", file=sys.stderr)
    return typer.Exit(1)
