"""Time that the stages of a set-up took."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Spent:
    """Time by stage, s; a stage that comes again adds to its time.

    Attributes:
        wall: time on the clock.
        processor: time of all threads of the program. Other programs do not lengthen it.
    """

    wall: dict[str, float] = field(default_factory=dict)
    processor: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def on(self, stage: str) -> Iterator[None]:
        """Adds the time of the block to a stage."""
        wall, processor = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            self.wall[stage] = self.wall.get(stage, 0.0) + time.perf_counter() - wall
            self.processor[stage] = self.processor.get(stage, 0.0) + time.process_time() - processor

    def forget(self, stage: str) -> None:
        """Takes a stage out."""
        self.wall.pop(stage, None)
        self.processor.pop(stage, None)
