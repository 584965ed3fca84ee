"""Serial ports of any kind behind one protocol: devices, ptys, `socket://`, `rfc2217://`, `loop://`.

The ports of pyserial differ. A pty accepts any baud, has no modem lines (ENOTTY), no low-latency
mode (ValueError) and no parity (EINVAL), and is not listed. This file relies on none of these. All
reads and writes have timeouts, and every fault has a cause.
"""

from __future__ import annotations

import errno
import os
import re
import select
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, Protocol
from urllib.parse import urlsplit

from cosim import InputError
from rtl_model.host.countdown import Countdown
from rtl_model.host.faults import Cause, LineFault

if TYPE_CHECKING:
    import serial

try:
    from termios import error as TerminalError
except ImportError:  # Windows, whose ports pyserial opens without it

    class TerminalError(Exception):  # type: ignore[no-redef]
        """Is never raised."""


_POLL_S = 0.01  # interval at which a read checks its deadline
_COUNTED_S = 0.1  # most of the time between two such looks that counts
_TIMERS = Path("/sys/bus/usb-serial/devices")
_WRITE_S = 1.0  # shortest time limit of a write
Level = Literal["on", "off"]
"""State of a modem line: asserted or not."""
_CAUSES = {
    errno.EACCES: Cause.PERMISSION,
    errno.EPERM: Cause.PERMISSION,
    errno.EBUSY: Cause.BUSY,
    errno.EAGAIN: Cause.BUSY,  # flock: another program uses it
    errno.EWOULDBLOCK: Cause.BUSY,
}


class Lines(NamedTuple):
    """Modem lines that the host sets, which reset some boards.

    Attributes:
        dtr, rts: state as the port is opened and until it is closed; None for asserted, as
            programs for serial lines commonly do.
    """

    dtr: Level | None = None
    rts: Level | None = None


AS_EVER: Final = Lines()


class Port(Protocol):
    """A bidirectional stream of bytes: a serial port, a log, or a model of a board.

    Attributes:
        name: name for messages.
        baud: rate of the host.
    """

    name: str
    baud: int

    def read(self, count: int, deadline_s: float) -> bytes:
        """Reads `count` bytes, or those that arrive within `deadline_s` seconds."""

    def write(self, data: bytes, deadline_s: float = _WRITE_S) -> None:
        """Sends all bytes within `deadline_s` seconds. Raises LineFault if that fails."""

    def drain(self) -> bytes:
        """Unread bytes without waiting."""

    def set_baud(self, baud: int) -> None:
        """Changes the host's rate."""

    def now(self) -> float:
        """The port's monotonic time, s."""

    def close(self) -> None:
        """Closes the port; may be called twice."""


class SerialPort:
    """A port of pyserial, opened by `open_port`."""

    def __init__(self, inner: serial.Serial, name: str) -> None:
        self.inner, self.name = inner, name
        self.baud = int(inner.baudrate)

    def read(self, count: int, deadline_s: float) -> bytes:
        """Reads `count` bytes, or those that arrive within `deadline_s` seconds."""
        limit = Countdown(deadline_s, _COUNTED_S)
        got = b""
        with _named(self.name):
            if deadline_s < _POLL_S:
                time.sleep(deadline_s)
                return bytes(self.inner.read(min(count, self.inner.in_waiting)))
            while True:
                got += self.inner.read(count - len(got))
                if len(got) >= count or limit.left() <= 0:
                    return got

    def write(self, data: bytes, deadline_s: float = _WRITE_S) -> None:
        """Passes all bytes to the system. Raises LineFault STUCK after `deadline_s` seconds."""
        with _named(self.name):
            file = getattr(self.inner, "fd", None)
            if file is not None:
                self._write_file(file, data, Countdown(deadline_s, _COUNTED_S))
                return
            limit = self.inner.write_timeout  # each change reconfigures the port
            if limit is not None and deadline_s > limit:
                self.inner.write_timeout = 2 * deadline_s
            self.inner.write(data)

    def _write_file(self, file: int, data: bytes, limit: Countdown) -> None:
        """Writes to a device or pty, whose file never blocks.

        pyserial's own `write` fails if the host was suspended, even when all bytes were accepted.
        """
        while True:
            with suppress(BlockingIOError):
                data = data[os.write(file, data) :]
            if not data:
                return
            if limit.left() <= 0:
                raise _stuck(self.name)
            select.select([], [file], [], _POLL_S)

    def drain(self) -> bytes:
        """Contents of the input buffer."""
        got = b""
        with _named(self.name):
            while waiting := self.inner.in_waiting:
                more = self.inner.read(waiting)
                got += more
                if not more or len(got) > 1 << 20:
                    break
        return got

    def set_baud(self, baud: int) -> None:
        """Changes the host's rate.

        Raises InputError if the adapter does not support it, LineFault GONE.
        """
        try:
            with _named(self.name):
                self.inner.baudrate = baud
        except ValueError as exc:
            raise _bad_baud(self.name, baud) from exc
        self.baud = baud

    def now(self) -> float:
        """The system's monotonic time, s."""
        return time.monotonic()

    def modem_lines(self) -> dict[str, bool] | None:
        """The lines CTS, DSR, RI and CD; None if the port has none, as a pty or a socket."""
        try:
            return {name: bool(getattr(self.inner, name)) for name in ("cts", "dsr", "ri", "cd")}
        except (OSError, ValueError, AttributeError):
            return None

    def low_latency(self, wanted: bool = True) -> bool:
        """Requests the driver's low-latency mode (1 ms for FTDI); returns whether it is granted.

        Ptys and sockets do not have it.
        """
        try:
            self.inner.set_low_latency_mode(wanted)
        except (OSError, ValueError, AttributeError, NotImplementedError):
            return False
        return True

    def close(self) -> None:
        """Closes the port."""
        try:
            self.inner.close()
        except OSError:
            return  # the device has been removed


