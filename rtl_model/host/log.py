"""A log of all transactions on the line, as JSON lines that are written at once.

Every line has `monotonic` (seconds of the port's clock), `wall` (UTC) and `event`:

    open             First line: `format`, `port`, `baud` and, where known, the session's
                     `simulated`, `time_scale` and `frames`.
    write            A request: `command`, `address` (bytes), `words`, `hex`.
    read             An answer: `wanted` bytes, `hex`, `more` (surplus bytes), `fault` or null.
    stray            Bytes without a request: `hex`.
    silence, chatter The line was brought to silence, or could not be: `value` dropped bytes.
    baud             Another baud: `value`.
    packet           An Etherbone packet over UDP: `way` ("to-board" or "from-board"), `hex`. Then
                     `baud` of the first line is null.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Protocol

from cosim.files.atomic import refusal

FORMAT = "viform-line-1"

_COMMANDS = {1: "write", 2: "read", 3: "write fixed", 4: "read fixed"}


class Logged(Protocol):
    """A port whose name and time a log takes."""

    name: str

    def now(self) -> float:
        """The port's monotonic time, s."""


class LineLog:
    """Writes the log of one port. Raises InputError if the file cannot be written.

    Args:
        path: the file.
        port: whose transactions are logged.
        clock: returns the monotonic time, s; the port's if None.
        session: further fields of the first line.
    """

    def __init__(
        self,
        path: Path,
        port: Logged,
        *,
        clock: Callable[[], float] | None = None,
        session: Mapping[str, object] | None = None,
    ) -> None:
        self._clock = port.now if clock is None else clock
        try:
            self._file = path.open("w", encoding="ascii")
        except OSError as exc:
            raise refusal(path, exc) from exc
        baud = getattr(port, "baud", None)
        self._line("open", format=FORMAT, port=port.name, baud=baud, **(session or {}))

    def __enter__(self) -> LineLog:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def write(self, packet: bytes, address: int, words: int) -> None:
        """Logs a request: its packet, byte address and number of words."""
        command = _COMMANDS[packet[0]]
        self._line("write", command=command, address=f"{address:#x}", words=words, hex=packet.hex())

    def read(self, wanted: int, data: bytes, more: bytes, fault: str | None) -> None:
        """Logs an answer, complete or not: bytes wanted, received and surplus, and its fault."""
        self._line("read", wanted=wanted, hex=data.hex(), more=more.hex(), fault=fault)

    def stray(self, data: bytes) -> None:
        """Logs bytes that came without a request."""
        self._line("stray", hex=data.hex())

    def packet(self, way: str, data: bytes) -> None:
        """Logs a datagram: "to-board" or "from-board", and its bytes."""
        self._line("packet", way=way, hex=data.hex())

    def note(self, what: str, value: int) -> None:
        """Logs an event with a value: silence, chatter or baud."""
        self._line(what, value=value)

    def close(self) -> None:
        """Closes the file."""
        self._file.close()

    def _line(self, event: str, **more: object) -> None:
        wall = datetime.now(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
        head = {"monotonic": round(self._clock(), 6), "wall": wall, "event": event}
        self._file.write(json.dumps({**head, **more}) + "\n")
        self._file.flush()
