"""The run loop: blocks of cycles through a chain of stages, with checkpoints."""

from __future__ import annotations

import hashlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.archive import load_arrays
from cosim.compute.stopping import finishing, first_signal, interrupt
from cosim.errors import InputError, Interrupted, shorten
from cosim.files.atomic import atomic_write
from cosim.run.pipeline import Pipeline
from cosim.stage import BLOCK, Block, Stage, State, Stateful, WithFiles, blocks, section

_DIGEST = "digest"
"""Name of the array with the digest of all others."""
Gate = Callable[[Block, Callable[[], bool]], bool]
"""Takes a block, and a function that says whether the user has asked to stop."""


def _digest(arrays: State) -> str:
    """SHA-256 of names, types, shapes and values in hexadecimal."""
    found = hashlib.sha256()
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        found.update(repr((name, array.dtype.str, array.shape)).encode())
        found.update(np.ascontiguousarray(array).reshape(-1).tobytes())
    return found.hexdigest()


def earlier(checkpoint: Path) -> Path:
    """File of the checkpoint before one."""
    return checkpoint.with_stem(f"{checkpoint.stem}-before")


def discard_checkpoints(checkpoint: Path) -> None:
    """Removes a checkpoint and the one before."""
    for file in (earlier(checkpoint), checkpoint):
        file.unlink(missing_ok=True)


class LostRecording(Exception):
    """A file that a checkpoint builds on is lost or damaged. The text says which."""


@dataclass(frozen=True)
class Checkpoint:
    """The state of a run in one file, which is replaced atomically. It is written after all that it
    builds on is on the disk: `state` of a stage that writes files waits for them.

    It holds a digest of all names, types, shapes and values. Stages trust what they restore: an
    array that is short would end in their compiled code. So nothing is restored before the digest
    has shown that the file is as a run of the same identity wrote it.

    If stages write files, the checkpoint before stays as well (`earlier`): a part of a file that is
    lost or damaged after it then costs the cycles since, not the run. It is a second name of a file
    that is there anyway. Stages go back to it as after a kill, which leaves files ahead of a
    checkpoint too.

    Attributes:
        path: the file.
        identity: text that depends on all inputs of the run. A checkpoint with another identity is
            refused.
    """

    path: Path
    identity: str

    @finishing()
    def save(self, cycle: int, stages: Mapping[str, Stage]) -> None:
        """Writes the state of all stages that have one, after cycle `cycle - 1`."""
        arrays: State = {"cycle": np.array(cycle), "identity": np.array(self.identity)}
        for name, stage in stages.items():
            if isinstance(stage, Stateful):
                arrays |= {f"{name}/{key}": value for key, value in stage.state().items()}
        arrays[_DIGEST] = np.array(_digest(arrays))
        if any(isinstance(stage, WithFiles) for stage in stages.values()):
            with suppress(OSError):  # there is none yet, or the disk has no second names
                earlier(self.path).unlink(missing_ok=True)
                os.link(self.path, earlier(self.path))
        with atomic_write(self.path) as part, part.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)

    def load(
        self, stages: Mapping[str, Stage], last: int | None = None,
        checked: Callable[[int, int], None] = lambda done, total: None,
        note: Callable[[str], None] = lambda text: None,
    ) -> int:  # fmt: skip
        """Restores the stages; returns the next cycle, 0 if there is no checkpoint.

        Args:
            stages: stages by name.
            last: the largest cycle that a checkpoint can have, None if unknown.
            checked: see `WithFiles`.
            note: called with a line if the checkpoint before takes the place of this one.

        Raises:
            LostRecording: a file that both checkpoints build on is lost or damaged; no stage has
                changed.
            InputError: the checkpoint is damaged, or is one of another run; no stage has changed
                unless a state is of another form than its stage has.
        """
        try:
            return self._load(stages, last, checked)
        except LostRecording as lost:
            before = replace(self, path=earlier(self.path))
            if not before.path.exists():
                raise
            try:
                cycle = before._load(stages, last, checked)
            except (LostRecording, InputError):
                raise lost from None
            os.replace(before.path, self.path)
            note(f"{lost}; the run goes back to cycle {cycle}, its checkpoint before")
            return cycle

    def _load(
        self, stages: Mapping[str, Stage], last: int | None, checked: Callable[[int, int], None]
    ) -> int:
        """See `load`; of this file alone."""
        if not self.path.exists():
            return 0
        try:
            arrays = load_arrays(self.path)
            if str(arrays.pop(_DIGEST)) != _digest(arrays):
                raise ValueError("its digest is another")
            cycle, identity = int(arrays.pop("cycle")), str(arrays.pop("identity"))
        except (OSError, ValueError, TypeError, KeyError) as exc:
            raise self._refusal("one that this run wrote", "a damaged file") from exc
        if identity != self.identity:
            raise self._refusal("one of this same scenario", "one of another")
        if not 0 <= cycle <= (cycle if last is None else last):
            raise self._refusal(f"at most at cycle {last}", f"one at cycle {cycle}")
        for name, stage in stages.items():
            if isinstance(stage, WithFiles):
                damage = stage.damage(section(arrays, name), checked)
                if damage is not None:
                    raise LostRecording(damage)
        for name, stage in stages.items():
            if isinstance(stage, Stateful):
                try:
                    stage.restore(section(arrays, name))
                except KeyError as exc:  # another version of the program kept other values
                    raise self._refusal(f"one with {exc} of {name}", "one without") from exc
                except (ValueError, TypeError, IndexError) as exc:
                    raise self._refusal(
                        f"one with the state of {name}", f"one where {shorten(str(exc))}"
                    ) from exc
        return cycle

    def _refusal(self, must: str, actual: str) -> InputError:
        remedy = f"remove {self.path} to start afresh, or give the run another --out"
        return InputError("the checkpoint", must, actual, remedy)


