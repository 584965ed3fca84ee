"""`Frame`: output of a conventional imager, digital numbers with exposure and row times."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of a conventional imager.

    Attributes:
        values: (H, W) uint16, DN.
        bits: bits of a value; full scale is 2^bits - 1.
        number: number of the frame, from 0.
        begin, end: (H,) int64 ps, start and end of each row's exposure.
        ready: ps, instant at which the last pixel of the frame has left the imager.
        state: values of the controllers for this frame (exposure multiplier, saturated pixels,
            gain step), by name.
    """

    values: npt.NDArray[np.uint16]
    bits: int
    number: int
    begin: npt.NDArray[np.int64]
    end: npt.NDArray[np.int64]
    ready: int
    state: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        rows = self.values.shape[0]
        if self.begin.shape != (rows,) or self.end.shape != (rows,):
            raise ValueError(f"times must be given for {rows} rows, not {self.begin.shape}")
        if (self.end < self.begin).any():
            raise ValueError("a row's exposure must not end before it begins")

    @property
    def exposure(self) -> int:
        """Exposure time of the first row, ps."""
        return int(self.end[0] - self.begin[0])

    @property
    def full_scale(self) -> int:
        """Largest possible value, DN."""
        return (1 << self.bits) - 1
