"""Objects that are called again and again in one process: memory and open files do not grow."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viform

SMALL = {"width": 32, "height": 16, "threshold": "100 e"}
CLIP = np.random.default_rng(4).integers(40, 250, (4, 16, 32), dtype=np.uint8)
LINK = {
    "panel.width": 128, "panel.height": 128, "sensor.width": 150, "sensor.height": 150,
    "modem.cell": 4, "modem.ticks": 4, "modem.rate": 0.75,
}  # fmt: skip
READOUTS: dict[str, dict[str, Any]] = {
    "silicon": {"preset": "silicon"},
    "fast": {"tier": "fast"},
    "exact": {"tier": "exact"},
    "reference": {"tier": "reference"},
    "asynchronous": {"pixel": "asynchronous", "preset": "silicon"},
    "channel": {"pixel": "asynchronous", "channel.rate": "20 MHz"},
    "continuous": {"pixel": "continuous"},
    "continuous, no noise": {"pixel": "continuous", "continuous.shot_noise": False},
}
CHIEF = ("silicon", "asynchronous", "continuous")
Call = Callable[[], object]


def film(kind: str, **how: Any) -> Call:
    camera = viform.Camera(**SMALL, **READOUTS[kind])
    return lambda: camera.film(CLIP, 2000, **how)


def push(kind: str) -> Call:
    stream, number = viform.Camera(**SMALL, **READOUTS[kind]).open(2000), count()
    return lambda: stream.push(CLIP[next(number) % len(CLIP)])


def opened(kind: str) -> Call:
    camera = viform.Camera(**SMALL, **READOUTS[kind])
    return lambda: [each.push(frame) for each in [camera.open(2000)] for frame in CLIP[:2]]


def made(kind: str) -> Call:
    def call() -> None:
        with viform.Camera(**SMALL, **READOUTS[kind]) as camera:
            camera.film(CLIP, 2000)

    return call


def show() -> Call:
    spikes, display = viform.Camera(**SMALL).film(CLIP, 2000), viform.Display(drive="causal")
    return lambda: display.show(spikes, eye="still")


def send() -> Call:
    link = viform.Link(distance="2 m", size=100, **LINK)
    return lambda: link.send(bytes(100))


def memory() -> int:
    """Bytes of this process in memory."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def grown(call: Call, calls: int) -> tuple[int, int]:
    """Bytes and open files that some calls leave behind, after as many of a third."""
    for _ in range(calls // 3):
        call()
    before, files = memory(), len(os.listdir("/proc/self/fd"))
    for _ in range(calls):
        call()
    return memory() - before, len(os.listdir("/proc/self/fd")) - files


@pytest.mark.parametrize("kind", CHIEF)
@pytest.mark.parametrize("make", [film, push])
def test_hundreds_of_calls_leave_nothing_behind(make: Callable[[str], Call], kind: str) -> None:
    size, files = grown(make(kind), 100)
    assert size < 5e5 and files == 0  # the spikes of a call have 6 kB


@pytest.mark.parametrize(
    "make",
    [partial(film, kind, check=check) for kind in CHIEF for check in (False, True)][:-1]
    + [partial(push, kind) for kind in CHIEF],
    ids=lambda make: f"{make.func.__name__} {make.args[0]} {make.keywords}",
)
def test_a_call_is_given_back_without_the_collector(make: Callable[[], Call]) -> None:
    """Arrays in a cycle of references are kept until the collector of Python comes by."""
    call = make()
    call()
    gc.collect()
    gc.disable()
    try:
        call()
        assert gc.collect() == 0
    finally:
        gc.enable()


MANY: dict[str, tuple[Callable[[], Call], int]] = {
    **{f"film, {kind}": (partial(film, kind), 10_000) for kind in CHIEF},
    **{f"film, {kind}": (partial(film, kind), 3000) for kind in READOUTS if kind not in CHIEF},
    **{f"film, {kind}, checked": (partial(film, kind, check=True), 300) for kind in CHIEF[:2]},
    **{f"push, {kind}": (partial(push, kind), 10_000) for kind in CHIEF},
    "push, no noise": (partial(push, "continuous, no noise"), 3000),
    "open": (partial(opened, "silicon"), 1000),
    "make": (partial(made, "silicon"), 300),
    "show": (show, 3000),
    "send": (send, 60),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", MANY)
def test_ten_thousand_calls_leave_nothing_behind(kind: str) -> None:
    make, calls = MANY[kind]
    size, files = grown(make(), calls)
    assert size < 8e6 and files == 0


def filmed(kind: str) -> Any:
    camera = viform.Camera(**SMALL, **READOUTS[kind])
    return [camera.film(CLIP, 2000) for _ in range(3)]


@pytest.mark.slow
def test_two_processes_at_once_give_the_bits_of_one() -> None:
    kinds = list(CHIEF)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        seen = list(pool.map(filmed, kinds * 2))
    assert seen[:3] == seen[3:] == [filmed(kind) for kind in kinds]
