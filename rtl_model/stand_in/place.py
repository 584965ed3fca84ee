"""Where a board is: `serial:PORT`, PORT being any URL of pyserial or `virtual`, with `,BAUD`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, NamedTuple

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.host import Board, BoardInfo, LineFault, Port, Uartbone, open_port
from rtl_model.host.uartbone import PATIENCE_S, SIMULATED_PATIENCE_S

__all__ = ["DEFAULT_BAUD", "StandIn", "parse_place", "stand_in"]

DEFAULT_BAUD: Final = Geometry().baud
_VIRTUAL: Final = "virtual"
_VIRTUAL_BAUD: Final = 3_000_000
"""Of a virtual board: how long it takes a step for (see `stepping`)."""


class StandIn(NamedTuple):
    """An open board. name: as a user knows it. line_baud: of the line."""

    board: Board
    info: BoardInfo
    name: str
    line_baud: int


def parse_place(place: str, key: str) -> tuple[str, int]:
    """Port and baud of `serial:PORT[,BAUD]`. key: of the scenario, for the InputError that any
    other text raises."""
    kind, _, port = place.partition(":")
    port, comma, baud = port.partition(",")
    right = kind == "serial" and port and (not comma or (baud.isdecimal() and int(baud) > 0))
    if not right:
        raise InputError(
            key,
            "serial:PORT or serial:PORT,BAUD, PORT a device, a URL of pyserial or virtual, BAUD a "
            "whole number above 0",
            repr(place), "write it like serial:virtual or serial:/dev/ttyUSB0,115200",
        )  # fmt: skip
    return port, int(baud) if baud else DEFAULT_BAUD


@contextmanager
def stand_in(place: str, key: str, virtual: Geometry | None = None) -> Iterator[StandIn]:
    """Opens the board that stands at `place`. virtual: geometry of a virtual one, the table's own
    unless given; it is the cycle model, which needs no Verilator.

    What goes wrong with the line, at the start or while the board is used, ends as one InputError.
    """
    port, baud = parse_place(place, key)
    try:
        if port == _VIRTUAL:
            from rtl_model.virtual import VirtualBoard

            geometry = (virtual or Geometry())._replace(baud=_VIRTUAL_BAUD)
            with VirtualBoard(geometry, level="model") as made:
                opened = open_port(made.port, _VIRTUAL_BAUD)
                yield from _used(opened, "the virtual board", made.time_scale, SIMULATED_PATIENCE_S)
        else:
            yield from _used(open_port(port, baud), f"the board at {port}", 1.0, PATIENCE_S)
    except LineFault as fault:
        raise InputError(
            f"the board of {key}", "one that answers without a fault", f"at fault: {fault.text}",
            fault.advice,
        ) from fault  # fmt: skip


def _used(port: Port, name: str, time_scale: float, patience_s: float) -> Iterator[StandIn]:
    try:
        bone = Uartbone(port, time_scale=time_scale, patience_s=patience_s)
        bone.resynchronise()
        board = Board(bone)
        yield StandIn(board, board.info(), name, port.baud)
    finally:
        port.close()