class _named:
    """Context that turns the errors of pyserial and the system into LineFault."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            return
        import serial

        if isinstance(error, serial.SerialTimeoutException):
            raise _stuck(self.name) from error
        # TypeError: pyserial, if the port closes during a read; TerminalError is not an OSError
        if isinstance(error, OSError | TypeError | TerminalError):
            raise LineFault(Cause.GONE, f"{self.name} disappeared ({_plain(error)})") from error


def _stuck(name: str) -> LineFault:
    return LineFault(Cause.STUCK, f"{name} did not accept the bytes to send within the time limit")


def open_port(url: str, baud: int, *, exclusive: bool = True, lines: Lines = AS_EVER) -> SerialPort:
    """Opens a port by any URL of pyserial, 8 data bits, no parity, one stop bit.

    Args:
        url: a device or a URL of pyserial.
        baud: baud of the line.
        exclusive: whether other programs are locked out, if the system supports it.
        lines: modem lines to set. Linux asserts both for the moment in which it opens a device.

    Raises:
        LineFault: NO_PORT, BUSY or PERMISSION.
        InputError: for an invalid URL or baud.
    """
    import serial

    if baud <= 0:
        raise _bad_baud(url, baud)
    if not url.strip():
        raise _bad_url(url, ValueError("nothing"))
    if url.lower().startswith("socket://") and not _names_a_port(url):
        raise _bad_url(url, ValueError("its port is missing or not a number up to 65535"))
    try:
        inner = serial.serial_for_url(
            url,
            baudrate=baud,
            timeout=_POLL_S,
            # pyserial's client of RFC 2217 refuses one; its socket has a timeout of 5 s.
            write_timeout=None if url.lower().startswith("rfc2217://") else _WRITE_S,
            exclusive=exclusive,
            do_not_open=True,
        )
    except (ValueError, re.error) as exc:
        raise _bad_url(url, exc) from exc
    except OSError as exc:  # hwgrep:// searches its port at once
        raise _refused(url, exc) from exc
    for name, level in lines._asdict().items():
        if level is not None:
            setattr(inner, name, level == "on")  # set as the port is opened
    try:
        inner.open()
    except (OSError, TerminalError, LookupError, TypeError) as exc:
        # URL handlers raise the last two for parts that they cannot parse.
        raise _refused(url, exc) from exc
    except ValueError as exc:
        if "baud" in str(exc).lower():
            raise _bad_baud(url, baud) from exc
        raise _bad_url(url, exc) from exc
    return SerialPort(inner, url)


def _names_a_port(url: str) -> bool:
    """Whether a URL has a port, which pyserial does not check before it compares numbers."""
    try:
        return bool(urlsplit(url).port)
    except ValueError:
        return False


def is_pty(name: str) -> bool:
    """Whether a port is a pseudo-terminal, which has no hardware behind it."""
    return os.path.realpath(name).startswith("/dev/pts/")


def latency_timer(name: str) -> tuple[Path, int | None]:
    """The file of an FTDI adapter's latency timer, and its value, ms; None without a timer.

    The adapter delays bytes by that time. Its default of 16 ms allows some 62 round trips per
    second.
    """
    path = _TIMERS / Path(os.path.realpath(name)).name / "latency_timer"
    try:
        return path, int(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return path, None


def ports_here() -> list[str]:
    """The serial ports that the system lists, as `device (description)`. Ptys are not listed."""
    from serial.tools import list_ports

    found = sorted(list_ports.comports(), key=lambda port: str(port.device))
    return [f"{port.device} ({port.description or 'n/a'})" for port in found]


def _refused(url: str, error: BaseException) -> LineFault:
    number = getattr(error, "errno", None)
    cause = _CAUSES.get(number or 0, Cause.NO_PORT)
    if cause is Cause.BUSY:
        return LineFault(cause, f"{url} is in use by another program")
    if cause is Cause.PERMISSION:
        return LineFault(cause, f"this user may not open {url}", _group_advice(url))
    here = ", ".join(ports_here()) or "none"
    if getattr(error.__context__, "args", ())[:1] == (errno.ENOTTY,):  # of termios, in pyserial's
        return LineFault(
            cause,
            f"{url} exists but is not a serial port; ports here: {here}",
            "name a serial port",
        )
    return LineFault(
        cause,
        f"no serial port answers to {url} ({_plain(error)}); ports here: {here}",
        "plug the board in, or name an existing port (`viform board virtual` creates one)",
    )


def _group_advice(url: str) -> str:
    try:
        import grp

        group = grp.getgrgid(Path(url).stat().st_gid).gr_name
    except (ImportError, OSError, KeyError):
        group = "dialout"
    if group == "root":
        group = "dialout"  # a udev rule assigns ports to it, not to root
    return f"join the group {group} (`sudo usermod -aG {group} $USER`) and log in again"


def _plain(error: BaseException) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())


def _bad_baud(url: str, baud: int) -> InputError:
    return InputError(
        f"the baud of {url}", "one that the adapter supports", str(baud), "give another --baud"
    )


def _bad_url(url: str, error: BaseException) -> InputError:
    return InputError(
        "a port",
        "a device or a URL of pyserial (/dev/ttyUSB0, socket://host:port, rfc2217://host:port)",
        f"{url!r} ({_plain(error)})",
        "name one",
    )
