"""State of the fast tier across a write to the threshold's register."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from sensor.latched.fast.array import PixelArray
from sensor.latched.fast.units import BANK, DEAD_TIME, NOISE, draw_thresholds
from sensor.latched.pixel.settling import settle

Mask = npt.NDArray[np.bool_]


def taken_over(
    array: PixelArray,
    before: PixelArray,
    state: dict[str, npt.NDArray[Any]],
    cycle: int,
    fresh: Mask,
    interval: int,
) -> tuple[dict[str, npt.NDArray[Any]], Mask]:
    """The state of pixels that take over from others of another threshold.

    Args:
        array, before: the pixels after and before the write; they differ in the threshold.
        state: state of those before; see `FastPixels.state`.
        cycle: first cycle after the write.
        fresh: (n,) pixels that start without charge.
        interval: index of their interval. Those that draw from the bank start as if they had fired
            in the cycle before.

    Returns:
        The state, and (n,) the pixels that fire in the next cycle whatever its light.

    Raises:
        ValueError: charge beyond the threshold meets a hard reset or a dead time, whose kernels
            need the light of the cycle for it, or other pixels draw from the bank than before. The
            exact tier simulates these.
    """
    flags = array.pixel_flags
    if ((flags ^ before.pixel_flags) & BANK).any():
        raise ValueError("pixels must draw from the bank before and after a write, or neither")
    charge = state["charge"].astype(np.int32)
    first = np.where((flags & BANK) != 0, _fired_in(cycle - 1), np.uint64(interval))
    spikes = np.where(fresh, first, state["spikes"].astype(np.uint64))
    plain = flags == 0
    stored = np.where(fresh, 0.0, _stored(before, charge, state["spikes"], flags))
    part = stored * (before.model.mean / array.model.mean)  # in the mean threshold after the write
    fires = plain & (part >= 1)
    phase = np.floor((part[plain] % 1.0) * 2.0**32).astype(np.int64).astype(np.uint32)
    deficit = _deficit(array, part, spikes)
    if (~plain).any():
        fires[~plain] = _pending(array, deficit, spikes, cycle, ~plain)
    out = deficit.astype(np.int32)
    out[plain] = phase.view(np.int32)
    return {"charge": out, "spikes": spikes}, fires


def _fired_in(cycle: int, again: bool = False) -> np.uint64:
    """The latest spike of a pixel that draws from the bank; see `FastPixels.state`."""
    return np.uint64((2 * (cycle + 1) + again) % 2**32)


def _stored(
    array: PixelArray, charge: npt.NDArray[np.int32], spikes: Any, flags: npt.NDArray[np.uint8]
) -> npt.NDArray[np.float64]:
    """Stored charge, (n,), in mean thresholds."""
    threshold = array.running(spikes.astype(np.uint64))
    held = threshold - (charge + 1.0) / array.units.one
    return np.where(flags == 0, charge.view(np.uint32) / 2.0**32, held)


def _deficit(
    array: PixelArray, part: npt.NDArray[np.float64], spikes: npt.NDArray[np.uint64]
) -> npt.NDArray[np.int64]:
    """Deficit of a stored charge, (n,) in units; a tie fires."""
    threshold = array.running(spikes)
    return (np.ceil((threshold - part) * array.units.one) - 1).astype(np.int64)


def _pending(
    array: PixelArray,
    deficit: npt.NDArray[np.int64],
    spikes: npt.NDArray[np.uint64],
    cycle: int,
    mine: Mask,
) -> Mask:
    """Takes charge beyond the threshold off the deficits of pixels with flags, in place; returns
    which of these pixels fire, in `cycle`. Thresholds from the bank count as the second and further
    ones of that cycle, whose first is left for its own light."""
    units, rule = array.units, array.model.reset
    places = np.flatnonzero(mine)
    some, kinds = deficit[mine], array.pixel_flags[mine]
    if rule == "subtract":  # it stays, and the kernels fire once a cycle
        deficit[mine] = np.maximum(some, array.deepest)
        return np.zeros(some.shape, bool)
    over = some < 0
    if (over & ((kinds & DEAD_TIME) != 0)).any() or (over.any() and rule == "hard"):
        raise ValueError(
            "charge beyond a written threshold must meet residual or subtract without dead time in "
            f"the fast tier, not {rule} with {array.model.dead_time:g} cycle"
        )
    banked = (kinds & BANK) != 0
    k = np.where(banked, np.uint64(0), spikes[mine])

    def draw(spike: npt.NDArray[np.uint64], due: Mask) -> npt.NDArray[np.int64]:
        drawn = np.full(spike.shape, units.one, np.int64)
        each = ((kinds[due] & NOISE) != 0) & ~banked[due]
        numbers = array.numbers[places[due][each]]
        drawn[each] = draw_thresholds(units, spike[each], numbers, array.model.seed)
        for crossing in np.unique(spike[banked[due]]).tolist():
            alike = banked[due] & (spike == crossing)
            drawn[alike] = array.drawn(places[due][alike], cycle, crossing)
        return drawn

    fires = settle(some, k, units.one, draw)
    deficit[mine] = some
    spikes[mine] = np.where(banked, np.where(fires, _fired_in(cycle, True), spikes[mine]), k)
    return fires
