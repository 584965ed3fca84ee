"""A port that answers from a log, without a board.

The host must send the logged requests. At the first difference LineFault DIFFERS states what the
host sent, what the log contains, and the line.
"""

from __future__ import annotations

from pathlib import Path

from cosim.errors import shorten
from rtl_model.host.faults import Cause, LineFault
from rtl_model.host.log_events import Answer, Dropped, LogEvent, Opened, Request, Stray, read_log

_ANSWER = 4 * 255  # bytes of the longest answer


class ReplayPort:
    """Implements `Port` over the log at `path`.

    Raises InputError, with the line, for a file that is not a log.

    Attributes:
        name: name for messages.
        baud: baud of the line; 0 over UDP.
        over_udp: whether the log is of Etherbone packets, which this port cannot answer.
        logged_port: name of the port in the log.
        simulated: whether a simulated board was behind the port; None if the log does not state it.
        time_scale, frames: time scale and number of frames of the session; None if the log does not
            state them.
        events: events of the log.
        cut: whether its last line is cut off.
    """

    def __init__(self, path: Path) -> None:
        self.name = f"replay of {path}"
        self.events, self.cut = read_log(path)
        first = self.events[0]
        assert isinstance(first, Opened)
        self.baud, self.logged_port = first.baud or 0, first.port
        self.over_udp = first.baud is None
        self.simulated, self.time_scale = first.simulated, first.time_scale
        self.frames = first.frames
        self._time = first.monotonic
        self._next = 1
        self._more = b""  # surplus bytes of the last answer

    @property
    def finished(self) -> bool:
        """Whether the log has no more events."""
        return self._next >= len(self.events)

    def now(self) -> float:
        """The time in the log, advanced by waits, s."""
        return self._time

    def write(self, data: bytes, deadline_s: float = 0.0) -> None:
        """Compares a request with the log. Raises LineFault DIFFERS."""
        event = self._peek()
        if not isinstance(event, Request) or event.hex != data.hex():
            raise self._differs(f"the host sends {data.hex()}", event)
        self._take()

    def read(self, count: int, deadline_s: float) -> bytes:
        """The answer in the log. Raises LineFault DIFFERS if another event follows."""
        event = self._peek()
        if count == 1 and self._more:
            got, self._more = self._more[:1], self._more[1:]
            return got
        if count == 1 or count > _ANSWER:  # the host waits for time to pass or for silence
            if count > 1 and isinstance(event, Dropped) and event.event != "baud":
                self._take()
            self._time += deadline_s
            return b""
        if not isinstance(event, Answer) or event.wanted != count:
            raise self._differs(f"the host waits for {count} bytes", event)
        self._take()
        self._more = bytes.fromhex(event.more)
        return bytes.fromhex(event.hex)

    def drain(self) -> bytes:
        """The bytes that came without a request at this place in the log."""
        got, self._more = self._more, b""
        event = self._peek()
        if isinstance(event, Stray):
            self._take()
            got += bytes.fromhex(event.hex)
        return got

    def set_baud(self, baud: int) -> None:
        """Takes the change of baud from the log, if one follows."""
        self.baud = baud
        event = self._peek()
        if isinstance(event, Dropped) and event.event == "baud":
            self._take()

    def close(self) -> None:
        """Does nothing: no port is open."""

    def _differs(self, host: str, event: LogEvent | None) -> LineFault:
        logged = "the end of the log" if event is None else str(event)
        line = f"line {self._next + 1} of the {self.name}"
        return LineFault(
            Cause.DIFFERS, f"{line}: {shorten(host)}, the log contains {shorten(logged)}"
        )

    def _peek(self) -> LogEvent | None:
        return None if self.finished else self.events[self._next]

    def _take(self) -> None:
        self._time = max(self._time, self.events[self._next].monotonic)
        self._next += 1
