"""The run loop: blocks of cycles through a chain of stages, with a checkpoint to go on from."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cosim.archive import load_arrays
from cosim.errors import InputError, Interrupted
from cosim.stage import BLOCK, Stage, State, Stateful, blocks, section

__all__ = ["Checkpoint", "run_blocks", "stop_requests"]


@dataclass(frozen=True)
class Checkpoint:
    """Where a run stands, in one file that is replaced whole or not at all.

    identity: text that names the run's inputs; a checkpoint of another run is refused.
    """

    path: Path
    identity: str

    def save(self, cycle: int, stages: Mapping[str, Stage]) -> None:
        """Writes the state of every stage that has one, after cycle `cycle - 1`."""
        arrays: State = {"cycle": np.array(cycle), "identity": np.array(self.identity)}
        for name, stage in stages.items():
            if isinstance(stage, Stateful):
                arrays |= {f"{name}/{key}": value for key, value in stage.state().items()}
        part = self.path.with_suffix(".part")
        try:
            with part.open("wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
                file.flush()
                os.fsync(file.fileno())
            part.replace(self.path)
        finally:
            part.unlink(missing_ok=True)  # of a disk that is full

    def load(self, stages: Mapping[str, Stage]) -> int:
        """Restores the stages; the cycle to go on from (0 where there is no checkpoint)."""
        if not self.path.exists():
            return 0
        remedy = f"remove {self.path} to start afresh, or give the run another --out"
        try:
            arrays = load_arrays(self.path)
            cycle, identity = int(arrays.pop("cycle")), str(arrays.pop("identity"))
        except (OSError, ValueError, TypeError, KeyError) as exc:
            raise InputError(
                "the checkpoint", "one that this run wrote", "a damaged file", remedy
            ) from exc
        if identity != self.identity:
            raise InputError(
                "the checkpoint", "one of this same scenario", "one of another", remedy
            )
        for name, stage in stages.items():
            if isinstance(stage, Stateful):
                stage.restore(section(arrays, name))
        return cycle


@contextmanager
def stop_requests() -> Iterator[threading.Event]:
    """Set by Ctrl-C and by a request to terminate, so that a block is always finished first. A
    second one raises KeyboardInterrupt at once."""
    asked = threading.Event()

    def ask(*_: object) -> None:
        if asked.is_set():
            raise KeyboardInterrupt
        asked.set()

    if threading.current_thread() is not threading.main_thread():
        yield asked  # signals reach the main thread only
        return
    before = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, ask)
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def run_blocks(
    stages: Mapping[str, Stage],
    cycles: int,
    *,
    size: int = BLOCK,
    checkpoint: Checkpoint | None = None,
    begin: int = 0,
    every_s: float = 30.0,
    progress: Callable[[int], None] = lambda done: None,
    remedy: str = "run it again",
) -> dict[str, float]:
    """Runs `cycles` cycles through the stages in order, from cycle `begin` on, which is what
    `Checkpoint.load` gave for a run that is resumed; seconds spent in each stage.

    A checkpoint is saved every `every_s` seconds and when the user interrupts. progress is called
    with the number of cycles done. Raises Interrupted after Ctrl-C, with `remedy` as its advice.
    """
    spent = dict.fromkeys(stages, 0.0)
    saved = time.monotonic()
    progress(begin)
    with stop_requests() as asked:
        for block in blocks(cycles, size, begin):
            value: Any = None
            for name, stage in stages.items():
                since = time.perf_counter()
                try:
                    value = stage.step(value, block)
                except Exception as exc:
                    if asked.is_set():  # what a stage asks for is not more than what a user does
                        raise Interrupted(block.start, cycles, remedy) from exc
                    raise
                spent[name] += time.perf_counter() - since
            progress(block.stop)
            stopping = asked.is_set()
            if checkpoint is not None and (stopping or time.monotonic() - saved > every_s):
                checkpoint.save(block.stop, stages)
                saved = time.monotonic()
            if stopping:
                raise Interrupted(block.stop, cycles, remedy)
    return spent
