"""Detection by the charge of the pixels, over a window of symbols.

Each pixel with most of its light from one cell is decided by the forward-backward recursion on its
charge, with random data. The log likelihood ratios of a cell's pixels add up. It costs some
thousand times the joint detector.

The trellis has the distribution of a tick's charge on a grid. A pixel with share s of its light
from a cell with bit b gathers off + s (on - off) b thresholds in a tick, and the light of
neighbouring cells, half of which are on at random. Arrivals are Poisson; with other noise, normal
with the sum of the variances.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.cores import by_rows
from cosim.spikes.viform import WORD, Words
from link.detect.counting import PHASES
from link.detect.detector import LIMIT, Bits, Soft, bits_held
from link.detect.geometry import PLACES, SHARES, CellImages, cell_images
from link.detect.pixel import PixelLaw, Rule
from link.detect.trellis import likelihood, posterior, window
from link.layout import PERIOD, Layout, pilots
from link.timing import Registration, Timing

_MOSTLY: Final = SHARES // 2
"""Smallest class of share of a pixel that is used."""
_PIXELS: Final = 4
"""Largest number of pixels used for a cell."""
_BEFORE, _AFTER = 6, 2
"""Symbols before and after the requested ones in the window, if the words contain them."""
_LEARNED: Final = 96
"""Number of cells that the pixel's properties are learned from."""
LEVELS = 40
"""Steps of charge in a threshold, unless it has fewer electrons."""
_TAIL = 1e-9
"""Probability below which a transition is omitted."""
Values = npt.NDArray[np.float64]


