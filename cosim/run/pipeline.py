"""Stages of a chain that work at the same time, each on a block of its own.

Every stage has a thread and takes the blocks in their order, so that the results are those of one
stage after another. The queues between the stages are short: at most `_AHEAD` blocks wait before
each, which bounds the memory. Kernels, compiled code, compression and files release the
interpreter, so two stages use two cores.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from cosim.stage import Block, Stage

_AHEAD: Final = 1
"""Blocks that wait before a stage."""
_LOOK_S: Final = 0.1
"""Time after which a waiting thread looks whether another one has failed, s."""


class _Stopped(Exception):
    """Another stage has failed, or the last block has passed."""


class Pipeline:
    """Runs blocks through stages.

    The last stages from the first one with `one_thread` on run in the thread that calls `run`: a
    context of OpenGL belongs to one thread.

    Args:
        stages: stages by name, from source to sink.
        spent: seconds spent in each stage, which `run` adds to.
    """

    def __init__(self, stages: Mapping[str, Stage], spent: dict[str, float]) -> None:
        names = list(stages)
        pinned = [n for n, name in enumerate(names) if getattr(stages[name], "one_thread", False)]
        cut = min(pinned, default=len(names))
        self._stages, self._spent = stages, spent
        self._threads, self._here = names[:cut], names[cut:]
        self._failed = threading.Event()
        self._error: BaseException | None = None

    def run(self, blocks: Iterator[Block], done: Callable[[Block], None]) -> None:
        """Runs blocks until the iterator ends, and until the last of them has passed all stages.

        Args:
            blocks: blocks in order; the iterator is read by a thread of its own, a few blocks
                ahead.
            done: called in this thread after each block.

        Raises:
            Exception: the first one that a stage has raised.
        """
        queues: list[queue.Queue[Any]] = [
            queue.Queue(_AHEAD) for _ in range(len(self._threads) + 1)
        ]
        workers = [threading.Thread(target=self._feed, args=(blocks, queues[0]), daemon=True)]
        for name, before, after in zip(self._threads, queues, queues[1:], strict=False):
            work = (name, before, after)
            workers.append(threading.Thread(target=self._work, args=work, daemon=True))
        for worker in workers:
            worker.start()
        try:
            while True:
                item = self._get(queues[-1])
                if item is None:
                    break
                value, block = item
                for name in self._here:
                    value = self._step(name, value, block)
                done(block)
        except _Stopped:
            pass
        except BaseException as exc:
            self._fail(exc)
        finally:
            self._failed.set()
            for worker in workers:
                worker.join()
        if self._error is not None:
            raise self._error

    def _fail(self, error: BaseException) -> None:
        if self._error is None:
            self._error = error
        self._failed.set()

    def _feed(self, blocks: Iterator[Block], after: queue.Queue[Any]) -> None:
        try:
            for block in blocks:
                self._put(after, (None, block))
            self._put(after, None)
        except _Stopped:
            pass
        except BaseException as exc:
            self._fail(exc)

    def _work(self, name: str, before: queue.Queue[Any], after: queue.Queue[Any]) -> None:
        try:
            while True:
                item = self._get(before)
                if item is not None:
                    value, block = item
                    item = (self._step(name, value, block), block)
                self._put(after, item)
                if item is None:
                    return
        except _Stopped:
            pass
        except BaseException as exc:
            self._fail(exc)

    def _step(self, name: str, value: Any, block: Block) -> Any:
        since = time.perf_counter()
        value = self._stages[name].step(value, block)
        self._spent[name] += time.perf_counter() - since
        return value

    def _get(self, place: queue.Queue[Any]) -> Any:
        while True:
            try:
                return place.get(timeout=_LOOK_S)
            except queue.Empty:
                if self._failed.is_set():
                    raise _Stopped from None

    def _put(self, place: queue.Queue[Any], item: Any) -> None:
        while True:
            try:
                return place.put(item, timeout=_LOOK_S)
            except queue.Full:
                if self._failed.is_set():
                    raise _Stopped from None
