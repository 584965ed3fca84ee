"""A finished run of an imager, for the pages of its report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.run.machine import Run
from imagers.common.model import FrameFigures
from imagers.run.chain import FrameChain
from imagers.run.plan import PlannedRun
from imagers.run.store import FRAMES, read_frame

__all__ = ["ImagerRun"]


@dataclass(frozen=True, eq=False)
class ImagerRun:
    """A finished run.

    Attributes:
        run: the run as in the report of every machine.
        chain: the chain that has filmed, with the check of its plan.
        pictures: numbers of the frames in images/, in order.
    """

    run: Run
    chain: FrameChain
    pictures: list[int]

    @property
    def folder(self) -> Path:
        return self.run.folder

    @property
    def planned(self) -> PlannedRun:
        return self.chain.planned

    @property
    def frames(self) -> list[FrameFigures]:
        return self.chain.frames

    @property
    def imager(self) -> Any:
        """The imager in its state after the run."""
        return self.chain.imager

    @property
    def reinstated(self) -> set[str]:
        """Effects that the check has reinstated."""
        return {finding.effect for finding in self.run.reinstated}

    def frame(self, n: int) -> npt.NDArray[np.uint16]:
        """Values of the n-th frame, (rows, W), DN."""
        return read_frame(self.folder / FRAMES, n)
