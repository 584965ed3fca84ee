"""Charge in the wrong place: above the full well it spills along columns in the image area and
along lines in the register; and frame-transfer smear, which is corrected column by column.

Image area: there is no anti-blooming drain. Half of the excess goes up and half down the column to
the next pixels with room, and leaves the array at its ends.

Multiplication register: a packet larger than its cell leaves the excess to the packet that follows,
which can then overflow as well, and so on across the end of the line and the transition cells into
the head of the next line. The number of white columns at the head of a line follows from this. (The
excess is evaluated at the end of the register; its gain in the last stages after spilling is not
modelled.)

Smear: no shutter covers the chip: a packet passes every other lit row of its column, for one row
shift each, in the two transfers together (`EmccdPixels`). With a share a = row shift / exposure a
column of signals P shows

    M_y = P_y + a (sum P - P_y),    hence    sum P = sum M / (1 + a (n - 1)),
    P_y = (M_y - a sum P) / (1 - a),

for n lit rows. This is the standard correction of frame-transfer cameras. It is exact for the means
if the light is constant, no value is clipped, and all lit rows are read; lit rows outside a window
are missing from the sum. The shot noise of the subtracted charge, of variance a (sum P - P_y),
remains.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from imagers.emccd.pixels.chip import (
    DARK_COLUMNS,
    IMAGE_COLUMNS,
    REGISTER_WELL,
    TRANSITION_CELLS,
)

Values = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def _spill_columns(charge, well):  # type: ignore[no-untyped-def]
    rows, columns = charge.shape
    up = np.zeros(rows)
    for x in range(columns):
        over = False
        for y in range(rows):
            if charge[y, x] > well:
                over = True
        if not over:
            continue
        down = 0.0
        for y in range(rows):
            excess = max(0.0, charge[y, x] - well)
            # In whole electrons, so that what is multiplied stays a count.
            up[y] = math.floor(excess / 2.0)
            charge[y, x] -= excess
            taken = min(down, well - charge[y, x])
            charge[y, x] += taken
            down += excess - up[y] - taken
        rising = 0.0
        for y in range(rows - 1, -1, -1):
            taken = min(rising, well - charge[y, x])
            charge[y, x] += taken
            rising += up[y] - taken


def spill_columns(charge: Values, well: float) -> None:
    """Spreads charge above `well` along each column, in place. charge: (rows, W), electrons."""
    _spill_columns(charge, float(well))


@njit(cache=True, nogil=True)
def _spill_lines(charge, well, gap):  # type: ignore[no-untyped-def]
    carry = 0.0
    for y in range(charge.shape[0]):
        carry = max(0.0, carry - gap * well)
        for x in range(charge.shape[1]):
            held = charge[y, x] + carry
            carry = max(0.0, held - well)
            charge[y, x] = held - carry
    return carry


def spill_lines(charge: Values, well: float = REGISTER_WELL, gap: int = TRANSITION_CELLS) -> float:
    """Moves charge above `well` to the packets that follow, in place; returns the charge that
    remains after the last line.

    Args:
        charge: (rows, W), electrons after multiplication, in the order of their readout from a
            cleared register.
        gap: empty cells between lines, each of which can hold a well.
    """
    return float(_spill_lines(charge, float(well), gap))


def columns_filled(line: Values, well: float = REGISTER_WELL) -> int:
    """Number of contiguous columns from the head of the line, dark reference included, that hold at
    least half a well: "turned from black to white"."""
    below = np.flatnonzero(line < well / 2)
    return int(below[0]) if below.size else int(line.size)


def electrons_to_fill(
    columns: int, lit: int, gain: float, well: float = REGISTER_WELL,
    tail: int = DARK_COLUMNS, gap: int = TRANSITION_CELLS,
) -> float:  # fmt: skip
    """Electrons a pixel before multiplication at which this many columns of each line's head are
    full, when the last `lit` image columns of every line are lit evenly and the rest is dark:
    lit (g m - w) = (tail + gap + columns) w.

    The dark reference columns at the tail and the transition cells fill first.
    """
    if not 0 < lit <= IMAGE_COLUMNS or not 0 <= columns <= DARK_COLUMNS + IMAGE_COLUMNS - lit:
        raise ValueError(f"{columns} columns and {lit} lit ones must fit into a line")
    return well / gain * (1.0 + (tail + gap + columns) / lit)


def without_smear(signal: Values, share: float) -> Values:
    """(rows, W) signal without smear. signal: above black, in any unit, (rows, W), all lit rows.
    share: row shift over exposure, 0 to below 1; ValueError otherwise."""
    if not 0 <= share < 1:
        raise ValueError(f"share must be 0 to below 1, not {share:g}")
    total = signal.sum(axis=0) / (1 + share * (signal.shape[0] - 1))
    return np.asarray((signal - share * total) / (1 - share))
