"""A chain that records in memory. An interrupted run cannot be resumed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim.clock import Clock
from cosim.errors import InputError, Interrupted
from cosim.light.light import Light
from cosim.run.chain import CHECKPOINT
from cosim.run.folder import room_for
from cosim.run.progress import Progress

__all__ = ["AFRESH", "MemoryChain", "start_again"]

AFRESH = "run it afresh with another --out"


@contextmanager
def start_again(folder: Path, done: int, length: int) -> Iterator[None]:
    """Context of a run that cannot be resumed: after an interruption or on a full disk, the message
    advises to start again.

    Args:
        folder: folder of the run.
        done, length: cycles simulated so far, and cycles of the whole run.
    """
    try:
        with room_for("the run", folder, "run it again with another --out"):
            yield
    except KeyboardInterrupt:
        raise Interrupted(done, length, AFRESH) from None


@dataclass
class MemoryChain:
    """Stages over steps of any length.

    Attributes:
        title: text of the progress bar.
        folder: folder of the run.
        clock, cycles: unit and length of the run.
        steps: light, start and stop (ps) of each step.
        stages: stages by name, from the pixels to the sink; called with input, start and stop (ps).
        sink: last stage, with the recording.
        seconds: wall time of each stage, s, including time before the chain.
    """

    title: str
    folder: Path
    clock: Clock
    cycles: int
    steps: Iterable[tuple[Light, int, int]]
    stages: Mapping[str, Callable[[Any, int, int], Any]]
    sink: Any
    seconds: dict[str, float] = field(default_factory=lambda: {"scene": 0.0})

    @property
    def checkpoint(self) -> Path:
        """File of the checkpoint; it never exists."""
        return self.folder / CHECKPOINT

    def load(self) -> None:
        """Raises InputError, because there is no checkpoint."""
        raise InputError("--resume", "for a run with checkpoints", "for one without", AFRESH)

    def save(self) -> None:
        """Does nothing; the recording is lost."""

    def discard(self) -> None:
        """Does nothing; there are no files."""

    def run(self, progress: Progress) -> dict[str, float]:
        """See `Chain`."""
        progress.start(self.title, self.cycles)
        seconds, done = self.seconds, 0
        seconds |= dict.fromkeys(self.stages, 0.0)
        last = time.perf_counter()
        try:
            for light, start, stop in self.steps:
                value: Any = light
                last = _spent(seconds, "scene", last)
                for name, stage in self.stages.items():
                    value = stage(value, start, stop)
                    last = _spent(seconds, name, last)
                done = self.clock.cycle_at(stop - 1) + 1
                progress.advance(done)
        except KeyboardInterrupt:
            raise Interrupted(done, self.cycles, AFRESH) from None
        return seconds


def _spent(seconds: dict[str, float], stage: str, since: float) -> float:
    """Adds the time since `since` to a stage; returns the current time."""
    now = time.perf_counter()
    seconds[stage] += now - since
    return now
