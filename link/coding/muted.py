"""Calls whose own lines on standard error nobody is to see.

A fault of a library in Rust arrives as an exception, but the library writes its lines to descriptor
2 before, and only Rust code could stop it. To point the descriptor elsewhere for the time of a call
would take the lines of other threads and of children that they start. So the call is made in a
thread with a table of descriptors of its own: `close_range` with CLOSE_RANGE_UNSHARE copies the
table for the calling thread alone (Linux 5.9, close_range(2)). It also closes the copies, so that
no pipe and no file stays open for the time of the call. The thread ends with the call, because a
fork would lose one that waits for the next. A child process would do as well, but takes 50 ms to
start and holds the data twice.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from concurrent.futures import Future
from threading import Thread
from typing import Final, ParamSpec, TypeVar

_UNSHARE: Final = 2
"""CLOSE_RANGE_UNSHARE (linux/close_range.h)."""
_P = ParamSpec("_P")
_T = TypeVar("_T")


def muted(function: Callable[_P, _T], *args: _P.args, **options: _P.kwargs) -> _T:
    """Calls a function that opens no file of ours, and returns or raises what it does.

    What it writes to standard error is lost; where the system lacks the call, it is seen. A call
    takes about 0.1 ms more.
    """
    outcome: Future[_T] = Future()

    def call() -> None:
        try:
            _turn_away()
            outcome.set_result(function(*args, **options))
        except BaseException as exc:  # a panic is no Exception
            outcome.set_exception(exc)

    thread = Thread(target=call)
    thread.start()
    thread.join()
    return outcome.result()


def _turn_away() -> None:
    """Gives this thread a table of descriptors with standard error on nothing."""
    try:
        close_range = ctypes.CDLL(None).close_range
    except AttributeError:  # glibc before 2.34
        return
    close_range.argtypes = (ctypes.c_uint, ctypes.c_uint, ctypes.c_int)
    if close_range(3, ~0 & 0xFFFF_FFFF, _UNSHARE) == 0:  # else the table is that of all threads
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
