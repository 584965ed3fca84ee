"""Where the bytes of a camera's stream come from: a file that grows, a pipe, or standard input."""

from __future__ import annotations

import os
import select
import shlex
import stat
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, Protocol

from cosim import InputError
from cosim.run.inputs import FILE, PIPE, STANDARD_INPUT

_LOOK_S: Final = 0.01
"""Time between two looks at a file that has not grown, s: no call tells of growth everywhere."""
_SAMPLE: Final = 64
"""Bytes of a sample, by which a file that is written anew is told from one that grows."""
_SAMPLES: Final = 64
"""Samples of a file that are kept."""


class Origin(Protocol):
    """A source of bytes.

    Attributes:
        name: the source in words, for messages.
        end: why nothing more comes, in words; "" until then.
    """

    name: str
    end: str

    def fetch(self, most: int, wait_s: float) -> bytes:
        """The next bytes.

        Args:
            most: number of bytes that are wanted.
            wait_s: how long the call may wait for the first of them, s.

        Returns:
            One to `most` bytes; none if none has come, or if the source has ended, which `end`
            says.

        Raises:
            InputError: the source has lost bytes that were not read yet, or cannot be read.
        """
        ...

    def skip(self, count: int) -> None:
        """Leaves out the first bytes, which an interrupted run has read. Raises InputError for a
        source that cannot be read again, or that is shorter."""
        ...

    def sample(self, count: int) -> bytes:
        """Some of the first `count` bytes, by which a run that goes on knows them again; none of a
        source that cannot be read again."""
        ...

    def close(self) -> None: ...


def _unreadable(name: str, exc: OSError) -> InputError:
    return InputError("sensor.source", "readable", f"{name} ({exc.strerror})", "check it")


