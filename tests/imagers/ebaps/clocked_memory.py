"""A frame memory whose every transfer runs clock by clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from imagers.ebaps.board.crossing import Path, Transfer, transfer
from imagers.ebaps.board.memory import BurstMemory

Image = npt.NDArray[np.uint16]


class ClockedMemory:
    """See `FrameMemory`. last: the last transfer."""

    def __init__(self, path: Path) -> None:
        self.ddr = BurstMemory(bias=path.bias).ddr
        self.last = Transfer()
        self.bursts = 0
        self._path = path
        self._shapes: dict[int, tuple[int, int]] = {}

    def _done(self, done: Transfer) -> Transfer:
        self._path = replace(self._path, seed=self._path.seed + 1)
        self.last = done
        self.bursts += len(done.writes) + len(done.reads)
        assert done.done and not done.overflows
        return done

    def store(self, region: int, frame: Image) -> None:
        self._shapes[region] = (frame.shape[0], frame.shape[1])
        self._done(transfer(self.ddr, self._path, write=(region, frame)))

    def read(self, region: int) -> Image:
        shape = self._shapes[region]
        return self._done(transfer(self.ddr, self._path, read=([region], shape))).frames[region]
