"""The run loop: blocks of cycles through a chain of stages, with a checkpoint to go on from.

A stage takes what the one before it made of a block and makes the next thing of it: a scene makes
light, a lens maps it, a camera makes spikes of it, a recorder writes them. A stage that remembers
anything has `state` and `restore`.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from cosim.archive import load_arrays
from cosim.errors import InputError, Interrupted

__all__ = ["BLOCK", "Block", "Checkpoint", "Stage", "Stateful", "blocks", "run_blocks"]

BLOCK = 64
"""Latch cycles in a block unless a scenario says otherwise."""
State = dict[str, npt.NDArray[Any]]


@dataclass(frozen=True)
class Block:
    """Cycles `start` to `start + cycles` of the run's clock."""

    start: int
    cycles: int

    @property
    def stop(self) -> int:
        """The first cycle after the block."""
        return self.start + self.cycles


def blocks(cycles: int, size: int = BLOCK, start: int = 0) -> Iterator[Block]:
    """Blocks from cycle `start` to `cycles`; the last may be shorter."""
    for first in range(start, cycles, size):
        yield Block(first, min(size, cycles - first))


class Stage(Protocol):
    """One part of the chain. `given` is what the stage before made, None for the first."""

    def step(self, given: Any, block: Block) -> Any: ...


@runtime_checkable
class Stateful(Protocol):
    """A stage whose next block depends on the ones before."""

    def state(self) -> State: ...
    def restore(self, state: State) -> None: ...


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
        mend = f"remove {self.path} to start afresh, or give the run another --out"
        try:
            arrays = load_arrays(self.path)
            cycle, identity = int(arrays.pop("cycle")), str(arrays.pop("identity"))
        except (OSError, ValueError, TypeError, KeyError) as exc:
            raise InputError(
                "the checkpoint", "one that this run wrote", "a damaged file", mend
            ) from exc
        if identity != self.identity:
            raise InputError("the checkpoint", "one of this same scenario", "one of another", mend)
        for name, stage in stages.items():
            if isinstance(stage, Stateful):
                prefix = f"{name}/"
                stage.restore(
                    {k.removeprefix(prefix): v for k, v in arrays.items() if k.startswith(prefix)}
                )
        return cycle


@contextmanager
def _stop_requests() -> Iterator[threading.Event]:
    """Set by Ctrl-C and by a request to terminate, so that a block is always finished first."""
    asked = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield asked  # signals reach the main thread only
        return
    before = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda *_: asked.set())
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
    mend: str = "run it again",
) -> dict[str, float]:
    """Runs `cycles` cycles through the stages in order, from cycle `begin` on, which is what
    `Checkpoint.load` gave where a run is gone on with; seconds spent in each stage.

    A checkpoint is saved every `every_s` seconds and when the user interrupts. progress is called
    with the number of cycles done. Raises Interrupted after Ctrl-C, with `mend` as its advice.
    """
    spent = dict.fromkeys(stages, 0.0)
    saved = time.monotonic()
    progress(begin)
    with _stop_requests() as asked:
        for block in blocks(cycles, size, begin):
            value: Any = None
            for name, stage in stages.items():
                since = time.perf_counter()
                try:
                    value = stage.step(value, block)
                except Exception as exc:
                    if asked.is_set():  # what a stage asks for is not more than what a user does
                        raise Interrupted(block.start, cycles, mend) from exc
                    raise
                spent[name] += time.perf_counter() - since
            progress(block.stop)
            stopping = asked.is_set()
            if checkpoint is not None and (stopping or time.monotonic() - saved > every_s):
                checkpoint.save(block.stop, stages)
                saved = time.monotonic()
            if stopping:
                raise Interrupted(block.stop, cycles, mend)
    return spent
