"""The way of a run with a machine that takes no time, ended at any call that reaches the disk."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np

from cosim import Clock, Viform
from cosim.files import Recorder
from cosim.report.png import write_png
from cosim.run.chain import STREAM, BlockChain
from cosim.run.machine import Options, Outcome
from cosim.run.progress import QuietProgress
from cosim.spikes.viform import words_for
from cosim.stage import Block, State

CYCLES, SHAPE, CLOCK = 200, (6, 8), Clock(40_000)


class _Source:
    """Spikes that depend on those before."""

    def __init__(self) -> None:
        self._seed = 1

    def step(self, data: Any, block: Block) -> Viform:
        rng = np.random.default_rng(self._seed)
        self._seed = int(rng.integers(1 << 40))
        planes = rng.integers(0, 2, (block.cycles, *SHAPE)).astype(np.uint8)
        words = Viform.from_planes(planes, CLOCK).words
        assert len(words) == words_for(block.cycles)
        return Viform(words, block.cycles, CLOCK, block.start)

    def state(self) -> State:
        return {"seed": np.array(self._seed)}

    def restore(self, state: State) -> None:
        self._seed = int(state["seed"])


class _Machine:
    """See `cosim.run.machine.Machine`."""

    toml, notes, device, unit, length, bits = 'title = "a"\n', (), "none", "cycles", CYCLES, 0

    def chain(self, folder: Path) -> BlockChain:
        recorder = Recorder(folder / STREAM, SHAPE, CYCLES, CLOCK)
        stages = {"source": _Source(), "recorder": recorder}
        return BlockChain("a", stages, CYCLES, "this run", folder, every_s=0.0, parallel=False)

    def check(self, progress: Any) -> list[Any]:
        return []

    def shortfall(self, recording: Any) -> list[Any]:
        return []

    def judge(self, recording: Any, progress: Any) -> Outcome:
        stream = recording.chain.stages["recorder"].recorded()
        images = recording.folder / "images"
        images.mkdir(exist_ok=True)
        write_png(images / "a.png", stream.read_words(0, 1)[0].astype(np.uint8))
        return Outcome("ok", 0.0, files=[STREAM, "images/a.png"])

    def close(self) -> None: ...


@contextmanager
def _ended_at(number: int, count: list[int]) -> Iterator[None]:
    """Ends the process by SIGKILL before its `number`-th call that syncs, renames or removes."""

    def counted(function: Any, *given: Any, **options: Any) -> Any:
        count[0] += 1
        if count[0] == number:
            os.kill(os.getpid(), signal.SIGKILL)
        return function(*given, **options)

    names = ("fsync", "replace", "unlink")
    patched = [mock.patch(f"os.{name}", partial(counted, getattr(os, name))) for name in names]
    for each in patched:
        each.start()
    try:
        yield
    finally:
        for each in patched:
            each.stop()


def run(folder: Path, number: int = 0) -> None:
    """Runs, or resumes what is in the folder, and ends the process. Its exit code is 0, and the
    number of calls stands in a file beside the folder.

    number: of the call at which the process is ended; 0 for none.
    """
    from scenarios import run as spine

    scenario: Any = SimpleNamespace(seed=1, tolerance=0.0)
    count = [0]
    options = Options(resume=folder.exists() and any(folder.iterdir()))
    with mock.patch.object(spine, "assemble", lambda *_: _Machine()), _ended_at(number, count):
        spine.run_scenario(
            "a", scenario, folder, options=options, progress=QuietProgress(),
            began=time.perf_counter(), report=lambda machine, run: [],
        )  # fmt: skip
    folder.with_suffix(".calls").write_text(str(count[0]))
    os._exit(0)
