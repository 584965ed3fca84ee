"""A log of the line as JSON lines, each written as it happens: what was asked, what came, when.

Every line has `monotonic` (seconds of the port's clock), `wall` (UTC) and `event`:
`write` (`hex`, `command`, `address` in bytes, `words`), `read` (`hex`, `wanted` bytes, `more` hex
beyond them, `fault` or null), `stray` (`hex`: bytes nobody asked for), `silence` and `chatter`
(`value`: bytes dropped), `baud` (`value`). The first line is `open` (`format`, `port`, `baud`, and
what the session was, as far as it said: `simulated`, `time_scale`, `frames`).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType

from cosim.files.whole import refusal
from rtl_model.host.ports import Port

__all__ = ["FORMAT", "Recorder"]

FORMAT = "viform-line-1"

_COMMANDS = {1: "write", 2: "read", 3: "write fixed", 4: "read fixed"}


class Recorder:
    """Writes the log of one port to `path`. InputError where that cannot be written.

    clock: gives the monotonic time; None is the port's. session: what the first line says besides
        format, port and baud.
    """

    def __init__(
        self,
        path: Path,
        port: Port,
        *,
        clock: Callable[[], float] | None = None,
        session: Mapping[str, object] | None = None,
    ) -> None:
        self._clock = port.now if clock is None else clock
        try:
            self._file = path.open("w", encoding="ascii")
        except OSError as exc:
            raise refusal(path, exc) from exc
        self._line("open", format=FORMAT, port=port.name, baud=port.baud, **(session or {}))

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def write(self, packet: bytes, address: int, words: int) -> None:
        """A transaction was begun: all that is sent of it."""
        command = _COMMANDS[packet[0]]
        self._line("write", command=command, address=f"{address:#x}", words=words, hex=packet.hex())

    def read(self, wanted: int, data: bytes, more: bytes, fault: str | None) -> None:
        """An answer came, or what there was of it."""
        self._line("read", wanted=wanted, hex=data.hex(), more=more.hex(), fault=fault)

    def stray(self, data: bytes) -> None:
        """Bytes came that nobody asked for."""
        self._line("stray", hex=data.hex())

    def note(self, what: str, value: int) -> None:
        """Silence, chatter or another baud."""
        self._line(what, value=value)

    def close(self) -> None:
        """Ends the log."""
        self._file.close()

    def _line(self, event: str, **more: object) -> None:
        wall = datetime.now(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
        head = {"monotonic": round(self._clock(), 6), "wall": wall, "event": event}
        self._file.write(json.dumps({**head, **more}) + "\n")
        self._file.flush()
