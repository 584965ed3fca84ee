"""State of the fast tier across a write to the threshold's register."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.latched.fast.array import LANES, PixelArray
from sensor.latched.fast.units import DEAD_TIME, NOISE, current_thresholds, draw_thresholds
from sensor.latched.pixel.settling import settle

__all__ = ["taken_over"]

Mask = npt.NDArray[np.bool_]


def taken_over(
    array: PixelArray,
    before: PixelArray,
    state: dict[str, npt.NDArray[Any]],
    fresh: Mask,
    interval: int,
) -> tuple[dict[str, npt.NDArray[Any]], Mask]:
    """The state of pixels that take over from others of another threshold.

    Args:
        array, before: the pixels after and before the write; they differ in the threshold.
        state: state of those before; see `FastPixels.state`.
        fresh: (n,) pixels that start without charge.
        interval: index of their interval.

    Returns:
        The state, and (n,) the pixels that fire in the next cycle whatever its light.

    Raises:
        ValueError: charge beyond the threshold meets a hard reset or a dead time, whose kernels
            need the light of the cycle for it. The exact tier simulates it.
    """
    flags = array.trimmed(np.repeat(array.group_flags, LANES, axis=1))
    charge = state["charge"].astype(np.int32)
    spikes = np.where(fresh, np.uint64(interval), state["spikes"].astype(np.uint64))
    plain = flags == 0
    stored = np.where(fresh, 0.0, _stored(before, charge, state["spikes"], flags))
    part = stored * (before.model.mean / array.model.mean)  # in the mean threshold after the write
    fires = plain & (part >= 1)
    phase = np.floor((part[plain] % 1.0) * 2.0**32).astype(np.int64).astype(np.uint32)
    deficit = _deficit(array, part, spikes, flags)
    if (~plain).any():
        fires[~plain] = _pending(array, deficit, spikes, flags, ~plain)
    out = deficit.astype(np.int32)
    out[plain] = phase.view(np.int32)
    return {"charge": out, "spikes": spikes}, fires


def _running(
    array: PixelArray, spikes: npt.NDArray[np.uint64], flags: npt.NDArray[np.uint8]
) -> npt.NDArray[np.float64]:
    """Threshold of the current interval, (n,), in mean thresholds."""
    threshold = np.ones(spikes.shape)
    drawn = (flags & NOISE) != 0
    if drawn.any():
        numbers = array.numbers[drawn]
        threshold[drawn] = current_thresholds(array.model, spikes[drawn], numbers)
    return threshold


def _stored(
    array: PixelArray, charge: npt.NDArray[np.int32], spikes: Any, flags: npt.NDArray[np.uint8]
) -> npt.NDArray[np.float64]:
    """Stored charge, (n,), in mean thresholds."""
    threshold = _running(array, spikes.astype(np.uint64), flags)
    held = threshold - (charge + 1.0) / array.units.one
    return np.where(flags == 0, charge.view(np.uint32) / 2.0**32, held)


def _deficit(
    array: PixelArray,
    part: npt.NDArray[np.float64],
    spikes: npt.NDArray[np.uint64],
    flags: npt.NDArray[np.uint8],
) -> npt.NDArray[np.int64]:
    """Deficit of a stored charge, (n,) in units; a tie fires."""
    threshold = _running(array, spikes, flags)
    return (np.ceil((threshold - part) * array.units.one) - 1).astype(np.int64)


def _pending(
    array: PixelArray,
    deficit: npt.NDArray[np.int64],
    spikes: npt.NDArray[np.uint64],
    flags: npt.NDArray[np.uint8],
    mine: Mask,
) -> Mask:
    """Takes charge beyond the threshold off the deficits of pixels with flags, in place; returns
    which of these pixels fire."""
    units, rule = array.units, array.model.reset
    some, k, numbers, kinds = deficit[mine], spikes[mine], array.numbers[mine], flags[mine]
    if rule == "subtract":  # it stays, and the kernels fire once a cycle
        deficit[mine] = np.maximum(some, array.deepest)
        return np.zeros(some.shape, bool)
    over = some < 0
    if (over & ((kinds & DEAD_TIME) != 0)).any() or (over.any() and rule == "hard"):
        raise ValueError(
            "charge beyond a written threshold must meet residual or subtract without dead time in "
            f"the fast tier, not {rule} with {array.model.dead_time:g} cycle"
        )

    def draw(spike: npt.NDArray[np.uint64], due: Mask) -> npt.NDArray[np.int64]:
        drawn = draw_thresholds(units, spike, numbers[due], array.model.seed)
        return np.where((kinds[due] & NOISE) != 0, drawn, units.one).astype(np.int64)

    fires = settle(some, k, units.one, draw)
    deficit[mine], spikes[mine] = some, k
    return fires
