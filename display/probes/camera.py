"""The protocol of the camera that probes use."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from cosim import Clock, Light, Viform


class ProbeCamera(Protocol):
    """A camera that records test light with arrays of any size.

    Attributes:
        clock: latch clock.
        height: number of rows of the whole sensor.
        seed: seed of the camera's noise.
        identity: all on which its streams depend, see `described`; an object that is none if that
            is not known.
    """

    @property
    def clock(self) -> Clock: ...
    @property
    def height(self) -> int: ...
    @property
    def seed(self) -> int: ...
    @property
    def identity(self) -> Any: ...

    def lux(self, rate: float) -> float:
        """Illuminance for `rate` thresholds a cycle, lux; above 1 the pixel saturates."""
        ...

    def spikes(self, rate: float) -> float:
        """Mean number of firings a second that are simulated one by one for a pixel at this light,
        thresholds a cycle, at most: with those of its dark current and of its longest width; 0 for
        pixels that are simulated cycle by cycle."""
        ...

    def row_delays(self, rows: int) -> npt.NDArray[np.int64]:
        """Delay from a clock edge to the latch of each row for a sensor with `rows` rows, ps,
        (rows,)."""
        ...

    def film(
        self,
        light: Light,
        cycles: int,
        shape: tuple[int, int],
        seed: int,
        rows: tuple[int, int] | None = None,
    ) -> Viform:
        """Records `cycles` cycles.

        Args:
            light: test light, lux; it must extend one cycle beyond the end.
            cycles: number of cycles from the instant 0.
            shape: (height, width) of the array, pixels.
            seed: seed of the noise.
            rows: first row and end of the recorded rows, None for all.
        """
        ...
