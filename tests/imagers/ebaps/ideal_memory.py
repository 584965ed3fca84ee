"""A frame memory that takes no time and makes no mistakes."""

import numpy as np
import numpy.typing as npt

from imagers.ebaps.board.timing import REGIONS

Image = npt.NDArray[np.uint16]


class IdealMemory:
    """See `FrameMemory`."""

    def __init__(self) -> None:
        self._frames: dict[int, Image] = {}

    def store(self, region: int, frame: Image) -> None:
        """See `FrameMemory`."""
        if not 0 <= region < REGIONS:
            raise ValueError(f"a region must be 0 to {REGIONS - 1}, not {region}")
        self._frames[region] = frame.copy()

    def read(self, region: int) -> Image:
        """See `FrameMemory`."""
        return self._frames[region]
