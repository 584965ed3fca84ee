"""The camera that probes film with: what a probe needs of the camera before a display."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosim import Clock, Light, Viform

__all__ = ["ProbeCamera"]


class ProbeCamera(Protocol):
    """A camera of which pieces of any size film small test light.

    Attributes:
        clock: of the latch.
        height: rows of the whole sensor.
        seed: of the camera's noise.
    """

    @property
    def clock(self) -> Clock: ...
    @property
    def height(self) -> int: ...
    @property
    def seed(self) -> int: ...

    def lux(self, rate: float) -> float:
        """Illuminance of a pixel for so many thresholds a cycle; above 1 it is overfull."""
        ...

    def row_delays(self, rows: int) -> npt.NDArray[np.int64]:
        """(rows,) ps from a clock edge to the latch of each row, of a sensor of so many rows."""
        ...

    def film(
        self,
        light: Light,
        cycles: int,
        shape: tuple[int, int],
        seed: int,
        rows: tuple[int, int] | None = None,
    ) -> Viform:
        """Films `cycles` cycles.

        Args:
            light: test light, lux; it must reach a cycle further.
            cycles: from instant 0.
            shape: (height, width) of the piece of the sensor.
            seed: of the noise.
            rows: first row and end of the rows that are filmed, None for all.
        """
        ...
