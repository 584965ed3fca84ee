"""Opening of a board by its address, `serial:PORT[,BAUD][,dtr=off][,rts=off]` or
`udp:HOST[:PORT]`.

PORT of a serial line is a device, a URL of pyserial, or `virtual`. The simulator is only imported
for a virtual board.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.host import Board, BoardInfo, LineFault, Lines, is_pty, opened_bone
from rtl_model.host.ether import is_loopback, is_udp, udp_address

_BAUD: Final = Geometry().baud
_VIRTUAL: Final = "virtual"
_VIRTUAL_BAUD: Final = 3_000_000
"""Baud of a virtual board, which determines the duration of a step (see `stepping`)."""


class OpenBoard(NamedTuple):
    """An open board.

    Attributes:
        board: its registers.
        info: its size and build.
        name: name for messages.
    """

    board: Board
    info: BoardInfo
    name: str


def parse_address(address: str, key: str) -> tuple[str, int, Lines]:
    """Name of the port, as `opened_bone` takes it, and baud and modem lines of a serial line.

    Args:
        address: `serial:PORT[,BAUD][,dtr=off][,rts=off]` or `udp:HOST[:PORT]`; the baud and lines
            of the latter have no meaning.
        key: key of the scenario, for messages.

    Raises:
        InputError: for another text.
    """
    if is_udp(address):
        if "," in address:
            raise InputError(
                key, "without a baud for a board over UDP", repr(address),
                f"write it like {address.partition(',')[0]}",
            )  # fmt: skip
        return udp_address(address).url, _BAUD, Lines()
    kind, _, port = address.partition(":")
    if kind == "serial" and is_udp(port):
        raise InputError(
            key, "udp:HOST[:PORT] for a board over UDP", repr(address), f"write it like {port}"
        )
    port, *words = port.split(",")
    baud = words.pop(0) if words and "=" not in words[0] else str(_BAUD)
    levels: dict[str, Any] = dict(word.partition("=")[::2] for word in words)
    right = (
        kind == "serial" and port and baud.isdecimal() and int(baud) > 0
        and len(levels) == len(words) and levels.keys() <= set(Lines._fields)
        and set(levels.values()) <= {"on", "off"}
    )  # fmt: skip
    if not right:
        raise InputError(
            key,
            "serial:PORT, serial:PORT,BAUD or udp:HOST[:PORT], with PORT of a serial line a "
            "device, a URL of pyserial or virtual, and BAUD a positive integer; dtr=off and "
            "rts=off may follow a serial line",
            repr(address),
            "write it like serial:virtual, serial:/dev/ttyUSB0,115200 or udp:192.168.1.50",
        )
    return port, int(baud), Lines(**levels)


@contextmanager
def open_board(address: str, key: str, virtual: Geometry | None = None) -> Iterator[OpenBoard]:
    """Opens the board at an address, and closes it at the end of the context.

    A fault of the line, at the start or during use, raises InputError.

    Args:
        address: address as in `parse_address`.
        key: key of the scenario, for messages.
        virtual: geometry of a virtual board, which is the cycle model; the default one if None.
    """
    port, baud, lines = parse_address(address, key)
    try:
        if port == _VIRTUAL:
            from rtl_model.virtual import VirtualBoard

            geometry = (virtual or Geometry())._replace(baud=_VIRTUAL_BAUD)
            with VirtualBoard(geometry, level="model") as served:
                yield from _connected(
                    served.port, _VIRTUAL_BAUD, "the virtual board", True, served.time_scale, lines
                )
        else:
            simulated = is_loopback(port) if is_udp(port) else is_pty(port)
            yield from _connected(port, baud, f"the board at {port}", simulated, 1.0, lines)
    except LineFault as fault:
        raise InputError(
            f"the board of {key}", "one that answers without a fault", f"at fault: {fault.text}",
            fault.advice,
        ) from fault  # fmt: skip


def _connected(
    port: str, baud: int, name: str, simulated: bool, time_scale: float, lines: Lines
) -> Iterator[OpenBoard]:
    with opened_bone(port, baud, simulated=simulated, time_scale=time_scale, lines=lines) as (
        bone,
        _,
    ):
        bone.resynchronise()
        board = Board(bone)
        yield OpenBoard(board, board.info(), name)
