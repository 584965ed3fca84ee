"""Opening of a board by its address, `serial:PORT[,BAUD]`; PORT is a URL of pyserial or `virtual`.

The simulator is only imported for a virtual board.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, NamedTuple

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.host import Board, BoardInfo, LineFault, Port, Uartbone, open_port
from rtl_model.host.uartbone import PATIENCE_S, SIMULATED_PATIENCE_S

__all__ = ["DEFAULT_BAUD", "OpenBoard", "open_board", "parse_address"]

DEFAULT_BAUD: Final = Geometry().baud
_VIRTUAL: Final = "virtual"
_VIRTUAL_BAUD: Final = 3_000_000
"""Baud of a virtual board, which determines the duration of a step (see `stepping`)."""


class OpenBoard(NamedTuple):
    """An open board.

    Attributes:
        board: its registers.
        info: its size and build.
        name: for messages.
        line_baud: baud of the line.
    """

    board: Board
    info: BoardInfo
    name: str
    line_baud: int


def parse_address(address: str, key: str) -> tuple[str, int]:
    """Port and baud of `serial:PORT[,BAUD]`.

    Args:
        address: the text.
        key: of the scenario, for messages.

    Raises:
        InputError: for another text.
    """
    kind, _, port = address.partition(":")
    port, comma, baud = port.partition(",")
    right = kind == "serial" and port and (not comma or (baud.isdecimal() and int(baud) > 0))
    if not right:
        raise InputError(
            key,
            "serial:PORT or serial:PORT,BAUD, with PORT a device, a URL of pyserial or virtual, "
            "and BAUD a positive integer",
            repr(address), "write it like serial:virtual or serial:/dev/ttyUSB0,115200",
        )  # fmt: skip
    return port, int(baud) if baud else DEFAULT_BAUD


@contextmanager
def open_board(address: str, key: str, virtual: Geometry | None = None) -> Iterator[OpenBoard]:
    """Opens the board at an address, and closes it at the end of the context.

    A fault of the line, at the start or during use, raises InputError.

    Args:
        address: `serial:PORT[,BAUD]`.
        key: of the scenario, for messages.
        virtual: geometry of a virtual board, which is the cycle model; the default one if None.
    """
    port, baud = parse_address(address, key)
    try:
        if port == _VIRTUAL:
            from rtl_model.virtual import VirtualBoard

            geometry = (virtual or Geometry())._replace(baud=_VIRTUAL_BAUD)
            with VirtualBoard(geometry, level="model") as simulated:
                opened = open_port(simulated.port, _VIRTUAL_BAUD)
                yield from _connected(
                    opened, "the virtual board", simulated.time_scale, SIMULATED_PATIENCE_S
                )
        else:
            yield from _connected(open_port(port, baud), f"the board at {port}", 1.0, PATIENCE_S)
    except LineFault as fault:
        raise InputError(
            f"the board of {key}", "one that answers without a fault", f"at fault: {fault.text}",
            fault.advice,
        ) from fault  # fmt: skip


def _connected(port: Port, name: str, time_scale: float, patience_s: float) -> Iterator[OpenBoard]:
    try:
        bone = Uartbone(port, time_scale=time_scale, patience_s=patience_s)
        bone.resynchronise()
        board = Board(bone)
        yield OpenBoard(board, board.info(), name, port.baud)
    finally:
        port.close()
