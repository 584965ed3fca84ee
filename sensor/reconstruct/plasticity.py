"""TFSTP, texture from short-term plasticity: a model synapse at each pixel, whose state gives the
light (Zheng et al., "High-speed image reconstruction through short-term plasticity for spiking
cameras", CVPR 2021, and IEEE Trans. Pattern Anal. Mach. Intell. 45:8127, 2023).

The synapse (Tsodyks, Pawelzik and Markram, Neural Comput. 10:821, 1998) has resources R and a
utilisation u. Between spikes both recover, R to 1 with the time constant tau_D and u to u_0 with
tau_F. A spike consumes resources and raises the utilisation: R -> R - u R, u -> u + f (1 - u). From
one spike to the next, an interval of tau later,

    R' = 1 - (1 - R (1 - u)) exp(-tau / tau_D)
    u' = u_0 + (u + f (1 - u) - u_0) exp(-tau / tau_F).

Constant intervals lead to a fixed point, which each state inverts to the rate 1 / tau:

    rate_R = -1 / (tau_D ln((1 - R) / (1 - R (1 - u))))
    rate_u = -1 / (tau_F ln((u - u_0) / (f - u_0 + u (1 - f)))).

R follows the last interval, u averages over about tau_F. The published image is their sum,
stretched to the range of an 8-bit image; here it is their mean, which is in spikes a cycle.

Compared by hand with the authors' program, SpikeCV (Zyj061/SpikeCV, spkProc/reconstruction/tfstp.py
and spkProc/filters/stp_filters_torch.py; Spike-Zoo has the offline form of the same), on the public
recording reds_200_part1.dat, cycle 200:

- Its online form has the R and u of `tfstp(preceding=True)`: in double precision the rates from
  them agree to 1.3e-7 at 99 % of the pixels. It takes the first spike as the end of an interval
  from the beginning of the stream, which a window of MEMORY cycles has forgotten.
- In its single precision, R is 1 after intervals above 16 cycles (4 % of the pixels), and rate_R is
  lost; here 1 - R is kept.
- It has tau_F in place of f in the logarithm of rate_u, which then is 0.02 to 0.03 at any light:
  the sum is rate_R and nearly a constant, 1.06 to 1.23 times the rate for constant intervals of 2
  to 12 cycles. The order of the pixels is nearly that of the mean here (rank correlation 0.9999).
  Stretching and histogram equalisation come on top.
- Its offline form takes an interval of n cycles n - 1 times, once in each cycle without a spike,
  because it compares with the first interval in place of the previous one. Constant light has the
  same rate; changes are followed sooner, with more noise (at that cycle 1.7 % from here, median).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.errors import InputError
from cosim.spikes.viform import WORD, SpikeStream, words_for
from sensor.reconstruct.intervals import interval_image

U_0: Final = 0.15
TAU_D: Final = 1.0
TAU_F: Final = 10.0
F: Final = 0.15
"""Constants of the authors' program; times in cycles."""
MEMORY: Final = 161
"""Cycles before the instant after which the rest state is forgotten: at a spike a cycle, u has lost
all but (1 - f) exp(-1 / tau_F) = 0.77 of it after each interval."""


@njit(cache=True, nogil=True)
def _next(spent, raised, tau):  # type: ignore[no-untyped-def]
    """1 - R and u - u_0 an interval later; 1 - R itself would lose all digits in a few cycles."""
    u = U_0 + raised
    return (
        (spent + u - spent * u) * np.exp(-tau / TAU_D),
        (raised + F * (1 - u)) * np.exp(-tau / TAU_F),
    )


@njit(cache=True, nogil=True)
def _take(word, start, first, begin, last, spent, raised):  # type: ignore[no-untyped-def]
    """Takes the intervals between the spikes of a word from cycle `start` on, those from `first` to
    each pixel's `begin`, into its state. last: its last spike so far, -1 for none."""
    for p in range(word.size):
        rest = np.uint64(word[p])
        cycle = start
        while rest and cycle <= begin[p]:
            if rest & np.uint64(1) and cycle >= first:
                if last[p] >= 0:
                    spent[p], raised[p] = _next(spent[p], raised[p], cycle - last[p])
                last[p] = cycle
            rest >>= np.uint64(1)
            cycle += 1


@njit(cache=True, nogil=True)
def _finish(begin, end, spent, raised):  # type: ignore[no-untyped-def]
    """Takes the interval that holds the instant; changes 1 - R and u - u_0 to the rate, in
    `spent`."""
    for p in range(begin.size):
        if begin[p] < 0:
            continue
        x, e = _next(spent[p], raised[p], end[p] - begin[p])
        u = U_0 + e
        by_r = x / (x + u - x * u)
        by_u = e / (F + e - F * u)
        rate = 0.0
        if by_r > 0:  # it underflows in intervals of 700 cycles
            rate -= 0.5 / (TAU_D * np.log(by_r))
        if by_u > 0:
            rate -= 0.5 / (TAU_F * np.log(by_u))
        spent[p] = rate


def tfstp(
    stream: SpikeStream, at: int, window: int = MEMORY, *, preceding: bool = False
) -> npt.NDArray[np.float32]:
    """Light by short-term plasticity at cycle `at`: (H, W) float32, spikes a cycle; 0 where a pixel
    has no interval.

    The state begins at rest and takes the intervals in order, the last being the one that holds the
    instant (as of `interval_image`).

    Args:
        window: cycles up to the instant whose spikes the state has, at least 1.
        preceding: no spike after cycle `at` is used: the last interval is the last whole one.

    Raises:
        InputError: the stream does not hold the cycle, or the window is below 1.
    """
    begin, end = interval_image(stream, at, (0, at + 1) if preceding else None)
    if window < 1:
        raise InputError("--window", "at least 1", str(window), f"try {MEMORY}")
    begins, first = begin.reshape(-1), max(at + 1 - window, 0)
    last = np.full(begins.shape, -1, np.int64)
    spent, raised = np.zeros(begins.shape), np.zeros(begins.shape)
    for w in range(first // WORD, words_for(at + 1)):
        word = stream.read_words(w, w + 1).reshape(-1)
        _take(word, w * WORD, first, begins, last, spent, raised)
    _finish(begins, end.reshape(-1), spent, raised)
    return spent.reshape(stream.shape).astype(np.float32)
