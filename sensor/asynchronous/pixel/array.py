"""An array of asynchronous pixels: light in, firings out, each pixel at its own time.

Time is rescaled to charge: light is piecewise linear, so the charge of an interval is quadratic in
time and its inverse closed form, and shot noise is one Gamma(Q) threshold an interval (see
sensor/latched/pixel/interval.py). A run begins with every pixel empty, at its first instant.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from cosim.compute.cores import cores
from cosim.compute.memory import check_memory
from cosim.compute.stopping import threads
from cosim.errors import InputError
from cosim.light.light import Light, Piece
from sensor.asynchronous.model import EventModel, Firings
from sensor.asynchronous.pixel.engine import advance
from sensor.device.pattern import DevicePattern
from sensor.latched.pixel.interval import NO_TABLE, interval_table

TILE: Final = 2048
"""Pixels that are run together; results do not depend on it."""
_BUFFER: Final = 1 << 15
STEP_BYTES: Final = 70
"""Memory that joining and ordering a step's events takes for each: two copies and their order."""
FEWER: Final = (
    "shorten duration, simulate fewer pixels, or send changes alone (sensor.asynchronous.change, 8 "
    "for example)"
)

Rates = npt.NDArray[np.float64]


class AsynchronousPixels:
    """Pixels of an array under a model. The noise of a pixel depends on its number alone.

    Args:
        model: rules of a pixel.
        shape: shape of the array, (H, W).
        gain: photoelectrons a second for a unit of light.
        pattern: pattern of the device, None for a perfect one.
        start: instant at which the run begins, ps.
        most: firings of the whole run beyond which it ends with InputError.
        tile: pixels that are run together.
        numbers: numbers of the pixels that are run, (n,); all if None.
    """

    def __init__(
        self,
        model: EventModel,
        shape: tuple[int, int],
        gain: float,
        pattern: DevicePattern | None = None,
        *,
        start: int = 0,
        most: int = 20_000_000,
        tile: int = TILE,
        numbers: npt.NDArray[np.uint32] | None = None,
    ) -> None:
        self.model, self.shape = model, shape
        self._gain, self._tile, self._most = gain, tile, most
        self._fired = 0
        self._chosen = numbers
        whole = np.arange(shape[0] * shape[1], dtype=np.uint32)
        self._pixels = whole if numbers is None else numbers
        n = self._pixels.size
        fixed = None if pattern is None else pattern.at(self._pixels)
        self._scale: Rates | None = None if fixed is None else fixed.gain
        self._dark: Rates | None = None if fixed is None else fixed.dark
        self._table = interval_table(float(model.threshold)) if model.shot else NO_TABLE
        self._state = (
            np.full(n, start, np.int64), np.zeros(n), np.zeros(n), np.full(n, -1.0),
            np.zeros(n, np.uint64), np.full(n, -1.0), np.zeros(n), np.full(n, -1, np.int64),
            np.full(n, -1, np.int64),
        )  # fmt: skip
        self._known: list[tuple[npt.NDArray[np.float32], Rates]] = []

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next step depends on."""
        kept = {f"pixels{n}": array.copy() for n, array in enumerate(self._state)}
        return kept | {"fired": np.array(self._fired)}

    def restore(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        for n, array in enumerate(self._state):
            array[:] = state[f"pixels{n}"]
        self._fired = int(state["fired"])

    def rate(self, plane: npt.NDArray[np.float32]) -> Rates:
        """Electrons a second of every pixel under a plane of light, (n,)."""
        mine = plane.ravel() if self._chosen is None else plane.ravel()[self._chosen]
        if not (mine >= 0).all():
            raise ValueError(f"light must be 0 or more, not {float(mine.min()):g}")
        electrons = mine.astype(np.float64) * self._gain
        if self._scale is not None and self._dark is not None:
            electrons = electrons * self._scale + self._dark
        return electrons

    def _rates(self, plane: npt.NDArray[np.float32]) -> Rates:
        """Electrons a picosecond; a plane that two pieces share is computed once."""
        for known, rates in self._known:
            if known is plane:
                return rates
        rates = self.rate(plane) / PS
        self._known = [*self._known[-1:], (plane, rates)]
        return rates

    def step(self, light: Light, start: int, stop: int) -> Firings:
        """Firings after start, up to stop (ps). Raises InputError where they are too many."""
        return self.unordered(light, start, stop).ordered()

    def unordered(self, light: Light, start: int, stop: int) -> Firings:
        """The same in any order."""
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        parts = []
        for piece in light.pieces:
            if piece.stop > start and piece.start < stop:
                parts += self._piece(piece, min(stop, piece.stop))
        check_memory("the events of a step", STEP_BYTES * sum(len(part) for part in parts), FEWER)
        return Firings.join(parts)

    def _piece(self, piece: Piece, stop: int) -> list[Firings]:
        first = self._rates(piece.first)
        last = first if piece.constant else self._rates(piece.last)
        spans = [(n, min(n + self._tile, first.size)) for n in range(0, first.size, self._tile)]
        if len(spans) == 1:
            return self._run(spans[0], first, last, piece, stop)
        with threads(cores()) as pool:
            tiles = [pool.submit(self._run, span, first, last, piece, stop) for span in spans]
            try:
                return [part for tile in tiles for part in tile.result()]
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                self._most = -1  # what is under way ends at its next full buffer
                raise

    def _run(
        self, span: tuple[int, int], first: Rates, last: Rates, piece: Piece, stop: int
    ) -> list[Firings]:
        """One tile through one piece, buffer by buffer."""
        m, chosen = self.model, slice(*span)
        state = [array[chosen] for array in self._state]  # views: they are written to
        pixels, parts, at = self._pixels[chosen], [], 0
        # A tile fires about once a pixel where only changes are sent: room for that at first.
        room = min(_BUFFER, 2 * (span[1] - span[0]))
        while at < span[1] - span[0]:
            pixel, level = np.empty(room, np.uint32), np.empty(room, np.uint16)
            instant, width = np.empty(room, np.int64), np.empty(room, np.int64)
            exact = np.empty(room)
            at, count, turns = advance(  # type: ignore[call-arg]
                pixels, *state, first[chosen], last[chosen], piece.start, piece.stop, stop,
                self._table, m.shot, m.threshold, np.uint64(m.seed), m.tick, m.shortest, m.longest,
                m.levels, m.delay, m.reset, float(m.change), at, pixel, instant, width, exact,
                level,
            )  # fmt: skip
            n = slice(0, count)
            parts.append(
                Firings(
                    pixel[n].copy(),
                    instant[n].copy(),
                    width[n].copy(),
                    exact[n].copy(),
                    level[n].copy(),
                    turns,
                )
            )
            room = _BUFFER
            self._fired += count
            if self._fired > self._most:
                raise InputError(
                    "the events", f"at most {max(self._most, 0):,}", "more",
                    FEWER,
                )  # fmt: skip
        return parts
