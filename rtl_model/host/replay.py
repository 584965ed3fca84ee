"""A port that answers from a log, without a board.

What the host asks must be what it asked then; at the first difference a LineFault DIFFERS says
what was asked, what the log holds, and on which line.
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
_ANSWER = 4 * 255  # bytes of the longest
_VALUES = {"silence", "chatter", "baud"}


class ReplayPort:
    """A port over the log at `path`. InputError, with the line, for a file that is none.

    logged_port: the one that was spoken to. simulated: whether nothing real was behind it, None
    where the log does not say; time_scale, frames: of the session, likewise.
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
        self._more = b""  # beyond the answer that was read last

    @property
    def finished(self) -> bool:
        """Whether the host has asked all that the log holds."""
        return self._next >= len(self._events)

    def now(self) -> float:
        """Returns the time of the log, and of waiting in it."""
        return self._time

    def write(self, data: bytes, deadline_s: float = 0.0) -> None:
        """Holds a request against the log."""
        event = self._peek()
        if event is None or event["event"] != "write" or bytes.fromhex(event["hex"]) != data:
            held = "the end of the log" if event is None else _told(event)
            raise LineFault(
                Cause.DIFFERS,
                f"line {self._next + 1} of the {self.name}: the host sends {data.hex()}, "
                f"the log holds {held}",
            )
        self._take()

    def read(self, count: int, deadline_s: float) -> bytes:
        """Returns what the log has come back with."""
        event = self._peek()
        if count == 1 and self._more:
            got, self._more = self._more[:1], self._more[1:]
            return got
        if count == 1 or count > _ANSWER:  # the host waits, for time to pass or for silence
            if count > 1 and event is not None and event["event"] in ("silence", "chatter"):
                self._take()
            self._time += deadline_s
            return b""
        if event is None or event["event"] != "read" or event["wanted"] != count:
            held = "the end of the log" if event is None else _told(event)
            raise LineFault(
                Cause.DIFFERS,
                f"line {self._next + 1} of the {self.name}: the host waits for {count} bytes, "
                f"the log holds {held}",
            )
        self._take()
        self._more = bytes.fromhex(event["more"])
        return bytes.fromhex(event["hex"])

    def drain(self) -> bytes:
        """Returns bytes that came unasked at this place of the log."""
        got, self._more = self._more, b""
        event = self._peek()
        if event is not None and event["event"] == "stray":
            self._take()
            got += bytes.fromhex(event["hex"])
        return got

    def set_baud(self, baud: int) -> None:
        """Goes with the log."""
        self.baud = baud
        event = self._peek()
        if event is not None and event["event"] == "baud":
            self._take()

    def close(self) -> None:
        """Does nothing: a replay holds no port."""

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


def _told(event: dict[str, Any]) -> str:
    if event["event"] == "write":
        return (
            f"a {event['command']} of {event['words']} words at {event['address']} ({event['hex']})"
        )
    if event["event"] == "read":
        return f"an answer of {event['wanted']} bytes ({event['hex'] or 'none came'})"
    return str(event["event"])


def _events(path: Path) -> list[dict[str, Any]]:
    try:
        text = path.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as exc:
        raise InputError(
            f"{path}", "a log of a line", f"unreadable ({exc})", "give one written with --log"
        ) from exc
    lines = text.split("\n")
    whole = lines if lines[-1] else lines[:-1]
    events = [_event(path, number, line) for number, line in enumerate(whole, 1)]
    if not events:
        raise _bad(path, 1, "nothing")
    return events


def _event(path: Path, number: int, line: str) -> dict[str, Any]:
    try:
        event = json.loads(line)
        kind = event["event"]
        event["monotonic"] = float(event["monotonic"])
        if number == 1:
            sound = kind == "open" and event["format"] == FORMAT and type(event["baud"]) is int
        elif kind in _HEX:
            for name in _HEX[kind]:
                bytes.fromhex(event[name])
            sound = kind != "read" or type(event["wanted"]) is int
            if kind == "write":
                sound = all(name in event for name in ("command", "words", "address"))
        else:
            sound = kind in _VALUES and type(event["value"]) is int
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as exc:
        raise _bad(path, number, line[:60]) from exc
    if not sound:
        raise _bad(path, number, line[:60])
    return dict(event)


def _bad(path: Path, number: int, given: str) -> InputError:
    return InputError(
        f"line {number} of {path}",
        f"an event of a {FORMAT} log",
        repr(given),
        "give a log written with --log, as it was written",
    )
