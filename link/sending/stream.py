"""A transmission as a spike stream, for files and panels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim import Clock
from cosim.spikes.viform import WORD, Words
from link.sending.transmission import Transmission


@dataclass(frozen=True, eq=False)
class PlaneStream:
    """The planes of a transmission: plane p is cycle p, panel pixels are pixels.

    Attributes:
        sent: the transmission.
        clock: clock of the panel.
    """

    sent: Transmission
    clock: Clock

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the panel."""
        return self.sent.mode.height, self.sent.mode.width

    @property
    def cycles(self) -> int:
        """Number of planes."""
        return self.sent.planes

    def read_words(self, first: int, stop: int) -> Words:
        """Words of the stream; see `SpikeStream`."""
        count = max(min(stop * WORD, self.cycles) - first * WORD, 0)
        return np.ascontiguousarray(self.sent.words(first * WORD, count))
