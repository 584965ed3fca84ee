"""The pty a virtual board stands behind: its master, the host's baud, and a link to its slave."""

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

__all__ = ["Terminal"]

# struct termios2 of Linux (asm-generic/termbits.h): four words of flags, line discipline, 19
# control characters, input and output speed. Its speeds are plain numbers, custom ones too.
_TERMIOS2 = struct.Struct("=4IB19B2I")
_TCGETS2 = 0x802C542A  # asm-generic/ioctls.h: _IOR('T', 0x2A, struct termios2)
_TCSETS2 = 0x402C542B
_CBAUD, _BOTHER = 0o010017, 0o010000
_SPEED = 22  # place of c_ospeed among the fields
_PTYS = "/dev/pts/"


class Terminal:
    """An open pty. The slave is held open too, so that a host may come and go.

    baud: what the slave is set to at first: a host that sets none speaks at the board's own.
    link: symlink to make for the slave; None makes none.
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
        os.set_blocking(self.master, False)
        self.slave = os.ttyname(self._slave)
        self._link: Path | None = None
        with suppress(OSError):
            _set_baud(self._slave, baud)
        self._nominal = baud
        if link is not None:
            try:
                _make_link(link, self.slave)
            except InputError:
                self.close()
                raise
            self._link = link

    @property
    def port(self) -> str:
        """What a host opens."""
        return self.slave if self._link is None else str(self._link)

    def baud(self) -> int:
        """Returns the baud that the host has set, custom ones too; the board's where the system
        does not tell."""
        try:
            fields = _TERMIOS2.unpack(fcntl.ioctl(self.master, _TCGETS2, bytes(_TERMIOS2.size)))
        except OSError:
            return self._nominal
        speed: int = fields[-1]
        return speed or self._nominal

    def read(self, count: int) -> bytes:
        """Returns what the host has sent, at most `count` bytes."""
        try:
            return os.read(self.master, count)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """Returns how many bytes the host's side took."""
        try:
            return os.write(self.master, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Closes both ends and removes the link, where it is still ours."""
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
    """Makes a symlink; one that an ended board has left is replaced, nothing else."""
    stale = link.is_symlink() and os.readlink(link).startswith(_PTYS)
    if (link.is_symlink() or link.exists()) and not (stale and not _alive(link)):
        raise InputError(
            "the link to the board",
            "a new name",
            f"{link}, which is there",
            "choose another, or end the board that has it",
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
