"""Stages with a clock of their own in a chain: some that run later, and some fed with many blocks.

The link starts before its stream, and what arrives is shown later than it was sent. The chain
counts the cycles of the link. Its stages before the link run `lead` cycles late; those after it run
whenever the decoder has a block for them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from cosim.spikes.viform import Viform
from cosim.stage import Block, Stage, State, Stateful, WithFiles


class _Wrapped:
    """A stage with the state of another one, `stage`."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.one_thread = getattr(stage, "one_thread", False)

    def state(self) -> State:
        return self.stage.state() if isinstance(self.stage, Stateful) else {}

    def restore(self, state: State) -> None:
        if isinstance(self.stage, Stateful):
            self.stage.restore(state)

    def damage(self, state: State, checked: Callable[[int, int], None]) -> str | None:
        return self.stage.damage(state, checked) if isinstance(self.stage, WithFiles) else None


def bare(stage: Any) -> Any:
    """A stage without what has put it into the clock of a link."""
    return stage.stage if isinstance(stage, _Wrapped) else stage


class Later(_Wrapped):
    """A stage that begins `lead` cycles after the chain and runs for `cycles` cycles.

    Args:
        stage: the stage.
        lead: a multiple of the chain's blocks, so that its blocks are those of a run by itself.
        cycles: length of its run.
    """

    def __init__(self, stage: Stage, lead: int, cycles: int) -> None:
        super().__init__(stage)
        self._lead, self._cycles = lead, cycles

    def step(self, data: Any, block: Block) -> Any:
        """The stage's output for its part of the block; None before and after its run."""
        start = max(block.start - self._lead, 0)
        stop = min(block.stop - self._lead, self._cycles)
        return self.stage.step(data, Block(start, stop - start)) if stop > start else None


class EachBlock(_Wrapped):
    """A stage that takes any number of blocks at a time."""

    def step(self, data: list[Viform], block: Block) -> list[Viform]:
        """The blocks, each after the stage."""
        return [self.stage.step(each, Block(each.start, each.cycles)) for each in data]
