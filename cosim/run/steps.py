"""A chain of stages that runs in steps of any length, with a checkpoint between two of them."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim.clock import Clock
from cosim.errors import Interrupted
from cosim.light.light import Light
from cosim.run.chain import CHECKPOINT
from cosim.run.folder import how_to_resume
from cosim.run.loop import Checkpoint, stop_requests
from cosim.run.progress import Progress


@dataclass
class StepChain:
    """The stages of a machine without a common clock. The recording is held in memory.

    A run that is resumed makes its light anew from the start, and its stages go on from the
    checkpoint.

    Attributes:
        title: what runs, for the progress bar.
        folder: folder of the run.
        clock, cycles: unit and length of the run.
        steps: light, start and stop (ps) of each step.
        stages: stages by name, from the pixels to the sink. `step` maps an input, start and stop
            (ps); `state` and `restore` are those of `Stateful`.
        sink: the stage that holds the recording.
        identity: text that depends on all inputs of the run; a checkpoint of another is refused.
        seconds: wall time of each stage, s; with what was spent before the chain began.
        every_s: wall time between checkpoints, s.
        done: end of the last step, ps.
    """

    title: str
    folder: Path
    clock: Clock
    cycles: int
    steps: Iterable[tuple[Light, int, int]]
    stages: Mapping[str, Any]
    sink: Any
    identity: str
    seconds: dict[str, float] = field(default_factory=lambda: {"scene": 0.0})
    every_s: float = 60.0
    done: int = 0

    @property
    def checkpoint(self) -> Path:
        return self.folder / CHECKPOINT

    def load(self, progress: Progress) -> bool:
        """See `Chain`."""
        self.done = Checkpoint(self.checkpoint, self.identity).load(self.stages)
        return True

    def save(self) -> None:
        """See `Chain`."""
        Checkpoint(self.checkpoint, self.identity).save(self.done, self.stages)

    def discard(self) -> None:
        """See `Chain`."""
        self.checkpoint.unlink(missing_ok=True)

    def run(self, progress: Progress) -> dict[str, float]:
        """See `Chain`. An interrupt is met at the end of a step; a second one at once, and what
        came after the last checkpoint is then done again."""
        progress.start(self.title, self.cycles)
        self.seconds |= dict.fromkeys(self.stages, 0.0)
        saved = last = time.perf_counter()
        try:
            with stop_requests() as stopping:
                for light, start, stop in self.steps:
                    last = self._spent("scene", last)
                    if stop > self.done:
                        last = self._step(light, start, stop, last)
                    progress.advance(self._cycles_done())
                    if stopping.is_set() or last - saved > self.every_s:
                        self.save()
                        saved = last = time.perf_counter()
                    if stopping.is_set():
                        raise KeyboardInterrupt
        except KeyboardInterrupt:
            remedy = how_to_resume(self.folder)
            raise Interrupted(self._cycles_done(), self.cycles, remedy) from None
        return self.seconds

    def _step(self, light: Light, start: int, stop: int, since: float) -> float:
        value: Any = light
        for name, stage in self.stages.items():
            value = stage.step(value, start, stop)
            since = self._spent(name, since)
        self.done = stop
        return since

    def _cycles_done(self) -> int:
        return self.clock.cycle_at(self.done - 1) + 1 if self.done else 0

    def _spent(self, stage: str, since: float) -> float:
        """Counts the time since `since` for a stage; the time now."""
        now = time.perf_counter()
        self.seconds[stage] += now - since
        return now
