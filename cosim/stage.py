"""Blocks of cycles, and the stages of a chain that process them.

Each stage transforms the output of the previous stage, block by block: a scene emits light, a lens
maps it, a camera turns it into spikes, and a recorder writes them. A stage with state between
blocks implements `Stateful`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy.typing as npt

BLOCK = 64
"""Latch cycles in a block, unless a scenario sets another number."""
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
    """One part of the chain."""

    def step(self, data: Any, block: Block) -> Any:
        """The output for a block. data: output of the previous stage, None for the first."""
        ...


@runtime_checkable
class Stateful(Protocol):
    """A stage whose output depends on previous blocks."""

    def state(self) -> State: ...
    def restore(self, state: State) -> None: ...


@runtime_checkable
class WithFiles(Protocol):
    """A stage whose state is worth only as much as the files that it has written before."""

    def damage(self, state: State, checked: Callable[[int, int], None]) -> str | None:
        """What is wrong with the files that a `state` builds on, None if they are sound.

        checked: called with the number of parts that have been checked, and that of all.
        """
        ...


def section(state: Mapping[str, npt.NDArray[Any]], name: str) -> State:
    """The part of a state whose keys begin with `name/`, under the rest of their names."""
    prefix = f"{name}/"
    return {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
