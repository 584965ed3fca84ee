"""Faults of the readout: lines that show the bits of another line.

They follow the latches and change no pixel, so they are a stage after the camera, exact in every
tier. In a recording of a 400 x 250 chip, lines 2 and 3 equal lines 0 and 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import Viform
from cosim.stage import Block


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
