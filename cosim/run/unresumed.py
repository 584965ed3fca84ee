"""A chain that records in memory: a run that is interrupted cannot be resumed."""

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
    """Work on a run that cannot be resumed: an interruption and a full disk end with that advice.

    Args:
        folder: of the run.
        done, length: cycles simulated so far, and of the whole run.
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
        title: what runs, for the progress bar.
        folder: of the run.
        clock, cycles: unit and length of the run.
        steps: light, start and stop (ps) of each step.
        stages: by name, from the pixels to the sink; each maps its input, start and stop (ps).
        sink: holds the recording.
        seconds: wall time of each stage, s; with what was spent before the chain began.
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
        """A file that is never there."""
        return self.folder / CHECKPOINT

    def load(self) -> None:
        """Raises InputError: there is nothing to go on from."""
        raise InputError("--resume", "for a run with checkpoints", "for one without", AFRESH)

    def save(self) -> None:
        """Nothing: the recording is lost."""

    def discard(self) -> None:
        """Nothing: no file has been written."""

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
    """Counts the time since `since` for a stage; the time now."""
    now = time.perf_counter()
    seconds[stage] += now - since
    return now