def open_gate(block: Block, stopping: Callable[[], bool]) -> bool:
    """The gate of a chain that waits for nothing."""
    return True


@contextmanager
def stop_requests() -> Iterator[threading.Event]:
    """An event that SIGINT and SIGTERM set, so that the current block is always completed.

    A second signal raises KeyboardInterrupt at once, unless the process ends by itself.
    """
    requested = threading.Event()

    def request(*_: object) -> None:
        if not first_signal():
            return
        if requested.is_set():
            raise KeyboardInterrupt
        requested.set()

    with _handlers(request):
        yield requested


def end_requests() -> threading.Event:
    """An event that SIGINT and SIGTERM set from now on, for a server that then ends at once:
    further signals do not interrupt its end. In the main thread."""
    requested = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: requested.set())
    return requested


@contextmanager
def noted_interrupts() -> Iterator[threading.Event]:
    """An event that SIGINT and SIGTERM set, beside the KeyboardInterrupt that they raise. A library
    may lose the exception: one raised while it calls back is printed and forgotten."""
    requested = threading.Event()

    def request(*_: object) -> None:
        requested.set()
        interrupt()

    with _handlers(request):
        yield requested


@contextmanager
def _handlers(request: Callable[..., None]) -> Iterator[None]:
    """Calls a function for SIGINT and SIGTERM; in the main thread only, which signals reach."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {s: signal.getsignal(s) for s in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, request)
    try:
        yield
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
    parallel: bool = False,
    gate: Gate = open_gate,
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
        parallel: whether the stages work at the same time; the results are the same.
        gate: called before each block; returns whether it may begin. False ends the run before
            `cycles`: nothing more comes. It may wait, but not once the user asks to stop.

    Returns:
        Seconds spent in each stage.

    Raises:
        Interrupted: after Ctrl-C or a request to terminate.
    """
    spent = dict.fromkeys(stages, 0.0)
    progress(begin)
    at, due, over = begin, False, False
    with stop_requests() as requested:

        def done(block: Block) -> None:
            nonlocal at
            at = block.stop
            progress(at)

        while at < cycles and not over:
            saved = time.monotonic()

            def until_checkpoint(since: float, first: int) -> Iterator[Block]:
                """Blocks until the next checkpoint is due, or the user asks to stop."""
                nonlocal due, over
                for block in blocks(cycles, size, first):
                    if not gate(block, requested.is_set):
                        over = not requested.is_set()
                        return
                    yield block
                    due = time.monotonic() - since > every_s
                    if due or requested.is_set():
                        return

            try:
                _run(stages, until_checkpoint(saved, at), done, spent, parallel)
            except Exception as exc:
                if requested.is_set():  # the request of the user takes precedence
                    raise Interrupted(at, cycles, remedy) from exc
                raise
            stopping = requested.is_set()
            if checkpoint is not None and (stopping or due):
                checkpoint.save(at, stages)
            if stopping:
                raise Interrupted(at, cycles, remedy)
    return spent


def _run(
    stages: Mapping[str, Stage], feed: Iterator[Block], done: Callable[[Block], None],
    spent: dict[str, float], parallel: bool,
) -> None:  # fmt: skip
    """Runs blocks through the stages, at the same time or one after another."""
    if parallel:
        Pipeline(stages, spent).run(feed, done)
        return
    for block in feed:
        value: Any = None
        for name, stage in stages.items():
            since = time.perf_counter()
            value = stage.step(value, block)
            spent[name] += time.perf_counter() - since
        done(block)
