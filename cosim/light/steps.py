"""Light in steps as long as the scene allows, for pixels without a common clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from cosim.clock import Clock
from cosim.light.light import Light
from cosim.light.source import Source
from cosim.stage import BLOCK, Block

__all__ = ["light_steps"]


def light_steps(
    source: Source,
    relay: Callable[[Light], Light],
    clock: Clock,
    stop: int,
    most: int | None = None,
) -> Iterator[tuple[Light, int, int]]:
    """Yields (light on the pixels, start, stop) for consecutive steps, in picoseconds.

    A step is the whole run if the light of the scene is known that far, and otherwise a block.

    Args:
        source: scene.
        relay: map from the light of the scene to the light on the pixels.
        clock: of the blocks.
        stop: end of the run, ps.
        most: upper limit of a step, cycles; None for no limit.
    """
    cycle, start = 0, 0
    cycles = clock.cycle_at(stop - 1) + 1
    while start < stop:
        block = Block(cycle, min(BLOCK, most or BLOCK, cycles - cycle))
        light = relay(source.step(None, block))
        cycle = block.stop
        if light.pieces[-1].stop >= stop:
            cycle = cycles if most is None else min(cycles, block.start + most)
        until = min(stop, clock.edge(cycle))
        yield light, start, until
        start = until
