"""A signal ends a command in time, whatever it computes."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from contextlib import suppress

import pytest

from cosim.compute import stopping
from cosim.compute.stopping import Stopped, heed, threads

DEAF = """
import ctypes, sys, threading
from cosim.compute import stopping
from cosim.compute.stopping import end_on_signals, finishing, undone

stopping.GRACE_S = 0.1
end_on_signals()
with undone("interrupted within a step; go on with --resume"):
    if sys.argv[1] == "saves":
        with finishing():
            print("ready", flush=True)
            sys.stdin.readline()  # its signal is ignored below
            print("saved", flush=True)
    else:
        print("ready", flush=True)
    while True:
        ctypes.CDLL(None).sleep(600)  # a signal ends it, and the next one begins
"""
"""A process that no signal ends: its handler does nothing."""


def deaf(how: str) -> subprocess.Popen[str]:
    """The process, once it waits."""
    command = [
        sys.executable,
        "-c",
        "import signal; signal.signal(15, lambda *_: None)\n" + DEAF,
        how,
    ]
    pipe = subprocess.PIPE
    child = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True)
    assert child.stdout is not None and child.stdout.readline() == "ready\n"
    return child


def test_a_deaf_process_is_cut_off_and_says_how_to_resume():
    child = deaf("computes")
    child.send_signal(signal.SIGTERM)
    _, said = child.communicate(timeout=60)
    assert child.returncode == 130
    assert said == "viform: interrupted within a step; go on with --resume\n"


def test_a_checkpoint_that_is_being_written_is_not_cut_off():
    child = deaf("saves")
    child.send_signal(signal.SIGTERM)
    assert child.stderr is not None
    assert child.stderr.readline().startswith("viform: saving what is done")
    out, said = child.communicate("go on\n", timeout=60)
    assert (child.returncode, out) == (130, "saved\n")
    assert said == "viform: interrupted within a step; go on with --resume\n"


SAVING = """
import signal, time
from cosim.compute.stopping import end_on_signals, interrupt, undone

signal.signal(signal.SIGTERM, interrupt)
end_on_signals()
try:
    with undone("interrupted; go on with --resume"):
        print("ready", flush=True)
        time.sleep(600)
except KeyboardInterrupt:
    print("saving", flush=True)
    time.sleep(600)
"""


def test_who_interrupts_again_and_again_is_told_how_to_resume():
    """A second signal does not interrupt what the first one left to do: it ends the process."""
    pipe = subprocess.PIPE
    child = subprocess.Popen([sys.executable, "-c", SAVING], stdout=pipe, stderr=pipe, text=True)
    assert child.stdout is not None and child.stdout.readline() == "ready\n"
    child.send_signal(signal.SIGTERM)
    assert child.stdout.readline() == "saving\n"
    for _ in range(2):
        child.send_signal(signal.SIGTERM)
    _, said = child.communicate(timeout=60)
    assert (child.returncode, said) == (130, "viform: interrupted; go on with --resume\n")


def test_work_that_fails_is_not_named_by_a_later_interrupt():
    """As one point of a sweep that goes on after it."""
    before = stopping._ending.undone
    with suppress(ValueError), stopping.undone("go on in the folder of a point"):
        raise ValueError
    assert stopping._ending.undone == before


def test_nobody_waits_for_a_pool_after_an_interrupt_and_its_work_is_told():
    began, told, free = threading.Event(), threading.Event(), threading.Event()

    def work() -> None:
        began.set()
        try:
            while True:
                heed()
        except Stopped:
            told.set()
            free.wait(60)

    def outer() -> None:
        with threads(1) as inner:
            inner.submit(work).result()

    with pytest.raises(KeyboardInterrupt), threads(1) as pool:
        pool.submit(outer)
        began.wait(60)
        raise KeyboardInterrupt
    assert told.wait(60)  # the work has not ended, and the pool was left
    free.set()


def test_a_pool_waits_for_its_work():
    done = []
    with threads(2) as pool:
        pool.submit(done.append, 1)
    heed()  # in a thread of no pool
    assert done == [1] and stopping.GRACE_S < 2
