"""The first stages in the chain of a camera: scene and lens."""

from __future__ import annotations

from cosim.light.lens import Lens
from cosim.light.light import Light
from cosim.light.source import Source
from cosim.stage import Block


class SceneStage:
    """A scene that returns the light of the block and of a few cycles around it. A camera whose
    rows are sampled before or after the clock edge needs that light.

    Args:
        source: the scene.
        reach: number of cycles before and after the block.
    """

    def __init__(self, source: Source, reach: tuple[int, int]) -> None:
        self._source, self._reach = source, reach

    def step(self, data: None, block: Block) -> Light:
        before, after = self._reach
        start = max(block.start - before, 0)
        return self._source.step(data, Block(start, block.stop + after - start))


class LensStage:
    """A lens in front of pixels of the pitch `pitch_um`, µm."""

    def __init__(self, lens: Lens, pitch_um: float) -> None:
        self._relay = lens.relay(pitch_um)

    def step(self, data: Light, block: Block) -> Light:
        return self._relay(data)
