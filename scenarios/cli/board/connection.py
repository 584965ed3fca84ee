"""Options of the line and connection to a board, shared by the commands of `viform board`.

The host is imported in the functions that need it, so that `--help` starts quickly.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from cosim.errors import say
from rtl_model.bringup.bench.endpoint import VIRTUAL, Endpoint, csr_map, open_endpoint
from scenarios.cli.output import print_document

if TYPE_CHECKING:
    from rtl_model.host import Board, CsrMap, LineFault

Csr = Annotated[
    Path | None, typer.Option(help="csr.csv of the loaded design; the Viform board's when absent")
]


@dataclass(frozen=True)
class LineOptions:
    """Options of the line to a board."""

    port: Annotated[
        str,
        typer.Option(
            help="a device, any URL of pyserial, udp:HOST[:PORT] for Etherbone, or `virtual` to "
            "start a board"
        ),
    ] = VIRTUAL
    baud: Annotated[
        int | None, typer.Option(help="baud of a serial line", show_default="115200")
    ] = None
    csr: Csr = None
    log: Annotated[
        Path | None, typer.Option(help="file to write: every transaction with its time")
    ] = None
    time_scale: Annotated[
        float | None,
        typer.Option(help="seconds of host time to a second of a simulated board's clock"),
    ] = None
    simulated: Annotated[
        bool | None,
        typer.Option(
            "--simulated/--real",
            help="what is behind the port; by default a simulated board behind a pty or a loopback "
            "address only",
        ),
    ] = None
    low_latency: Annotated[
        bool,
        typer.Option("--low-latency", help="set an FTDI adapter's driver to its low-latency mode"),
    ] = False
    dtr: Annotated[
        Literal["on", "off"] | None,
        typer.Option(help="line DTR of a serial port, which resets some boards", show_default="on"),
    ] = None
    rts: Annotated[
        Literal["on", "off"] | None,
        typer.Option(help="line RTS of a serial port, likewise", show_default="on"),
    ] = None
    force: Annotated[
        bool,
        typer.Option(
            "--force", help="write even if another design than the register map's answers"
        ),
    ] = False


@dataclass(frozen=True)
class BoardOptions(LineOptions):
    """Options of the line, and of a virtual board behind it."""

    level: Annotated[
        str, typer.Option(help="level of --port virtual: bytes, pins, or model (no Verilator)")
    ] = "bytes"
    fault: Annotated[
        list[str] | None,
        typer.Option("--fault", help="fault of --port virtual; see `viform board virtual --help`"),
    ] = None


@dataclass(frozen=True)
class Connection:
    """A board that answers.

    Attributes:
        board: its registers.
        url: URL of the port.
        baud: baud of a serial line, None over UDP.
    """

    board: Board
    url: str
    baud: int | None


def endpoint_of(options: LineOptions) -> Any:
    """The context that opens the endpoint of the options."""
    from cosim import InputError
    from rtl_model.host.ether import is_udp

    if is_udp(options.port) and options.low_latency:
        raise InputError(
            "--low-latency", "given with a serial port", f"with {options.port}", "leave it out"
        )
    virtual: dict[str, Any] = {"simulated": options.simulated}
    virtual |= {"dtr": options.dtr, "rts": options.rts}
    if isinstance(options, BoardOptions):
        virtual |= {"level": options.level, "faults": options.fault}
    return open_endpoint(options.port, options.baud, options.time_scale, **virtual)


@contextmanager
def connect(
    options: LineOptions, json: bool, *, recognise: bool = False, confirm: bool = True
) -> Iterator[Connection]:
    """Connects to a board, whose design must match the register map.

    A fault of the line ends the command with exit 1 and its cause: a line on standard error, or
    the document.

    Args:
        options: options of the line.
        json: whether the command prints a document.
        recognise: whether, without a csr.csv, the first register decides between the Viform board
            and an imager.
        confirm: whether the design is checked before the command begins, unless --force is set.
    """
    from imagers.catalogue import IMAGERS
    from rtl_model.host import Board, LineFault, opened_bone, recognised
    from rtl_model.host.ether import is_udp

    known = known_map(options.csr)
    with ExitStack() as stack:
        try:
            endpoint: Endpoint = stack.enter_context(endpoint_of(options))
            opened = opened_bone(
                endpoint.url, endpoint.baud, simulated=endpoint.simulated,
                time_scale=endpoint.time_scale, log=options.log, low_latency=options.low_latency,
                lines=endpoint.lines,
            )  # fmt: skip
            bone, granted = stack.enter_context(opened)
            if options.low_latency and not granted:
                warn_of_latency(endpoint.url)
            if recognise and known is None and options.port != VIRTUAL:
                known = recognised(bone, IMAGERS)
            board = Board(bone, known, devices=IMAGERS)
            if confirm and not options.force:
                board.confirm()
            yield Connection(board, endpoint.url, None if is_udp(endpoint.url) else endpoint.baud)
        except LineFault as fault:
            raise _failed(fault, json) from None


def known_map(csr: Path | None) -> CsrMap | None:
    """The register map of a csr.csv file, with what is known of the imagers; None without a file.

    Raises InputError for a file that is not a csr.csv.
    """
    if csr is None:
        return None
    from imagers.catalogue import IMAGERS

    return csr_map(csr, IMAGERS)


def warn_of_latency(port: str) -> None:
    """Prints on standard error that a port has no low-latency mode; the command continues."""
    say(f"{port} has no low-latency mode, like all ptys and sockets; continuing without it")


def _failed(fault: LineFault, json: bool) -> typer.Exit:
    """Prints a fault of the line; returns the exception that ends the command."""
    if json:
        print_document({"ok": False, "kind": fault.cause.value, "cause": str(fault)})
    else:
        say(str(fault))
    return typer.Exit(1)
