"""When a row is sampled: one after another within the cycle, and a comparator's delay early.

The row selectors read a chip row by row (EP4340384, US12581222B2), so what row r latches in cycle k
is the light up to edge k + 1 + skew r / H. A comparator that answers t_d late lets the latch see
what the charge was t_d before. Both move the instant alone: nothing is lost, so a row sees the same
light at another time, and one offset a row is the whole of them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.clock import PS, Clock

__all__ = ["row_delays", "row_offsets"]


def row_delays(clock: Clock, height: int, skew: float) -> npt.NDArray[np.float64]:
    """Picoseconds after a latch edge at which each row of a chip is sampled, (height,)."""
    return np.asarray(np.arange(height) * (skew * float(PS * clock.period) / height))


def row_offsets(
    clock: Clock, height: int, skew: float, delay: float, rows: tuple[int, int]
) -> npt.NDArray[np.int64]:
    """Picoseconds from a latch edge to the instant at which each of `rows` (first, stop) has its
    charge compared: (stop - first,) int64, within a cycle of the edge.

    height: rows of the chip. skew: share of a cycle that it takes to sample all of them, 0 to 1.
    delay: of the comparator, seconds, at most a cycle. Raises ValueError beyond these.
    """
    if not 0 <= skew <= 1:
        raise ValueError(f"row skew must be 0 to 1 cycle, not {skew:g}")
    if not 0 <= delay <= float(clock.period):
        raise ValueError(
            f"comparator delay must be 0 to {float(clock.period):g} s, not {delay:g} s"
        )
    late = row_delays(clock, height, skew)[slice(*rows)] - delay * PS
    return np.rint(late).astype(np.int64)