class ForwardBackward:
    """The forward-backward detector; see `Detector`.

    Properties of the pixels that are unknown are learned: the light and reset rule that maximise
    the likelihood of the spikes of known symbols.

    Args:
        layout, registration, timing: cells, their place in the image and their time.
        pixel: known properties of the pixels.
        pairs: whether symbols come in Manchester pairs of opposite bits, which the recursion then
            uses; None to take it from the mode.
        levels: steps of charge in a threshold.
    """

    def __init__(
        self,
        layout: Layout,
        registration: Registration,
        timing: Timing,
        pixel: PixelLaw | None = None,
        *,
        pairs: bool | None = None,
        levels: int = LEVELS,
    ) -> None:
        self._layout, self._registration, self._timing = layout, registration, timing
        self._cells = cell_images(layout, registration)
        self._pixel = pixel or PixelLaw()
        self._pairs = layout.mode.line == "manchester" if pairs is None else pairs
        self._levels = levels
        self._laws: ChargeLaws | None = None
        if None not in (self._pixel.off, self._pixel.on, self._pixel.reset):
            self._laws = self._charge_laws(self._pixel)

    @property
    def pixel(self) -> PixelLaw:
        """Properties of the pixels, known or learned."""
        return self._pixel

    def _charge_laws(self, pixel: PixelLaw) -> ChargeLaws:
        shares = np.minimum((np.arange(SHARES) + 0.5) / SHARES, 1.0)
        shares[-1] = 1.0
        fractions = np.concatenate([[0.0], (np.arange(PHASES) + 0.5) / PHASES])
        return charge_laws(pixel, shares, fractions, self._levels)

    def _shift(self, first_symbol: int, count: int) -> tuple[float, float]:
        middle = self._timing.start(first_symbol + count / 2, self._timing.rows / 2)
        return self._registration.shift(float(middle))

    def _learn(
        self, cells: CellImages, words: Words, start_tick: int, known: Bits, first_symbol: int
    ) -> None:
        """Learns the pixel's properties from the best pixels of cells spread over the panel."""
        if self._laws is not None:
            return
        place, shift = cells.places, self._shift(first_symbol, len(known))
        picked: list[tuple[Any, ...]] = []
        pixels = np.linspace(0, cells.x.size - 1, 8 * _LEARNED).astype(np.intp)
        for cell in pixels[np.argsort(np.arange(pixels.size) % 8, kind="stable")]:
            u, v = cells.x[cell] + shift[0], cells.y[cell] + shift[1]
            x, y = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
            at = (
                cells.region[cell], min(int((v - y + 0.5) * PLACES), PLACES - 1),
                min(int((u - x + 0.5) * PLACES), PLACES - 1), 0,
            )  # fmt: skip
            row, column, s = y + place.dy[at], x + place.dx[at], int(place.share[at])
            inside = 0 <= row < words.shape[1] and 0 <= column < words.shape[2]
            if not inside or len(picked) >= _LEARNED:
                continue
            begin = int(self._timing.start(first_symbol, v)) - start_tick
            stop = int(self._timing.start(first_symbol + len(known), v)) - start_tick
            if begin < 0 or stop > len(words) * WORD:
                continue
            ticks = np.arange(begin, stop)
            train = ((words[ticks // WORD, row, column] >> (ticks % WORD)) & 1).astype(np.uint8)
            fraction, under_way = np.empty((2, len(ticks)), np.int64)
            time = self._timing
            window(
                time.first - start_tick, time.period, time.slope, time.rows, v, first_symbol,
                len(known), begin, fraction, under_way,
            )  # fmt: skip
            picked.append((train, fraction, under_way, known[:, cell].astype(np.int8), s))
        if not picked:
            raise ValueError("the known symbols must lie within the words")
        self._pixel = self._likeliest(picked)
        self._laws = self._charge_laws(self._pixel)

    def _likeliest(self, picked: list[tuple[Any, ...]]) -> PixelLaw:
        from scipy.optimize import minimize

        def cost(light: npt.NDArray[np.float64], rule: Rule) -> float:
            off, swing = np.exp(light)
            laws = self._charge_laws(replace(self._pixel, reset=rule, off=off, on=off + swing))
            tables = laws.chance, laws.low, laws.high, laws.merged, laws.levels, laws.hard
            return -float(sum(likelihood(*(*one, *tables)) for one in picked))

        rules: tuple[Rule, ...] = ("hard", "residual")
        best, least = self._pixel, np.inf
        for rule in rules if self._pixel.reset is None else (self._pixel.reset,):
            bounds = [(np.log(1e-3), np.log(2.0)), (np.log(0.1), np.log(8.0))]
            fit = minimize(
                cost, np.log([0.05, 1.2]), (rule,), "Nelder-Mead", bounds=bounds,
                options={"xatol": 0.02, "fatol": 0.5, "maxfev": 50},
            )  # fmt: skip
            if fit.fun < least:
                least, (off, swing) = fit.fun, np.exp(fit.x)
                best = replace(self._pixel, reset=rule, off=float(off), on=float(off + swing))
        return best

    def learn(self, words: Words, start_tick: int, known: Bits, first_symbol: int) -> None:
        self._learn(self._cells, words, start_tick, known, first_symbol)

    def learn_pilots(self, words: Words, start_tick: int, first_symbol: int, count: int) -> None:
        places = np.flatnonzero(self._layout.pilot)
        bits = pilots()[(first_symbol + np.arange(count)) % PERIOD]
        known = np.repeat(bits[:, None], len(places), axis=1)
        cells = cell_images(self._layout, self._registration, places, columns_alike=True)
        self._learn(cells, words, start_tick, known, first_symbol)

    def soft(
        self, words: Words, start_tick: int, first_symbol: int, count: int,
        stop_tick: int | None = None,
    ) -> Soft:  # fmt: skip
        if self._laws is None:
            raise ValueError("the detector must have learned from known symbols before")
        cells, place, laws, time = self._cells, self._cells.places, self._laws, self._timing
        before = _BEFORE + (first_symbol - _BEFORE) % 2  # pairs begin at even symbols
        symbol, symbols = first_symbol - before, before + count + _AFTER
        edge = [time.start(n, [0, time.rows]) for n in (symbol, symbol + symbols)]
        begin = max(int(np.floor(edge[0].min())) - start_tick, 0)
        held = bits_held(words, start_tick, stop_tick)
        stop = min(int(np.ceil(edge[1].max())) - start_tick, held)
        out = np.zeros((count, cells.x.size), np.float32)
        if begin >= stop:
            return out
        by_rows(
            _soft_of_cells, cells.x.size, words, begin, stop, symbol, symbols, before,
            np.array(self._shift(first_symbol, count)),
            (time.first, time.period, time.slope, float(time.rows), float(start_tick)),
            cells.region, cells.x, cells.y, place.count, place.dx, place.dy, place.share,
            self._pairs,
            laws.chance, laws.low, laws.high, laws.merged, laws.levels, laws.hard,
            np.float32(LIMIT), out,
        )  # fmt: skip
        return out


@njit(cache=True, nogil=True)
def _soft_of_cells(  # type: ignore[no-untyped-def]
    cell0, cell1, words, begin, stop, symbol, symbols, skipped, shift, time, region_of, x0, y0,
    count, dx, dy, share, pairs, chance, low, high, merged, levels, hard, limit, out,
):  # fmt: skip
    """Writes the soft values of cells `cell0` to `cell1` to `out`, (n, cells).

    The arrays of `Places` and `ChargeLaws` are separate arguments, since numba optimises the loop
    over plain arrays best.

    Args:
        begin, stop: ticks of the window, from the first one in `words`.
        symbol, symbols: first symbol and number of symbols of the window.
        skipped: symbols of the window before the first that is written.
        shift: (2,) of the image, camera pixels.
        time: first, period, slope, rows of the timing, and the tick of the first word.
    """
    height, width, ticks = words.shape[1], words.shape[2], stop - begin
    for cell in range(cell0, cell1):
        region = region_of[cell]
        u, v = x0[cell] + shift[0], y0[cell] + shift[1]
        x, y = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
        qx = min(int((u - x + 0.5) * PLACES), PLACES - 1)
        qy = min(int((v - y + 0.5) * PLACES), PLACES - 1)
        fraction, under_way = np.empty(ticks, np.int64), np.empty(ticks, np.int64)
        window(
            time[0] - time[4], time[1], time[2], time[3], v, symbol, symbols, begin, fraction,
            under_way,
        )  # fmt: skip
        states, train = np.empty((ticks + 1, 2, levels)), np.empty(ticks, np.uint8)
        values, total = np.zeros(symbols), np.zeros(out.shape[0])
        for k in range(min(count[region, qy, qx], _PIXELS)):
            s = int(share[region, qy, qx, k])
            py, px = y + dy[region, qy, qx, k], x + dx[region, qy, qx, k]
            if (s < _MOSTLY and k > 0) or py < 0 or px < 0 or py >= height or px >= width:
                continue
            for t in range(ticks):
                train[t] = (words[(begin + t) >> 5, py, px] >> ((begin + t) & 31)) & 1
            values[:] = 0.0
            posterior(
                train, fraction, under_way, pairs, s, chance, low, high, merged, levels, hard,
                states, values,
            )  # fmt: skip
            for n in range(out.shape[0]):
                total[n] += values[skipped + n]
        for n in range(out.shape[0]):
            out[n, cell] = min(max(total[n], -limit), limit)


@dataclass(frozen=True, eq=False)
class ChargeLaws:
    """Transition probabilities of a pixel's charge.

    Attributes:
        chance: (shares, fractions + 1, 2, 2, steps) float64, probability of gathering a number of
            steps, by the cell's bit before and after a symbol begins at a fraction of the tick; the
            last fraction stands for a tick without a begin.
        low, high: (shares, fractions + 1, 2, 2) int64, range of steps with a probability, high
            excluded.
        merged: (fractions + 1,) bool, whether the bit before has no light in the tick.
        levels: steps in a threshold.
        hard: whether a spike removes all charge.
    """

    chance: Values
    low: npt.NDArray[np.int64]
    high: npt.NDArray[np.int64]
    merged: npt.NDArray[np.bool_]
    levels: int
    hard: bool


def charge_laws(
    pixel: PixelLaw, shares: npt.ArrayLike, fractions: npt.ArrayLike, levels: int = LEVELS
) -> ChargeLaws:
    """Transition probabilities.

    Args:
        pixel: the pixel; light and reset must be known.
        shares: (shares,) share of the pixel's light from the cell.
        fractions: (fractions,) fraction of a tick at which a symbol begins.
        levels: steps in a threshold.

    Raises:
        ValueError: if the light or the reset of the pixel is None.
    """
    from scipy.stats import norm, poisson

    if pixel.off is None or pixel.on is None or pixel.reset is None:
        raise ValueError("the pixel's light and reset must be given or learned")
    part = np.asarray(shares, np.float64)
    at = np.append(np.asarray(fractions, np.float64), 1.0)
    levels = max(min(levels, int(pixel.threshold)), 2)
    bits = np.arange(2)
    # (shares, fractions, before, after); at fraction 1 no symbol begins and the bit before counts
    lit = at[:, None, None] * bits[:, None] + (1 - at)[:, None, None] * bits
    swing, others = pixel.on - pixel.off, 1 - part
    mean = pixel.off + swing * (part[:, None, None, None] * lit + others[:, None, None, None] / 2)
    electrons, step = mean * pixel.threshold, pixel.threshold / levels
    other = pixel.noise**2 + (swing * others * pixel.threshold / 2) ** 2
    spread = np.sqrt(electrons + other[:, None, None, None])
    steps = int(np.ceil((electrons + 8 * spread).max() / step)) + 2
    edge = (np.arange(steps + 1) - 0.5) * step
    below = norm.cdf(edge, electrons[..., None], np.maximum(spread, 1e-9)[..., None])
    below[..., 0] = 0.0
    plain = other == 0
    below[plain] = poisson.cdf(np.ceil(edge) - 1, electrons[plain][..., None])
    chance = np.diff(below)
    chance /= chance.sum(axis=-1, keepdims=True)
    possible = chance > _TAIL
    low = possible.argmax(axis=-1)
    high = steps - possible[..., ::-1].argmax(axis=-1)
    return ChargeLaws(
        chance, low.astype(np.int64), high.astype(np.int64), at == 0, levels,
        pixel.reset == "hard",
    )  # fmt: skip
