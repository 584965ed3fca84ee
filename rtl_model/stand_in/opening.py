"""A board that stands in for a part of a run: opened by its address, and stepped frame by frame.

An address is `serial:PORT[,BAUD][,dtr=off][,rts=off]` or `udp:HOST[:PORT]`. PORT of a serial line
is a device, a URL of pyserial, or `virtual`. The simulator is only imported for a virtual board.

A step is exactly as many frames as requested. A frame starts when `sensor_run` is 1 and no frame is
in progress. A started frame is completed. The host writes 1 and then 0 in one packet, and the tick
is longer than a word on the line. Such a pulse starts one frame, or none if the previous frame has
not ended, and never two. The board's frame counter shows how many are missing. The tick is longer
than at 40 kHz, so a stepped board computes the planes of the ticks but does not run in real time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from math import ceil
from typing import Any, Final, NamedTuple

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.host import Board, BoardInfo, Cause, LineFault, Lines, is_pty, opened_bone
from rtl_model.host.ether import is_loopback, is_udp, udp_address

_BAUD: Final = Geometry().baud
_VIRTUAL: Final = "virtual"
_VIRTUAL_BAUD: Final = 3_000_000
"""Baud of a virtual board, which determines the duration of a step (see `stepping`)."""
_TICK_WORDS: Final = 6
"""Shortest tick, words on the line. A pulse is one word, and the line may pause briefly."""
_APART: Final = 4 / 3
"""Distance of pulses, ticks."""
_PACKET: Final = 240
"""Most words of a packet."""
_PROBED: Final = 8
"""Words read to measure the clocks of one word; a simulated line may take none."""
_STALLS: Final = 100
"""Consecutive packets without a frame before a fault is raised."""


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


class Stepper:
    """Steps the sensor of a board.

    Attributes:
        frames: number of frames since `restart`.
    """

    def __init__(self, board: Board, info: BoardInfo) -> None:
        self._board, self._info = board, info
        self._run = board.csr.register("sensor_run").address
        self.frames = 0

    def restart(self) -> None:
        """Stops the sensor. Its next frame is number 0 and starts without charge."""
        board = self._board
        was = board.read_twice("sensor_tick_clocks")
        board.write("sensor_run", 0)
        clocks = max(was, board.read_twice("sensor_tick_minimum"))
        slow = board.read_twice("sensor_clock_select")
        board.bone.pause((clocks << slow) / self._info.clock_hz * board.bone.time_scale)
        board.write("sensor_clock_select", 0)
        word = self._word_clocks()
        self._tick = max(board.read_twice("sensor_tick_minimum"), _TICK_WORDS * word)
        self._apart = min(max(ceil(_APART * self._tick / word), _TICK_WORDS + 2), _PACKET)
        board.write("sensor_tick_clocks", self._tick)
        board.write("sensor_clear", 1)
        self.frames = 0

    def step(self, frames: int) -> None:
        """Runs the given number of frames and waits until the last has ended.

        Raises LineFault if a frame does not start, or if a pause of the line caused a surplus one.
        """
        target, stalls = self.frames + frames, 0
        while self.frames < target:
            # Until the first frame has begun, the counter holds its value before the clear.
            most = 1 if self.frames == 0 else _PACKET // self._apart
            pulses = min(target - self.frames, most)
            words = [1, *[0] * (self._apart - 1)] * pulses
            self._board.verified_write(self._run, words, fixed=True)
            count = self._board.read_twice("sensor_frames")
            if count > self.frames + pulses:
                raise LineFault(
                    Cause.LATE,
                    f"the board started {count - self.frames} frames by {pulses} pulses: the line "
                    "paused within a packet",
                )
            stalls = 0 if count > self.frames else stalls + 1
            if stalls > _STALLS:
                raise LineFault(Cause.LATE, f"frame {self.frames} of the board does not begin")
            self.frames = count
        seconds = self._tick / self._info.clock_hz
        self._board.bone.pause(seconds * self._board.bone.time_scale)

    def _word_clocks(self) -> int:
        """Clocks of the board from one word on the line to the next, the largest of several."""
        place = self._board.csr.register("ctrl_uptime").address
        times = self._board.bone.read(place, _PROBED, fixed=True, retry=True)
        return max(1, *(b - a & 0xFFFFFFFF for a, b in pairwise(times)))
