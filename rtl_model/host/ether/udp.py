"""The socket to a board, named `udp:HOST` or `udp:HOST:PORT`."""

from __future__ import annotations

import errno
import ipaddress
import select
import socket
import time
from contextlib import suppress
from typing import NamedTuple

from cosim import InputError
from rtl_model.host.faults import Cause, LineFault

DEFAULT_PORT = 1234
"""UDP port of Etherbone in LiteX and LiteEth."""

_PREFIX = "udp:"
_MOST = 65_535
_BUFFER = 1 << 21  # bytes asked of the system for each direction
_FORMS = "udp:HOST or udp:HOST:PORT, such as udp:192.168.1.50 or udp:[::1]:1234"


class UdpAddress(NamedTuple):
    """Host and port of `udp:HOST:PORT`.

    Attributes:
        host: name or address.
        port: 1 to 65535.
    """

    host: str
    port: int

    @property
    def url(self) -> str:
        """The name with its port."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{_PREFIX}{host}:{self.port}"


def is_udp(url: str) -> bool:
    """Whether the name of a port is that of a board over UDP."""
    return url.lower().startswith(_PREFIX)


def udp_address(url: str, *, least_port: int = 1) -> UdpAddress:
    """Parses `udp:HOST[:PORT]`; raises InputError.

    Args:
        url: the text.
        least_port: 0 if the system may choose the port.
    """
    rest = url[len(_PREFIX) :].removeprefix("//")
    if rest.startswith("["):
        host, bracket, rest = rest[1:].partition("]")
        colon, _, text = rest.rpartition(":")
        good = bool(bracket) and not colon and (not rest or rest.startswith(":"))
        text = text if rest else str(DEFAULT_PORT)
    else:
        host, colon, text = rest.partition(":")
        good, text = True, text if colon else str(DEFAULT_PORT)
    if not host or not good or not host.isprintable() or any(c.isspace() for c in host):
        raise InputError("a port over UDP", _FORMS, repr(url[:80]), "name host and port")
    number = int(text) if text.isascii() and text.isdecimal() and len(text) < 6 else -1
    if not least_port <= number <= _MOST:
        raise InputError(
            f"the port of {_PREFIX}{host}", f"a number from {least_port} to {_MOST}",
            repr(text[:40]), f"leave it out for {DEFAULT_PORT}, Etherbone's",
        )  # fmt: skip
    return UdpAddress(host, number)


def is_loopback(url: str) -> bool:
    """Whether a name is a loopback address, behind which there is no hardware."""
    host = udp_address(url).host
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def resolved(address: UdpAddress) -> tuple[socket.AddressFamily, tuple[object, ...]]:
    """Family and address of the system for a host. Raises InputError if it is not found."""
    try:
        found = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as exc:
        why = getattr(exc, "strerror", None) or "not a name of a host"
        raise InputError(
            f"the host of {address.url}", "a name or an address that is found", f"unknown ({why})",
            "check the spelling, or give the board's IP address",
        ) from exc  # fmt: skip
    return found[0][0], found[0][4]


class UdpPort:
    """A socket that exchanges datagrams with one board.

    LiteEth answers to the port that it listens on, whatever the sender's port is. So the local port
    has the same number, unless the board is on this machine or the port is in use.

    Attributes:
        name: name for messages.
        same_port: whether LiteEth's answers arrive here.
    """

    def __init__(self, address: UdpAddress) -> None:
        self.name = address.url
        family, place = resolved(address)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        try:
            for option in (socket.SO_RCVBUF, socket.SO_SNDBUF):
                self._socket.setsockopt(socket.SOL_SOCKET, option, _BUFFER)
            self.same_port = not is_loopback(self.name) and self._bind(family, address.port)
            self._socket.connect(place)
            self._socket.setblocking(False)
        except OSError as exc:
            self._socket.close()
            raise InputError(
                f"{self.name}", "an address that can be reached", f"refused ({exc.strerror})",
                "check the network and the address",
            ) from exc  # fmt: skip
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)
        self.refused = False

    def _bind(self, family: socket.AddressFamily, port: int) -> bool:
        with suppress(OSError):
            self._socket.bind(("::" if family == socket.AF_INET6 else "0.0.0.0", port))
            return True
        return False

    def send(self, data: bytes) -> None:
        """Sends a datagram, or loses it if the system's buffer is full. Raises LineFault GONE."""
        try:
            self._socket.send(data)
        except (BlockingIOError, ConnectionRefusedError) as exc:
            self.refused = self.refused or isinstance(exc, ConnectionRefusedError)
        except OSError as exc:
            raise self._gone(exc) from exc

    def receive(self, deadline_s: float) -> bytes | None:
        """The next datagram; None if none arrives within `deadline_s` seconds.

        `refused` is set if the system learnt that no program listens there. Raises LineFault GONE.
        """
        for wait in (True, False):
            try:
                return self._socket.recv(65_536)
            except BlockingIOError:
                if not wait or deadline_s <= 0 or not self._poll.poll(deadline_s * 1e3):
                    return None
            except ConnectionRefusedError:
                self.refused = True
                return None
            except OSError as exc:
                raise self._gone(exc) from exc
        return None

    def now(self) -> float:
        """The system's monotonic time, s."""
        return time.monotonic()

    def close(self) -> None:
        """Closes the socket."""
        self._socket.close()

    def _gone(self, error: OSError) -> LineFault:
        if error.errno in (errno.ENETUNREACH, errno.EHOSTUNREACH, errno.ENETDOWN):
            return LineFault(
                Cause.GONE, f"the network to {self.name} is unreachable",
                "check cable, address and netmask",
            )  # fmt: skip
        return LineFault(Cause.GONE, f"{self.name} failed ({error.strerror})")


def open_udp(url: str) -> UdpPort:
    """Opens the socket to a board. Nothing is sent.

    Raises InputError for a malformed name or a host that is not found.
    """
    return UdpPort(udp_address(url))
