"""Serial ports of any kind behind one protocol: devices, ptys, `socket://`, `rfc2217://`, `loop://`.

pyserial's ports differ where it matters: a pty takes any baud, knows no modem lines (ENOTTY), no
low latency (ValueError) and no parity (EINVAL), and is not among the listed ports; so nothing here
relies on those. Timeouts are always set, both ways, and every fault has a cause.
"""

from __future__ import annotations

import errno
import os
import re
import termios
import time
from pathlib import Path
from typing import TYPE_CHECKING, Protocol
from urllib.parse import urlsplit

from cosim import InputError
from rtl_model.host.faults import Cause, LineFault

if TYPE_CHECKING:
    import serial

__all__ = ["Port", "SerialPort", "is_pty", "latency_timer", "open_port", "ports_here"]

_POLL_S = 0.01  # a read looks at its deadline this often
_TIMERS = Path("/sys/bus/usb-serial/devices")
_WRITE_S = 1.0  # least time allowed for a write


class Port(Protocol):
    """Bytes both ways. A test, a log and a model of a board are ports as well."""

    name: str
    baud: int

    def read(self, count: int, deadline_s: float) -> bytes:
        """Returns `count` bytes, or those that came within `deadline_s` seconds from now."""

    def write(self, data: bytes, deadline_s: float = _WRITE_S) -> None:
        """Hands all bytes on within `deadline_s` seconds, or LineFault."""

    def drain(self) -> bytes:
        """Returns what has come and was not read, without waiting."""

    def set_baud(self, baud: int) -> None:
        """Changes the host's own rate."""

    def now(self) -> float:
        """Returns the port's monotonic time, seconds."""

    def close(self) -> None:
        """Gives the port back; may be called twice."""


class SerialPort:
    """A port of pyserial. Made by `open_port`."""

    def __init__(self, inner: serial.Serial, name: str) -> None:
        self.inner, self.name = inner, name
        self.baud = int(inner.baudrate)

    def read(self, count: int, deadline_s: float) -> bytes:
        """Returns `count` bytes, or those that came within `deadline_s` seconds."""
        end = time.monotonic() + deadline_s
        got = b""
        with _named(self.name):
            if deadline_s < _POLL_S:
                time.sleep(deadline_s)
                return bytes(self.inner.read(min(count, self.inner.in_waiting)))
            while True:
                got += self.inner.read(count - len(got))
                if len(got) >= count or time.monotonic() >= end:
                    return got

    def write(self, data: bytes, deadline_s: float = _WRITE_S) -> None:
        """Hands all bytes to the system, or LineFault STUCK after `deadline_s` seconds."""
        with _named(self.name):
            if deadline_s > self.inner.write_timeout:  # each change reconfigures the port
                self.inner.write_timeout = 2 * deadline_s
            self.inner.write(data)

    def drain(self) -> bytes:
        """Returns what stands in the input buffer."""
        got = b""
        with _named(self.name):
            while waiting := self.inner.in_waiting:
                more = self.inner.read(waiting)
                got += more
                if not more or len(got) > 1 << 20:
                    break
        return got

    def set_baud(self, baud: int) -> None:
        """Changes the host's rate. InputError where the adapter cannot, LineFault GONE."""
        try:
            with _named(self.name):
                self.inner.baudrate = baud
        except ValueError as exc:
            raise _bad_baud(self.name, baud) from exc
        self.baud = baud

    def now(self) -> float:
        """Returns the system's monotonic time, seconds."""
        return time.monotonic()

    def modem_lines(self) -> dict[str, bool] | None:
        """Returns CTS, DSR, RI and CD, or None where the port has none (a pty, a socket)."""
        try:
            return {name: bool(getattr(self.inner, name)) for name in ("cts", "dsr", "ri", "cd")}
        except (OSError, ValueError, AttributeError):
            return None

    def low_latency(self, wanted: bool = True) -> bool:
        """Asks the driver for low latency (1 ms with FTDI's); returns whether it granted it. A pty
        and a socket never do."""
        try:
            self.inner.set_low_latency_mode(wanted)
        except (OSError, ValueError, AttributeError, NotImplementedError):
            return False
        return True

    def close(self) -> None:
        """Gives the port back."""
        try:
            self.inner.close()
        except OSError:
            return  # it had gone; there is nothing left to give back


