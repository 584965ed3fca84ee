"""Pixels under steady light that send once: their first width in closed form, and nothing after it.

With a rule of changes a pixel under steady light sends its first width and then only what is far
from it. Where that is never, or too seldom to matter (`effects.py`, "later reports"), a pixel is
one draw and one quotient. The arithmetic is the engine's for an interval that begins with the run,
so the spikes that both send agree to the last bit.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.clock import PS
from cosim.light.light import Light
from sensor.asynchronous.model import EventModel, Firings
from sensor.asynchronous.pixel.interval import goal
from sensor.device.charge import later
from sensor.device.pattern import DevicePattern
from sensor.latched.pixel.interval import NO_TABLE, interval_table

Reals = npt.NDArray[np.float64]


def is_steady(light: Light, stop: int) -> bool:
    """Whether the light is one level a pixel from its first instant to `stop` (ps)."""
    piece = light.pieces[0]
    return piece.constant and piece.stop >= stop


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True, error_model="numpy")
def _first(  # type: ignore[no-untyped-def]
    numbers, plane, gain, scale, dark, table, shot, threshold, seed, tick, shortest, delay, begins,
    start, stop, out_pixel, out_instant, out_width, out_exact,
):  # fmt: skip
    """Writes the first spikes that fall after start, up to stop; their number.

    Args:
        plane: (pixels of the array,).
        scale, dark: (n,) or (1,).
    """
    q, count = float(threshold), 0
    infinite, each, dim = np.inf, scale.size > 1, dark.size > 1
    for n in range(numbers.size):
        rate = np.float64(plane[numbers[n]]) * gain
        rate = (rate * scale[n if each else 0] + dark[n if dim else 0]) / PS
        if rate <= 0.0:
            continue
        pixel = np.uint64(numbers[n])
        target = goal(table, shot, q, pixel, np.uint64(0), seed, 0.0, infinite)
        span = max(target / rate + delay, float(shortest))
        if span > stop - begins + 1.0:
            continue
        now, part = later(begins, 0.0, span)
        edge = now + (1 if part > 0.0 else 0)
        if edge <= start or edge > stop:
            continue
        out_pixel[count] = numbers[n]
        out_instant[count] = edge
        out_width[count] = -(-edge // tick) - -(-begins // tick)
        out_exact[count] = span
        count += 1
    return count


class ClosedPixels:
    """Pixels with these numbers of an array of `shape`, as `AsynchronousPixels`, but for what they
    send after their first spike.

    Raises ValueError for a model with a longest width or without a rule of changes, whose pixels
    send more.
    """

    def __init__(
        self,
        model: EventModel,
        shape: tuple[int, int],
        gain: float,
        pattern: DevicePattern | None,
        numbers: npt.NDArray[np.uint32],
        *,
        start: int = 0,
    ) -> None:
        if model.longest or not model.change:
            raise ValueError("pixels that send once must have change > 0 and no longest width")
        self.model, self.shape = model, shape
        self._gain, self._numbers, self._start = gain, numbers, start
        fixed = None if pattern is None else pattern.at(numbers)
        self._scale = np.ones(1) if fixed is None else fixed.gain
        self._dark = np.zeros(1) if fixed is None else fixed.dark
        self._table = interval_table(float(model.threshold)) if model.shot else NO_TABLE

    def unordered(self, light: Light, start: int, stop: int) -> Firings:
        """First spikes after start, up to stop (ps), in the order of the pixels' numbers. Raises
        ValueError for light that is not steady since the run began."""
        m, n = self.model, self._numbers.size
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        if light.pieces[0].start > self._start or not is_steady(light, stop):
            raise ValueError("light must be steady from the first instant on")
        plane = light.pieces[0].first
        if not (plane >= 0).all():
            raise ValueError(f"light must be 0 or more, not {float(plane.min()):g}")
        pixel, exact = np.empty(n, np.uint32), np.empty(n)
        instant, width = np.empty(n, np.int64), np.empty(n, np.int64)
        count = _first(
            self._numbers, plane.ravel(), self._gain, self._scale, self._dark,
            self._table, m.shot, m.threshold, np.uint64(m.seed), m.tick, m.shortest, m.delay,
            self._start, start, stop, pixel, instant, width, exact,
        )  # fmt: skip
        level = np.full(count, m.levels, np.uint16)
        return Firings(pixel[:count], instant[:count], width[:count], exact[:count], level, n)
