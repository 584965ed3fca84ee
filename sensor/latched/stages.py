"""The stages of a camera before and behind its pixels: scene, lens, and faults of the readout.

Faults of the readout follow the latches and change no pixel, so they are a stage after the camera,
exact in every tier. In a recording of a 400 x 250 chip, lines 2 and 3 equal lines 0 and 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cosim.compute.cores import beside
from cosim.light.lens import Lens
from cosim.light.light import Light
from cosim.light.source import Source
from cosim.spikes.viform import Viform
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


class SceneBlocks:
    """The light on the pixels, block by block.

    Args:
        source: the scene.
        relay: the lens; None for light that is behind it.
        reach: cycles before and after a block whose light it needs.
        parts: the blocks.
    """

    def __init__(
        self, source: Source, relay: Callable[[Light], Light] | None, reach: tuple[int, int],
        parts: Sequence[Block],
    ) -> None:  # fmt: skip
        self.source, self.parts, self._relay = source, parts, relay
        self._stage = SceneStage(source, reach)
        self._begun: Callable[[], Light] | None = None

    def begin(self) -> None:
        """Begins with the first block while others do something else."""
        self._begun = beside(lambda: self._lit(self.parts[0]))

    def __call__(self, block: Block) -> Light:
        """The light of a block; blocks follow each other."""
        if self._begun is None:
            return self._lit(block)
        begun, self._begun = self._begun, None
        return begun()

    def _lit(self, block: Block) -> Light:
        given = self._stage.step(None, block)
        return given if self._relay is None else self._relay(given)


class DuplicatedRows:
    """A stage that shows in some rows the bits of others. pairs: (source, target) rows."""

    def __init__(self, pairs: Sequence[tuple[int, int]]) -> None:
        self._sources, self._targets = (list(rows) for rows in zip(*pairs, strict=True))

    def step(self, stream: Viform, block: Block) -> Viform:
        """The stream with the duplicated rows."""
        words = stream.words.copy()
        self.duplicate(words)
        return replace(stream, words=words)

    def duplicate(self, words: npt.NDArray[np.uint32]) -> None:
        """Duplicates the rows of words (n, H, W) in place."""
        words[:, self._targets] = words[:, self._sources]


def readout_stages(pairs: Sequence[tuple[int, int]]) -> dict[str, DuplicatedRows]:
    """The stages between camera and recorder, by name; {} without a fault."""
    return {"readout": DuplicatedRows(pairs)} if pairs else {}