class _named:
    """Turns what pyserial and the system raise inside the block into a LineFault."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is None:
            return
        import serial

        if isinstance(error, serial.SerialTimeoutException):
            raise LineFault(
                Cause.STUCK, f"{self.name} took no more bytes to send in the time allowed"
            ) from error
        # TypeError: pyserial, closed under a read; termios.error is no OSError
        if isinstance(error, OSError | TypeError | termios.error):
            raise LineFault(Cause.GONE, f"{self.name} went away ({_plain(error)})") from error


def open_port(url: str, baud: int, *, exclusive: bool = True) -> SerialPort:
    """Opens a port by any URL of pyserial, 8 data bits, no parity, one stop bit.

    exclusive: no other program may open it meanwhile (where the system can).
    LineFault NO_PORT, BUSY or PERMISSION; InputError for a URL or baud that cannot be.
    """
    import serial

    if baud <= 0:
        raise _bad_baud(url, baud)
    if not url.strip():
        raise _bad_url(url, ValueError("nothing"))
    if url.lower().startswith("socket://") and not _names_a_port(url):
        raise _bad_url(url, ValueError("its port is missing or no number up to 65535"))
    try:
        inner = serial.serial_for_url(
            url,
            baudrate=baud,
            timeout=_POLL_S,
            write_timeout=_WRITE_S,
            exclusive=exclusive,
            do_not_open=True,
        )
    except (ValueError, re.error) as exc:
        raise _bad_url(url, exc) from exc
    except OSError as exc:  # hwgrep:// looks for its port at once
        raise _refused(url, exc) from exc
    try:
        inner.open()
    except (OSError, termios.error, LookupError, TypeError) as exc:
        # The last two are what URL handlers let through of parts that they cannot read.
        raise _refused(url, exc) from exc
    except ValueError as exc:
        if "baud" in str(exc).lower():
            raise _bad_baud(url, baud) from exc
        raise _bad_url(url, exc) from exc
    return SerialPort(inner, url)


def _names_a_port(url: str) -> bool:
    """Whether a URL ends its host in :port; pyserial compares a missing one with a number."""
    try:
        return bool(urlsplit(url).port)
    except ValueError:
        return False


def is_pty(name: str) -> bool:
    """Whether a port is a pseudo-terminal: then no hardware is behind it."""
    return os.path.realpath(name).startswith("/dev/pts/")


def latency_timer(name: str) -> tuple[Path, int | None]:
    """Returns the file that says how long the FTDI adapter behind a port holds bytes back, and
    those milliseconds (16 as it comes: some 62 questions and answers a second); None for a port
    that has no such timer."""
    path = _TIMERS / Path(os.path.realpath(name)).name / "latency_timer"
    try:
        return path, int(path.read_text())
    except (OSError, ValueError):
        return path, None


def ports_here() -> list[str]:
    """Returns the serial ports that the system lists, `device (what it is)`; ptys are never among
    them."""
    from serial.tools import list_ports

    found = sorted(list_ports.comports(), key=lambda port: str(port.device))
    return [f"{port.device} ({port.description or 'n/a'})" for port in found]


_CAUSES = {
    errno.EACCES: Cause.PERMISSION,
    errno.EPERM: Cause.PERMISSION,
    errno.EBUSY: Cause.BUSY,
    errno.EAGAIN: Cause.BUSY,  # flock: another program holds it
    errno.EWOULDBLOCK: Cause.BUSY,
}


def _refused(url: str, error: BaseException) -> LineFault:
    number = getattr(error, "errno", None)
    cause = _CAUSES.get(number or 0, Cause.NO_PORT)
    if cause is Cause.BUSY:
        return LineFault(cause, f"{url} is in use by another program")
    if cause is Cause.PERMISSION:
        return LineFault(cause, f"{url} may not be opened by this user", _group_advice(url))
    here = ", ".join(ports_here()) or "none"
    if getattr(error.__context__, "args", ())[:1] == (errno.ENOTTY,):  # of termios, in pyserial's
        return LineFault(
            cause, f"{url} is there and is no serial port; ports here: {here}", "name one that is"
        )
    return LineFault(
        cause,
        f"no serial port answers to {url} ({_plain(error)}); ports here: {here}",
        "plug the board in, or name a port that is there (`viform board virtual` makes one)",
    )


def _group_advice(url: str) -> str:
    import grp

    try:
        group = grp.getgrgid(Path(url).stat().st_gid).gr_name
    except (OSError, KeyError):
        group = "dialout"
    if group == "root":
        group = "dialout"  # a rule of udev gives ports to it, not to root
    return f"join the group {group} (`sudo usermod -aG {group} $USER`) and log in anew"


def _plain(error: BaseException) -> str:
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(str(text).split())


def _bad_baud(url: str, baud: int) -> InputError:
    return InputError(
        f"the baud of {url}", "one that the adapter can make", str(baud), "give another --baud"
    )


def _bad_url(url: str, error: BaseException) -> InputError:
    return InputError(
        "a port",
        "a device or a URL of pyserial (/dev/ttyUSB0, socket://host:port, rfc2217://host:port)",
        f"{url!r} ({_plain(error)})",
        "name one",
    )
