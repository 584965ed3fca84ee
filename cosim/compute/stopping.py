"""Ends a command within two seconds of SIGINT or SIGTERM, whatever it computes.

Python runs a handler between two steps of the main thread's interpreter: not while that thread is
in compiled code, and a pool of threads that it leaves waits for their work. Here a thread hears the
signals, as the C handler writes their numbers into a pipe at once. What the command does in GRACE_S
is its ordinary end: it saves and says how to resume. What is not done then is cut off, but for a
checkpoint that is being written (`finishing`). So compiled functions must release the interpreter
(`nogil`): this thread needs it.

`threads` is a pool that nobody waits for after an error or an interrupt. Its work is told (`heed`):
a long one asks between its pieces.
"""

from __future__ import annotations

import atexit
import os
import select
import signal
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NoReturn

GRACE_S: Final = 1.5
"""Time between a signal and the end of the process, s."""
_AGAIN_S: Final = 0.2
"""Time after a second signal that cuts off a checkpoint as well, s."""
_NUMBERS: Final = (signal.SIGINT, signal.SIGTERM)
_CODE: Final = 130
"""Exit code of an interrupted command."""
_pools = threading.local()
"""`given_up`: events of the pools that the work of this thread belongs to."""


class Stopped(Exception):
    """The pool of this work was given up; nobody reads its result."""


def heed() -> None:
    """Raises Stopped in a thread of a pool that was given up. Long work calls it between pieces."""
    if any(event.is_set() for event in getattr(_pools, "given_up", ())):
        raise Stopped


@contextmanager
def threads(count: int | None = None, name: str = "") -> Iterator[ThreadPoolExecutor]:
    """A pool of threads. It waits for its work, but not after an exception.

    Args:
        count: number of threads, by default that of the executor.
        name: prefix of their names.
    """
    own = threading.Event()
    around: tuple[threading.Event, ...] = getattr(_pools, "given_up", ())

    def begin() -> None:
        _pools.given_up = (*around, own)

    pool = ThreadPoolExecutor(count, name, begin)
    try:
        yield pool
        pool.shutdown()
    except BaseException:
        own.set()
        pool.shutdown(wait=False, cancel_futures=True)
        raise


class _Ending:
    """The end of this process after a signal.

    Attributes:
        finishing: number of writes that are not cut off.
        undone: what is lost, and how to resume; the line of a command that is cut off.
        said: whether the command has told the user.
        hears: whether a thread hears the signals.
        asked: whether there was one.
        handled: whether a handler of this process has seen one.
    """

    def __init__(self) -> None:
        self.finishing, self.undone, self.said = 0, "interrupted", False
        self.hears = self.asked = self.handled = False

    def listen(self, pipe: int) -> None:
        """Ends the process some time after a signal whose number comes through the pipe."""
        asked, due, noted, saving = 0, float("inf"), False, False
        while True:
            wait = None if not asked else max(due - time.monotonic(), 0.0)
            if select.select([pipe], [], [], wait)[0]:
                for number in os.read(pipe, 256):
                    if number in _NUMBERS:
                        asked, self.asked = asked + 1, True
                        due = time.monotonic() + (GRACE_S if asked == 1 else _AGAIN_S)
            elif self.finishing and asked == 1:
                if not noted:
                    noted = self.say("saving what is done; a second signal ends without it")
                saving, due = True, time.monotonic() + _AGAIN_S
            elif saving and asked == 1:  # saved: now comes the ordinary end
                saving, due = False, time.monotonic() + GRACE_S
            else:
                self.cut()

    def say(self, text: str) -> bool:
        """Writes a line past the locks of Python's files, which another thread may hold."""
        shown = "\033[?25h\n" if sys.stderr is not None and sys.stderr.isatty() else ""
        with suppress(OSError, ValueError):
            os.write(2, f"{shown}viform: {text}\n".encode())
        return True

    def cut(self) -> NoReturn:
        """Ends this process and its children now."""
        if not self.said:
            self.say(self.undone)
        for child in _children():
            with suppress(OSError):
                os.kill(child, signal.SIGKILL)
        os._exit(_CODE)


def _children() -> list[int]:
    """Processes that this one has started and that have not ended."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError, ValueError):
            fields = stat.read_text(encoding="utf-8", errors="replace").rpartition(")")[2].split()
            if int(fields[1]) == os.getpid() and fields[0] != "Z":
                found.append(int(stat.parent.name))
    return found


_ending = _Ending()


def end_on_signals() -> None:
    """From now on this process ends GRACE_S after a SIGINT or SIGTERM at the latest. In the main
    thread, after the handlers of these signals are set; not for a process of the user's."""
    read, write = os.pipe()
    os.set_blocking(write, False)
    signal.set_wakeup_fd(write, warn_on_full_buffer=False)
    _ending.hears = True
    # A child would write its own signals into this pipe.
    os.register_at_fork(after_in_child=_forget)
    threading.Thread(target=_ending.listen, args=(read,), name="signals", daemon=True).start()


def ending() -> bool:
    """Whether this process ends after a signal that was heard: errors of what was interrupted are
    none."""
    return _ending.hears and (_ending.asked or _ending.handled)


def first_signal() -> bool:
    """For handlers: whether this signal is the first, and interrupts. A further one must not
    interrupt what is left to do: the thread that hears them ends the process soon. Always true in a
    process of the user's, which has no such thread."""
    before, _ending.handled = _ending.handled, True
    return not (before and _ending.hears)


def interrupt(*_: object) -> None:
    """A handler of SIGINT and SIGTERM: the first signal raises KeyboardInterrupt."""
    if first_signal():
        raise KeyboardInterrupt


def end_now() -> NoReturn:
    """Ends this process and its children now, and says what is undone."""
    _ending.cut()


def leave(code: int) -> NoReturn:
    """Ends the process as `sys.exit` does, but leaves threads where they are: those of libraries
    that still run would abort it while the interpreter is taken down."""
    with suppress(Exception):
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            stream.flush()
    os._exit(code)


def _forget() -> None:
    _ending.hears = False
    with suppress(ValueError):  # forked by another thread than the main one
        signal.set_wakeup_fd(-1)


@contextmanager
def finishing() -> Iterator[None]:
    """A write that a signal does not cut off, such as that of a checkpoint."""
    _ending.finishing += 1
    try:
        yield
    finally:
        _ending.finishing -= 1


@contextmanager
def undone(line: str) -> Iterator[None]:
    """Work that leaves something to resume if it is cut off.

    line: what the user is told then.
    """
    before, _ending.undone = _ending.undone, line
    try:
        yield
    finally:
        if not ending():  # after a signal it stays undone while the command unwinds
            _ending.undone = before


def said() -> None:
    """The user was told of the interruption: only the end of the process is left."""
    _ending.said = True
