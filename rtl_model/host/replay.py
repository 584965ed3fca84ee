"""A port that answers from a log, without a board.

The host must send the logged requests. At the first difference LineFault DIFFERS states what the
host sent, what the log contains, and the line.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from cosim import InputError
from rtl_model.host.faults import Cause, LineFault
from rtl_model.host.log import FORMAT

__all__ = ["ReplayPort"]

_HEX = {"write": ("hex",), "read": ("hex", "more"), "stray": ("hex",)}
_ANSWER = 4 * 255  # bytes of the longest answer
_VALUES = {"silence", "chatter", "baud"}


class ReplayPort:
    """Implements `Port` over the log at `path`.

    Raises InputError, with the line, for a file that is not a log.

    Attributes:
        name: for messages.
        baud: of the line.
        logged_port: name of the port in the log.
        simulated: whether a simulated board was behind the port; None if the log does not state it.
        time_scale, frames: of the session; None if the log does not state them.
    """

    def __init__(self, path: Path) -> None:
        self.name = f"replay of {path}"
        self._events = _events(path)
        first = self._events[0]
        self.baud = int(first["baud"])
        self.logged_port = str(first.get("port", ""))
        self.simulated, self.time_scale, self.frames = _session(first)
        self._time = float(first["monotonic"])
        self._next = 1
        self._more = b""  # surplus bytes of the last answer

    @property
    def finished(self) -> bool:
        """Whether the log has no more events."""
        return self._next >= len(self._events)

    def now(self) -> float:
        """The time in the log, advanced by waits, s."""
        return self._time

    def write(self, data: bytes, deadline_s: float = 0.0) -> None:
        """Compares a request with the log. Raises LineFault DIFFERS."""
        event = self._peek()
        if event is None or event["event"] != "write" or bytes.fromhex(event["hex"]) != data:
            event_text = "the end of the log" if event is None else _describe(event)
            raise LineFault(
                Cause.DIFFERS,
                f"line {self._next + 1} of the {self.name}: the host sends {data.hex()}, "
                f"the log contains {event_text}",
            )
        self._take()

    def read(self, count: int, deadline_s: float) -> bytes:
        """The answer in the log. Raises LineFault DIFFERS if another event follows."""
        event = self._peek()
        if count == 1 and self._more:
            got, self._more = self._more[:1], self._more[1:]
            return got
        if count == 1 or count > _ANSWER:  # the host waits for time to pass or for silence
            if count > 1 and event is not None and event["event"] in ("silence", "chatter"):
                self._take()
            self._time += deadline_s
            return b""
        if event is None or event["event"] != "read" or event["wanted"] != count:
            event_text = "the end of the log" if event is None else _describe(event)
            raise LineFault(
                Cause.DIFFERS,
                f"line {self._next + 1} of the {self.name}: the host waits for {count} bytes, "
                f"the log contains {event_text}",
            )
        self._take()
        self._more = bytes.fromhex(event["more"])
        return bytes.fromhex(event["hex"])

    def drain(self) -> bytes:
        """The bytes that came without a request at this place in the log."""
        got, self._more = self._more, b""
        event = self._peek()
        if event is not None and event["event"] == "stray":
            self._take()
            got += bytes.fromhex(event["hex"])
        return got

    def set_baud(self, baud: int) -> None:
        """Takes the change of baud from the log, if one follows."""
        self.baud = baud
        event = self._peek()
        if event is not None and event["event"] == "baud":
            self._take()

    def close(self) -> None:
        """Does nothing: no port is open."""

    def _peek(self) -> dict[str, Any] | None:
        return None if self.finished else self._events[self._next]

    def _take(self) -> None:
        self._time = max(self._time, float(self._events[self._next]["monotonic"]))
        self._next += 1


def _session(first: dict[str, Any]) -> tuple[bool | None, float | None, int | None]:
    simulated, scale, frames = (first.get(name) for name in ("simulated", "time_scale", "frames"))
    return (
        simulated if isinstance(simulated, bool) else None,
        float(scale) if isinstance(scale, int | float) and 0 < scale < 1e6 else None,
        frames if type(frames) is int and frames > 0 else None,
    )


def _describe(event: dict[str, Any]) -> str:
    if event["event"] == "write":
        return (
            f"a {event['command']} of {event['words']} words at {event['address']} ({event['hex']})"
        )
    if event["event"] == "read":
        return f"an answer of {event['wanted']} bytes ({event['hex'] or 'none'})"
    return str(event["event"])


def _events(path: Path) -> list[dict[str, Any]]:
    try:
        text = path.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as exc:
        raise InputError(
            f"{path}", "a log of a line", f"unreadable ({exc})", "give one written with --log"
        ) from exc
    lines = text.split("\n")
    complete = lines if lines[-1] else lines[:-1]
    events = [_event(path, number, line) for number, line in enumerate(complete, 1)]
    if not events:
        raise _bad(path, 1, "nothing")
    return events


def _event(path: Path, number: int, line: str) -> dict[str, Any]:
    try:
        event = json.loads(line)
        kind = event["event"]
        event["monotonic"] = float(event["monotonic"])
        if number == 1:
            valid = kind == "open" and event["format"] == FORMAT and type(event["baud"]) is int
        elif kind in _HEX:
            for name in _HEX[kind]:
                bytes.fromhex(event[name])
            valid = kind != "read" or type(event["wanted"]) is int
            if kind == "write":
                valid = all(name in event for name in ("command", "words", "address"))
        else:
            valid = kind in _VALUES and type(event["value"]) is int
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as exc:
        raise _bad(path, number, line[:60]) from exc
    if not valid:
        raise _bad(path, number, line[:60])
    return dict(event)


def _bad(path: Path, number: int, actual: str) -> InputError:
    return InputError(
        f"line {number} of {path}",
        f"an event of a {FORMAT} log",
        repr(actual),
        "give an unchanged log, written with --log",
    )
