"""Time limits that count no interruption of the host, at the ports and without them."""

import os
import pty
import threading
import time
import tty
from itertools import chain, repeat

import pytest

from rtl_model.bringup.bench.deadline import DeadlinePort, OutOfTime
from rtl_model.host import Cause, LineFault, open_port
from rtl_model.host.countdown import Countdown
from rtl_model.host.ether.exchange import Exchange


class Clock:
    """A clock that another thread or a test advances."""

    def __init__(self):
        self.time = 100.0

    def __call__(self):
        return self.time


def test_a_long_step_counts_as_the_longest_one():
    clock = Clock()
    limit = Countdown(1.0, 0.25, clock)
    clock.time += 0.125
    assert limit.left() == 0.875
    clock.time += 3600.0
    assert limit.left() == 0.625
    for _ in range(3):
        clock.time += 0.25
        limit.left()
    assert (limit.left(), limit.spent) == (-0.125, 1.125)
    limit.restart()
    assert limit.left() == 1.0


@pytest.fixture
def terminal():
    master, slave = pty.openpty()
    tty.setraw(slave)
    port = open_port(os.ttyname(slave), 115_200)
    yield master, port
    port.close()
    os.close(master)
    os.close(slave)


@pytest.fixture
def interrupted(monkeypatch):
    """Limits that begin from now on are over by an hour at their first look."""

    def begin():
        for module in ("host.ports", "bringup.bench.deadline"):
            monkeypatch.setattr(f"rtl_model.{module}.Countdown", after_an_hour)

    def after_an_hour(seconds, longest_s):
        hours = chain([0.0], repeat(3600.0))
        return Countdown(seconds, longest_s, lambda: time.monotonic() + next(hours))

    return begin


def test_an_answer_after_an_interruption_is_taken(terminal, interrupted):
    master, port = terminal
    interrupted()
    threading.Timer(0.05, os.write, (master, b"answer")).start()
    assert port.read(6, 5.0) == b"answer"


def test_a_write_goes_on_after_an_interruption(terminal, interrupted):
    """More bytes than the pty holds, which the other end takes later."""
    master, port = terminal
    sent, got = os.urandom(40_000), bytearray()

    def take():
        while len(got) < len(sent):
            got.extend(os.read(master, 4096))

    reader = threading.Timer(0.05, take)
    interrupted()
    reader.start()
    port.write(sent, 5.0)
    reader.join()
    assert bytes(got) == sent


def test_a_stage_goes_on_after_an_interruption_and_ends(terminal, interrupted):
    guarded = DeadlinePort(terminal[1])
    interrupted()
    guarded.allow(60.0)
    guarded.now()
    guarded.allow(0.0)
    with pytest.raises(OutOfTime):
        guarded.now()


class SilentPort:
    """A socket without answers, whose waits last an hour each at first."""

    name, same_port, refused = "udp:10.0.0.7:1234", True, False

    def __init__(self):
        self.clock, self.waits = Clock(), 0

    def send(self, data):
        return

    def receive(self, deadline_s):
        self.waits += 1
        self.clock.time += 3600.0 if self.waits <= 2 else deadline_s + 1e-6

    def now(self):
        return self.clock.time


def test_an_interruption_is_no_silence():
    port = SilentPort()
    exchange = Exchange(port, 1.0)
    exchange.begin()
    with pytest.raises(LineFault) as fault:
        for _ in range(100):
            exchange.send(0, lambda tag: b"")
            exchange.receive()
            exchange.overdue()
    assert fault.value.cause is Cause.SILENT
    assert port.waits > 4  # two interrupted ones count as a patience each
    assert "within 4" in fault.value.text
