"""TFP, texture from playback: the mean of a window (Zhu et al., ICME 2019; Huang 2022 section
3.3.1, "virtual exposure")."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.errors import InputError
from cosim.spikes.viform import SpikeStream, count_spikes

PLAYED: Final = 41
"""Cycles of a window by default."""


def check_cycle(stream: SpikeStream, at: int) -> None:
    """Raises InputError unless the stream holds cycle `at`."""
    if not 0 <= at < stream.cycles:
        last = stream.cycles - 1
        raise InputError(
            "--at", f"a cycle from 0 to {last}", str(at), f"try --at {stream.cycles // 2}"
        )


def tfp(
    stream: SpikeStream, at: int, window: int = PLAYED, *, preceding: bool = False
) -> npt.NDArray[np.float32]:
    """Spikes a cycle over `window` cycles around cycle `at`: (H, W) float32 in [0, 1].

    Args:
        window: number of cycles, odd if centred. Near an end of the stream the mean is taken over
            the cycles there are.
        preceding: the window ends with cycle `at`, as in Huang 2022 (3.3.1); otherwise its centre
            is `at`, which has no lag.
    """
    first, stop = tfp_span(stream, at, window, preceding=preceding)
    return count_spikes(stream, first, stop).astype(np.float32) / np.float32(stop - first)


def tfp_span(
    stream: SpikeStream, at: int, window: int, *, preceding: bool = False
) -> tuple[int, int]:
    """First cycle of the window of `tfp`, and the one after its last, within the stream."""
    check_cycle(stream, at)
    if window < 1 or (window % 2 == 0 and not preceding):
        raise InputError(
            "--window", "odd and at least 1", str(window), f"try {max(window, 0) // 2 * 2 + 1}"
        )
    stop = at + 1 if preceding else min(at + window // 2 + 1, stream.cycles)
    return max(at + 1 - window if preceding else at - window // 2, 0), stop
