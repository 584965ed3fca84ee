"""The first stages of a camera's chain: its scene and its lens."""

from __future__ import annotations

from cosim import Block, Light
from cosim.light.lens import Lens
from cosim.light.source import Source

__all__ = ["LensStage", "SceneStage"]


class SceneStage:
    """A scene that gives the light of a few more cycles than the block has: a camera whose rows are
    sampled before or after the clock's edge needs the light around it.

    Args:
        source: the scene.
        reach: cycles before and after the block.
    """

    def __init__(self, source: Source, reach: tuple[int, int]) -> None:
        self._source, self._reach = source, reach

    def step(self, data: None, block: Block) -> Light:
        before, after = self._reach
        start = max(block.start - before, 0)
        return self._source.step(data, Block(start, block.stop + after - start))


class LensStage:
    """A lens in front of pixels of the given pitch, in micrometres."""

    def __init__(self, lens: Lens, pitch_um: float) -> None:
        self._relay = lens.relay(pitch_um)

    def step(self, data: Light, block: Block) -> Light:
        return self._relay(data)
