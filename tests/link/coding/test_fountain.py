"""Calls whose lines on standard error are lost, and nobody else's.

A delivered name stays in its folder.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import PurePosixPath, PureWindowsPath
from threading import Event, Thread

import pytest
from hypothesis import given
from hypothesis import strategies as st

from link.coding import safe_name
from link.coding.fountain import muted


def test_the_result_and_what_is_raised_come_back() -> None:
    assert muted(divmod, 7, 2) == (3, 1)
    assert muted(int, "11", base=2) == 3
    with pytest.raises(KeyboardInterrupt, match="x"):
        muted(_raise, KeyboardInterrupt("x"))


def _raise(error: BaseException) -> None:
    raise error


def test_lines_of_the_call_are_lost_and_those_of_other_threads_are_not(
    capfd: pytest.CaptureFixture[str],
) -> None:
    within, written = Event(), Event()

    def call() -> None:
        os.write(2, b"of the call\n")
        within.set()
        assert written.wait(60)

    def other() -> None:
        assert within.wait(60)
        os.write(2, b"of another thread\n")
        written.set()

    thread = Thread(target=other)
    thread.start()
    muted(call)
    thread.join()
    os.write(2, b"after it\n")
    assert capfd.readouterr().err == "of another thread\nafter it\n"


def test_no_descriptor_stays_open_in_the_call(capfd: pytest.CaptureFixture[str]) -> None:
    """The reader of a pipe has its end while the call still runs."""
    read, write = os.pipe()
    before, ended = set(os.listdir("/proc/self/fd")), Event()

    def call() -> None:
        assert ended.wait(60)

    thread = Thread(target=muted, args=(call,))
    thread.start()
    _until_unshared(thread)
    os.close(write)
    assert os.read(read, 1) == b""
    ended.set()
    thread.join()
    os.close(read)
    assert set(os.listdir("/proc/self/fd")) <= before
    sys.stderr.flush()
    assert capfd.readouterr().err == ""


def _until_unshared(caller: Thread) -> None:
    """Waits until a thread of this process has no descriptor beyond the third."""
    while caller.is_alive():
        for task in os.listdir("/proc/self/task"):
            with suppress(FileNotFoundError):  # another thread has ended
                if {int(n) for n in os.listdir(f"/proc/self/task/{task}/fd")} <= {0, 1, 2, 3}:
                    return
    raise AssertionError("the call must run until it is told to end")


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("photo.jpg", "photo.jpg"),
        ("/etc/passwd", "passwd"),
        ("../../x.py", "x.py"),
        ("..\\..\\x.py", "x.py"),
        ("..", "file"),
        (".", "file"),
        ("", "file"),
        ("a/", "file"),
        ("C:x", "C_x"),
        ("con.txt", "filecon.txt"),
        ("a\x00b\n\u202egpj.exe", "a_b__gpj.exe"),
        ("照片.jpg", "照片.jpg"),
        ("x" * 300 + ".tar", "x" * 116 + ".tar"),
    ],
)
def test_names(given, name):
    assert safe_name(given) == name


@given(st.text(max_size=400))
def test_any_text_is_one_part_of_a_path(text):
    name = safe_name(text)
    assert 0 < len(name.encode()) <= 120
    assert name not in (".", "..") and name.isprintable()
    assert PurePosixPath(name).parts == (name,) and PureWindowsPath(name).parts == (name,)
    assert safe_name(name) == name
