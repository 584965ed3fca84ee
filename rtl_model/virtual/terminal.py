"""The pty of a virtual board: its master, the host's baud, and a link to its slave."""

from __future__ import annotations

import fcntl
import os
import struct
import termios
import tty
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from cosim import InputError

# struct termios2 of Linux (asm-generic/termbits.h): four words of flags, line discipline, 19
# control characters, input and output speed. Speeds are plain numbers, so any baud is possible.
_TERMIOS2 = struct.Struct("=4IB19B2I")
_TCGETS2 = 0x802C542A  # asm-generic/ioctls.h: _IOR('T', 0x2A, struct termios2)
_TCSETS2 = 0x402C542B
_CBAUD, _BOTHER = 0o010017, 0o010000
_PTYS = "/dev/pts/"


class Terminal:
    """An open pty. The slave stays open too, so that hosts may open and close it.

    Args:
        baud: initial rate of the slave, which applies to a host that sets none.
        link: symbolic link to create for the slave, None for none.

    Attributes:
        master: file descriptor of the master.
        slave: path of the slave.

    Raises:
        InputError: if the link cannot be created.
    """

    def __init__(self, baud: int, link: Path | None = None) -> None:
        try:
            self.master, self._slave = os.openpty()
        except OSError as exc:
            raise InputError(
                "/dev/pts", "mounted, for the port of a virtual board", f"refused ({exc.strerror})",
                "mount -t devpts devpts /dev/pts",
            ) from exc  # fmt: skip
        tty.setraw(self._slave)
        os.fchmod(self._slave, 0o600)  # most systems let programs of the group tty write to it
        os.set_blocking(self.master, False)
        self.slave = os.ttyname(self._slave)
        self._link: Path | None = None
        with suppress(OSError):
            _set_baud(self._slave, baud)
        self._nominal = baud
        if link is not None:
            self._link = link  # before it is made: `close` removes no link to another board
            try:
                _make_link(link, self.slave)
            except BaseException:
                self.close()
                raise

    @property
    def port(self) -> str:
        """Path that a host opens."""
        return self.slave if self._link is None else str(self._link)

    def baud(self) -> int:
        """The baud that the host has set; the initial one if the system does not provide it."""
        try:
            fields = _TERMIOS2.unpack(fcntl.ioctl(self.master, _TCGETS2, bytes(_TERMIOS2.size)))
        except OSError:
            return self._nominal
        speed: int = fields[-1]
        return speed or self._nominal

    def read(self, count: int) -> bytes:
        """Reads at most `count` bytes that the host has sent."""
        try:
            return os.read(self.master, count)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """Writes to the host; returns the number of accepted bytes."""
        try:
            return os.write(self.master, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Closes both ends, and removes the link unless another board has replaced it."""
        if self._link is not None:
            with suppress(OSError):
                if os.readlink(self._link) == self.slave:
                    self._link.unlink()
            self._link = None
        for end in (self.master, self._slave):
            with suppress(OSError):
                os.close(end)

    def __enter__(self) -> Terminal:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _set_baud(end: int, baud: int) -> None:
    fields = list(_TERMIOS2.unpack(fcntl.ioctl(end, _TCGETS2, bytes(_TERMIOS2.size))))
    fields[2] = fields[2] & ~(_CBAUD | _CBAUD << 16) | _BOTHER
    fields[-2] = 0  # the input is as fast as the output
    fields[-1] = baud
    fcntl.ioctl(end, _TCSETS2, _TERMIOS2.pack(*fields))
    termios.tcflush(end, termios.TCIOFLUSH)


def _make_link(link: Path, slave: str) -> None:
    """Creates a symbolic link. It replaces only the stale link of an ended board."""
    stale = link.is_symlink() and os.readlink(link).startswith(_PTYS)
    if (link.is_symlink() or link.exists()) and not (stale and not _alive(link)):
        raise InputError(
            "the link to the board",
            "a new name",
            f"{link}, which exists",
            "choose another, or end the board that uses it",
        )
    part = link.with_name(f".{link.name}.{os.getpid()}")
    try:
        part.symlink_to(slave)
        os.replace(part, link)
    except OSError as exc:
        raise InputError(
            "the link to the board",
            "a name that can be written",
            f"refused ({exc.strerror or exc})",
            "choose another name",
        ) from exc


def _alive(link: Path) -> bool:
    return link.exists()
