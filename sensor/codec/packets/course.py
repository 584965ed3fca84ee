"""The course of a block's spikes within a packet, compiled: how many there are up to a cycle.

It is linear within each word of 32 cycles. Spikes of a pixel whose times are unknown are expected
to lie evenly in this count, not in time.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.spikes.viform import WORD

SPAN_LEVEL = 2
"""Level of the sums whose course is known, blocks of 2^2 x 2^2 pixels."""
ONE = 16
"""Binary places of a count of spikes."""


def course_of(
    spans: npt.NDArray[np.int32], cycles: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """(spikes of each block before each word and in all, (rows, columns, n + 1); whether a block
    changes, (rows, columns)) of (n, rows, columns) spans."""
    n, rows, columns = spans.shape
    course = np.zeros((rows, columns, n + 1), np.int64)
    np.cumsum(np.moveaxis(spans, 0, -1), axis=-1, out=course[..., 1:])
    begun = np.minimum(WORD * np.arange(n + 1), cycles)
    whole = course[..., -1:]
    changes = (np.abs(course * cycles - whole * begun) >= cycles).any(axis=-1)
    return course, changes


@njit(cache=True, nogil=True)
def spikes_up_to(course, t, cycles):  # type: ignore[no-untyped-def]
    """Spikes, in 2^-ONE, up to the middle of cycle t. course: of one block."""
    w = t // WORD
    length = min(WORD, cycles - WORD * w)
    own = (course[w + 1] - course[w]) << ONE
    return (course[w] << ONE) + own * (2 * (t - WORD * w) + 1) // (2 * length)


@njit(cache=True, nogil=True)
def time_of(course, spikes, cycles):  # type: ignore[no-untyped-def]
    """The cycle in which a count of `spikes`, in 2^-ONE, is reached; 0 to cycles - 1."""
    w = 0
    while w + 2 < course.size and course[w + 1] << ONE <= spikes:
        w += 1
    own = (course[w + 1] - course[w]) << ONE
    length = min(WORD, cycles - WORD * w)
    inside = (spikes - (course[w] << ONE)) * length // own if own else 0
    return WORD * w + min(max(inside, 0), length - 1)
