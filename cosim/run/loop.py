"""The run loop: blocks of cycles through a chain of stages, with checkpoints."""

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
    """The state of a run in one file, which is replaced atomically.

    Attributes:
        path: the file.
        identity: text that depends on all inputs of the run. A checkpoint with another identity is
            refused.
    """

    path: Path
    identity: str

    def save(self, cycle: int, stages: Mapping[str, Stage]) -> None:
        """Writes the state of all stages that have one, after cycle `cycle - 1`."""
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
            part.unlink(missing_ok=True)  # after an error, such as a full disk

    def load(self, stages: Mapping[str, Stage]) -> int:
        """Restores the stages; returns the next cycle, 0 if there is no checkpoint.

        Raises InputError for a damaged checkpoint, or one of another run.
        """
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
    """An event that SIGINT and SIGTERM set, so that the current block is always completed.

    A second signal raises KeyboardInterrupt at once.
    """
    requested = threading.Event()

    def request(*_: object) -> None:
        if requested.is_set():
            raise KeyboardInterrupt
        requested.set()

    if threading.current_thread() is not threading.main_thread():
        yield requested  # signals reach the main thread only
        return
    before = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, request)
    try:
        yield requested
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
    """Runs blocks of cycles through the stages in order.

    Args:
        stages: stages by name, from source to sink.
        cycles: length of the run.
        size: cycles of a block.
        checkpoint: saved every `every_s` seconds and on an interruption; None for none.
        begin: first cycle; for a resumed run, the result of `Checkpoint.load`.
        every_s: wall time between checkpoints, s.
        progress: called with the number of completed cycles.
        remedy: how to continue after an interruption.

    Returns:
        Seconds spent in each stage.

    Raises:
        Interrupted: after Ctrl-C or a request to terminate.
    """
    spent = dict.fromkeys(stages, 0.0)
    saved = time.monotonic()
    progress(begin)
    with stop_requests() as requested:
        for block in blocks(cycles, size, begin):
            value: Any = None
            for name, stage in stages.items():
                since = time.perf_counter()
                try:
                    value = stage.step(value, block)
                except Exception as exc:
                    if requested.is_set():  # the request of the user takes precedence
                        raise Interrupted(block.start, cycles, remedy) from exc
                    raise
                spent[name] += time.perf_counter() - since
            progress(block.stop)
            stopping = requested.is_set()
            if checkpoint is not None and (stopping or time.monotonic() - saved > every_s):
                checkpoint.save(block.stop, stages)
                saved = time.monotonic()
            if stopping:
                raise Interrupted(block.stop, cycles, remedy)
    return spent
