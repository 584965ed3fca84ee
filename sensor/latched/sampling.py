"""Sampling instants of the rows: row-by-row sampling and comparator delay.

The row selectors read a chip row by row (EP4340384, US12581222B2). Row r therefore latches in cycle
k the light up to edge k + 1 + skew r / H. With a comparator delay t_d, the latch samples the charge
of t_d before. Both effects move the sampling instant and lose no light, so one offset a row
describes them completely.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock


def row_delays(clock: Clock, height: int, skew: float) -> npt.NDArray[np.float64]:
    """Delay from a latch edge to the sampling of each row of a chip, (height,) ps."""
    return np.asarray(np.arange(height) * (skew * float(PS * clock.period) / height))


def row_offsets(
    clock: Clock, height: int, skew: float, delay: float, rows: tuple[int, int]
) -> npt.NDArray[np.int64]:
    """Offset from a latch edge to the instant at which the charge of each row is compared.

    Args:
        clock: clock of the latches.
        height: rows of the chip.
        skew: share of a cycle over which all rows are sampled, 0 to 1.
        delay: delay of the comparator in seconds, 0 to a cycle.
        rows: (first, stop) rows to return.

    Returns:
        (stop - first,) int64 ps, within a cycle of the edge.

    Raises:
        ValueError: `skew` or `delay` is out of range.
    """
    if not 0 <= skew <= 1:
        raise ValueError(f"row skew must be 0 to 1 cycle, not {skew:g}")
    if not 0 <= delay <= float(clock.period):
        raise ValueError(
            f"comparator delay must be 0 to {float(clock.period):g} s, not {delay:g} s"
        )
    offsets = row_delays(clock, height, skew)[slice(*rows)] - delay * PS
    return np.rint(offsets).astype(np.int64)
