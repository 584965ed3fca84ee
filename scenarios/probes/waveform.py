"""What a spike-continuous panel makes of spikes, pixel by pixel in time: compiled.

The same drives and the same emitter as `display.PlainRenderer`, to which a test holds it; only the
order is another: a pixel's planes one after another, so that long waveforms of few pixels and the
sum over a patch cost little.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Viform
from display import DRIVES, SpikePanel

__all__ = ["every_drive", "panel_light"]

Values = npt.NDArray[np.float64]
_CODE: Final[dict[str, int]] = {name: n for n, name in enumerate(DRIVES)}


@njit(cache=True, nogil=True)
def _relax(x, length, level, rise, decay):  # type: ignore[no-untyped-def]
    """Light of a part of a plane under constant drive, and the level that it ends with."""
    constant = rise if x > level else decay
    if constant == 0:
        return x * length, x
    gone = -math.expm1(-length / constant)
    return x * length + (level - x) * constant * gone, level + (x - level) * gone


@njit(cache=True, nogil=True)
def _show(  # type: ignore[no-untyped-def]
    words, cycles, drive, pulse, rise, decay, span, group, light,
):  # fmt: skip
    """Adds the light of each plane of each pixel to light[group[pixel], plane // span].

    rise, decay: the time constants in planes, 0 for none.
    """
    slow = rise > 0 or decay > 0
    share = pulse if drive == 0 else 1.0
    one = np.uint32(1)
    for pixel in range(words.shape[1]):
        place = group[pixel]
        tau, age, seen, level, x, total = 0, 0, False, 0.0, 0.0, 0.0
        slot, left = 0, span
        word = np.uint32(0)
        for n in range(cycles):
            if n & 31 == 0:
                word = words[n >> 5, pixel]
            age += 1
            if word & one:
                if seen:
                    tau = age
                    x = 1.0 / tau
                age = 0
                seen = True
            elif drive == 2 and age > tau and tau > 0:
                x = 1.0 / age
            if drive == 0:
                x = 1.0 if word & one else 0.0
            word >>= one
            if slow:
                light_of, level = _relax(x / share, share, level, rise, decay)
                total += light_of
                if share < 1.0:
                    light_of, level = _relax(0.0, 1.0 - share, level, rise, decay)
                    total += light_of
            else:
                total += x
            left -= 1
            if left == 0:
                light[place, slot] += total
                slot, left, total = slot + 1, span, 0.0


def panel_light(
    stream: Viform,
    panel: SpikePanel,
    drive: str,
    span: int = 1,
    group: npt.NDArray[np.int64] | None = None,
) -> Values:
    """Light of a panel with this drive, packets Q a cycle, mean over each span and group.

    stream: from where the panel was dark. span: planes that are taken together; those beyond the
    last whole span are left out. group: (height, width) int, which pixels are taken together (0 to
    the largest); every pixel alone unless given. Gives (cycles // span, groups).
    """
    height, width = stream.shape
    groups = np.arange(height * width) if group is None else group.ravel()
    if groups.size != height * width:
        raise ValueError(f"groups must be of {height} x {width} pixels, not {groups.size}")
    cycles = stream.cycles // span * span
    light = np.zeros((int(groups.max()) + 1, cycles // span))
    words = stream.words.reshape(len(stream.words), -1)
    hz = panel.clock.hz
    _show(
        words, cycles, _CODE[drive], panel.pulse, panel.rise * hz, panel.decay * hz, span, groups,
        light,
    )  # fmt: skip
    light /= (span * np.bincount(groups))[:, None]
    return light.T


def every_drive(
    stream: Viform, panel: SpikePanel, span: int = 1, group: npt.NDArray[np.int64] | None = None
) -> dict[str, Values]:
    """`panel_light` of each drive by its name, side by side on the processor's cores."""
    with ThreadPoolExecutor() as pool:
        made = pool.map(lambda drive: panel_light(stream, panel, drive, span, group), DRIVES)
        return dict(zip(DRIVES, made, strict=True))