class GrowingFile:
    """A file that another program writes; implements `Origin`.

    It ends when it has not grown for `timeout_s`. It is read as the file that was opened: one that
    was moved away or deleted is read to its end. A file that takes its place, or that is written
    anew in its place, is another recording and is refused.

    Args:
        path: the file.
        timeout_s: time without growth after which it ends, s.
        now: a clock, s.
        sleep: waits for a time, s.

    Raises:
        InputError: there is no such file.
    """

    def __init__(
        self, path: Path, timeout_s: float, now: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:  # fmt: skip
        self.name, self.end, self._at = str(path), "", 0
        self._path = path
        self._samples: list[tuple[int, bytes]] = []  # where, and what was read there
        self._apart, self._checked = 1, 0  # bytes between samples, time of the file at a check
        self._timeout, self._now, self._sleep = timeout_s, now, sleep
        try:
            kind = path.stat().st_mode
            if not stat.S_ISREG(kind):
                what = "a folder" if stat.S_ISDIR(kind) else "no regular file"
                remedy = f"write pipe:{path}" if stat.S_ISFIFO(kind) else "name a file"
                raise InputError(
                    "sensor.source", "a file that grows, with sensor.source_timeout",
                    f"{path}, {what}", remedy,
                )  # fmt: skip
            self._file = os.open(path, os.O_RDONLY)
        except FileNotFoundError:
            raise InputError("sensor.source", "a file that exists", str(path), "check the path") \
                from None  # fmt: skip
        except OSError as exc:
            raise _unreadable(self.name, exc) from exc
        self._grown = now()

    def fetch(self, most: int, wait_s: float) -> bytes:
        """See `Origin`."""
        until = self._now() + wait_s
        while not self.end:
            size = self._size()
            if size > self._at:
                data = os.pread(self._file, min(most, size - self._at), self._at)
                self._check_samples()
                self._keep_sample(data)
                self._at += len(data)
                self._grown = self._now()
                return data
            gone = self._gone()
            now = self._now()
            if now - self._grown >= self._timeout:
                self.end = f"it has not grown for {self._timeout:g} s{gone}"
            elif now >= until:
                break
            else:
                self._sleep(max(min(_LOOK_S, until - now), 0))
        return b""

    def _other(self, what: str) -> InputError:
        """The refusal of a file that is not the one that was opened."""
        return InputError(
            "sensor.source", "a file that only grows",
            f"{self.name}, which {what} after {self._at} bytes were read",
            "let its writer append, and start again with another --out",
        )  # fmt: skip

    def _gone(self) -> str:
        """What has become of a file that has been read to its end, in words; "" if it is there.
        Raises InputError if another file has its name."""
        opened = os.fstat(self._file)
        if opened.st_mtime_ns != self._checked:
            self._check_samples()
            self._checked = opened.st_mtime_ns
        try:
            named = self._path.stat()
        except OSError:
            return ", and it was deleted" if not opened.st_nlink else ", and it was moved away"
        if (named.st_dev, named.st_ino) != (opened.st_dev, opened.st_ino):
            raise self._other("was replaced by another file")
        return ""

    def _keep_sample(self, data: bytes) -> None:
        """Keeps the end of what has been read, if the last sample is far enough away. Samples are
        spread over the file: when there are too many, every other is dropped."""
        if not data or (self._samples and self._at - self._samples[-1][0] < self._apart):
            return
        part = data[-_SAMPLE:]
        self._samples.append((self._at + len(data) - len(part), part))
        if len(self._samples) > _SAMPLES:
            del self._samples[1::2]
            self._apart = (self._at + len(data)) * 2 // _SAMPLES

    def _check_samples(self) -> None:
        """Raises InputError if what has been read is not in the file any more."""
        for at, part in self._samples:
            if os.pread(self._file, len(part), at) != part:
                raise self._other("was written anew")

    def _size(self) -> int:
        size = os.fstat(self._file).st_size
        if size < self._at:
            raise InputError(
                "sensor.source", "a file that only grows",
                f"{self.name}, which shrank to {size} bytes after {self._at} were read",
                "let its writer append, and start again with another --out",
            )  # fmt: skip
        return size

    def skip(self, count: int) -> None:
        """See `Origin`."""
        size = os.fstat(self._file).st_size
        if size < count:
            raise InputError(
                "--resume", f"given with the file that was read, of at least {count} bytes",
                f"{self.name} has {size}", "start again with another --out",
            )  # fmt: skip
        self._at, self._grown = count, self._now()

    def sample(self, count: int) -> bytes:
        """See `Origin`."""
        places = (0, count // 2, max(count - _SAMPLE, 0))
        return b"".join(os.pread(self._file, min(_SAMPLE, count - at), at) for at in places)

    def close(self) -> None:
        os.close(self._file)


class Pipe:
    """A named pipe, a character device or standard input; implements `Origin`.

    It ends when its writer closes it. Only what is asked for is read: a faster writer is held back
    by the pipe, as soon as that is full. A named pipe without a writer is waited for.

    Args:
        path: the pipe; "-" for standard input.
        timeout_s: time without a byte after which it ends, s; None to wait for the writer.
        now: a clock, s.

    Raises:
        InputError: there is no such pipe, or it is a terminal.
    """

    def __init__(
        self, path: str, timeout_s: float | None = None, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.end, self._timeout, self._now = "", timeout_s, now
        self._own = path != STANDARD_INPUT
        self.name = path if self._own else "standard input"
        self._file = self._opened(path) if self._own else self._standard_input()
        self._poll = select.poll()
        self._poll.register(self._file, select.POLLIN)
        self._came = now()

    def _opened(self, path: str) -> int:
        try:
            kind = os.stat(path).st_mode
        except FileNotFoundError:
            raise InputError(
                "sensor.source", "a pipe that exists", path, f"make it: mkfifo {shlex.quote(path)}"
            ) from None
        except OSError as exc:
            raise _unreadable(path, exc) from exc
        if not (stat.S_ISFIFO(kind) or stat.S_ISCHR(kind)):
            what = "a folder" if stat.S_ISDIR(kind) else "no pipe"
            remedy = f"write {FILE}{path}" if stat.S_ISREG(kind) else "name a pipe made with mkfifo"
            raise InputError("sensor.source", "a named pipe", f"{path}, {what}", remedy)
        try:
            file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
        except OSError as exc:
            raise _unreadable(path, exc) from exc
        if os.isatty(file):
            os.close(file)
            raise InputError(
                "sensor.source", "a named pipe", f"{path}, a terminal",
                "name a pipe made with mkfifo",
            )  # fmt: skip
        return file

    def _standard_input(self) -> int:
        remedy = "send planes to it: cat x.dat | viform run ..."
        try:
            file = 0 if sys.stdin is None else sys.stdin.fileno()
            kind = os.fstat(file).st_mode
        except (OSError, ValueError):  # closed, or of a program without one
            raise InputError("standard input", "open", "closed", remedy) from None
        if stat.S_ISDIR(kind):
            raise InputError("standard input", "a pipe or a file", "a folder", remedy)
        if os.isatty(file):
            raise InputError("standard input", "a pipe or a file", "a terminal", remedy)
        return file

    def fetch(self, most: int, wait_s: float) -> bytes:
        """See `Origin`."""
        if self.end:
            return b""
        try:
            events = self._poll.poll(round(wait_s * 1e3))
            data = os.read(self._file, most) if events and events[0][1] & select.POLLIN else b""
        except BlockingIOError:  # another reader was faster
            return b""
        except OSError as exc:
            raise _unreadable(self.name, exc) from exc
        now = self._now()
        if data:
            self._came = now
        elif events:  # a pipe that is ready without data has no writer any more
            self.end = "its writer has closed it" if self._own else "it has ended"
        elif self._timeout is not None and now - self._came >= self._timeout:
            self.end = f"nothing has come for {self._timeout:g} s"
        return data

    def skip(self, count: int) -> None:
        """See `Origin`."""
        if count:
            raise InputError(
                "--resume", "given with a source that can be read again", f"given with {self.name}",
                "start again with another --out",
            )  # fmt: skip

    def sample(self, count: int) -> bytes:
        """See `Origin`."""
        return b""

    def close(self) -> None:
        if self._own:
            os.close(self._file)


def open_origin(source: str, timeout_s: float | None) -> Origin:
    """The source that a `sensor.source` names. Raises InputError.

    Args:
        source: file:PATH, pipe:PATH or pipe:-.
        timeout_s: `sensor.source_timeout`; given with a file.
    """
    if source.startswith(PIPE):
        return Pipe(source.removeprefix(PIPE), timeout_s)
    assert timeout_s is not None  # else the file is read as it is
    return GrowingFile(Path(source.removeprefix(FILE)), timeout_s)
