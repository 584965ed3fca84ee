"""The log of a line, read and checked event by event, and a port that answers from it, without a
board.

The host must send the logged requests. At the first difference LineFault DIFFERS states what the
host sent, what the log contains, and the line. Events are as `LineLog` writes them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.types import FiniteFloat

from cosim import InputError
from cosim.errors import quote, shorten
from rtl_model.host.faults import Cause, LineFault
from rtl_model.host.log import FORMAT

Hex = Annotated[str, Field(pattern=r"^(?:[0-9a-f]{2})*$")]
Count = Annotated[int, Field(ge=0, lt=2**32)]
Seconds = Annotated[FiniteFloat, Field(ge=-1e9, le=1e9)]
_ANSWER = 4 * 255  # bytes of the longest answer


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must be printable")
    return text


Text = Annotated[str, Field(max_length=500), AfterValidator(_printable)]


class _Event(BaseModel):
    """What all events have.

    Attributes:
        monotonic: time of the port's clock, s.
        wall: UTC, text.
    """

    model_config = ConfigDict(strict=True, frozen=True)

    monotonic: Seconds
    wall: Text = ""


class Opened(_Event):
    """The first event.

    Attributes:
        format: format of the log.
        port: name of the port.
        baud: baud of the line; None over UDP.
        simulated, time_scale, frames: settings of the session; None if it did not state them.
    """

    event: Literal["open"]
    format: Literal["viform-line-1"]
    port: Text = ""
    baud: Annotated[int, Field(gt=0, lt=2**31)] | None
    simulated: bool | None = None
    time_scale: Annotated[float, Field(gt=0, lt=1e6)] | None = None
    frames: Annotated[int, Field(gt=0, le=4096)] | None = None


class Request(_Event):
    """A request.

    Attributes:
        command: name of the uartbone command.
        address: byte address, hexadecimal.
        words: number of words of the transaction.
        hex: all bytes that were sent.
    """

    event: Literal["write"]
    command: Literal["write", "read", "write fixed", "read fixed"]
    address: Annotated[str, Field(pattern=r"^0x[0-9a-f]{1,8}$")]
    words: Annotated[int, Field(ge=0, le=256)]
    hex: Hex

    def __str__(self) -> str:
        return f"a {self.command} of {self.words} words at {self.address} ({self.hex})"


class Answer(_Event):
    """An answer.

    Attributes:
        wanted: number of bytes that the host waited for.
        hex: bytes that came.
        more: surplus bytes.
        fault: cause of the fault, None if there was none.
    """

    event: Literal["read"]
    wanted: Count
    hex: Hex
    more: Hex
    fault: Text | None

    def __str__(self) -> str:
        return f"an answer of {self.wanted} bytes ({self.hex or 'none'})"


class Stray(_Event):
    """Bytes that came without a request."""

    event: Literal["stray"]
    hex: Hex

    def __str__(self) -> str:
        return "bytes without a request"


class Dropped(_Event):
    """The line was brought to silence, or could not be, or has another baud.

    Attributes:
        value: number of dropped bytes, or the baud.
    """

    event: Literal["silence", "chatter", "baud"]
    value: Count

    def __str__(self) -> str:
        return self.event


class Datagram(_Event):
    """An Etherbone packet over UDP.

    Attributes:
        way: its direction.
        hex: all bytes.
    """

    event: Literal["packet"]
    way: Literal["to-board", "from-board"]
    hex: Hex

    def __str__(self) -> str:
        return f"a packet {self.way.replace('-', ' the ')}"


AnyEvent = Opened | Request | Answer | Stray | Dropped | Datagram

LogEvent = Annotated[AnyEvent, Field(discriminator="event")]

_EVENT: Final[TypeAdapter[AnyEvent]] = TypeAdapter(LogEvent)


def read_log(path: Path) -> tuple[list[AnyEvent], bool]:
    """Reads a log.

    Returns:
        The events, and whether the last line is cut off, which is then left out.

    Raises:
        InputError: for an unreadable file, or a line that is not an event, with its number.
    """
    try:
        text = path.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as exc:
        raise InputError(
            f"{path}", "a log of a line", f"unreadable ({exc})", "give one written with --log"
        ) from exc
    every = text.split("\n")
    *lines, rest = every  # a whole log ends with a line break
    events = [_parsed(path, number, line) for number, line in enumerate(lines, 1)]
    if rest:
        try:
            events.append(_parsed(path, len(lines) + 1, rest))
            rest = ""
        except InputError:
            if not events:
                raise
    if not events or not isinstance(events[0], Opened):
        raise _bad(path, 1, every[0])
    for number, event in enumerate(events[1:], 2):
        if isinstance(event, Opened):
            raise _bad(path, number, every[number - 1])
    return events, bool(rest)


def _parsed(path: Path, number: int, line: str) -> AnyEvent:
    try:
        return _EVENT.validate_json(line)
    except ValidationError as exc:
        raise _bad(path, number, line) from exc


def _bad(path: Path, number: int, line: str) -> InputError:
    return InputError(
        f"line {number} of {path}", f"an event of a {FORMAT} log", quote(line),
        "give an unchanged log, written with --log",
    )  # fmt: skip


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
