"""The timing to hundredths of a tick: known symbols, shown again to pixels that are computed.

A pixel whose charge is put to zero at its spike hides where within a tick a symbol begins: half a
tick of light may fire or not, by what was left over before. Correlation is then wrong by up to half
a tick. So the charge of some thousand pixels is computed from the known cells around them, and the
phase, the light's level and its background are those that make the observed spikes likeliest. What
a pixel does next is judged from its spikes so far, so that errors do not add up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from link.layout import PERIOD, Layout, pilots
from link.receiving.kernels import likelihood as compiled
from link.receiving.recording import Recording
from link.receiving.refining import project
from link.timing import Registration, Timing

__all__ = [
    "FLOOR",
    "NOISE",
    "RULES",
    "SKIP",
    "Levels",
    "Sampling",
    "Witnesses",
    "choose_witnesses",
    "known_cells",
    "known_pilots",
    "light_on",
    "likelihood",
    "likelihoods",
    "match",
]

Floats = npt.NDArray[np.float64]
NOISE: Final = 0.09
"""Standard deviation of charge at a spike, thresholds: of light, threshold and model together."""
FLOOR: Final = 0.02
"""Least probability of anything: a pixel that the model does not describe has no veto."""
RULES: Final = ("residual", "hard", "subtract")
SKIP: Final = 4
"""Ticks until a pixel's charge is known."""
_PURE, _ENOUGH = 0.98, 400
"""Share of light from one cell of pixels that see it alone, and how many of them are enough."""
_LEAST_PIXELS, _LEAST_TICKS = 100, 16


@dataclass(frozen=True)
class Levels:
    """on, background: thresholds a tick that full light adds, and that is always there. reset: the
    rule by which the pixels seem to go. likelihood: mean ln P of an observed bit."""

    on: float
    background: float
    reset: str
    likelihood: float


@dataclass(frozen=True, eq=False)
class Witnesses:
    """Pixels that are computed: rows and columns (n,); light of each symbol from `begin` on, (n,
    symbols) float64, 0 to 1; bits (n, ticks) uint8 of 0 and 1, from tick `tick` on. cells: that
    they look at, all together."""

    rows: Floats
    columns: Floats
    light: Floats
    begin: int
    bits: npt.NDArray[np.uint8]
    tick: int
    cells: int

    @property
    def independent(self) -> float:
        """Share of the pixels that err on their own: those of one cell see the same light, and the
        model is wrong of all of them together."""
        return min(self.cells / len(self.rows), 1.0)

    def some(self, count: int) -> Witnesses:
        """Evenly chosen ones of them."""
        pick = slice(None, None, max(1, len(self.rows) // count))
        return replace(
            self,
            rows=self.rows[pick],
            columns=self.columns[pick],
            light=self.light[pick],
            bits=self.bits[pick],
        )


def known_pilots(layout: Layout, begin: int, count: int) -> npt.NDArray[np.float32]:
    """What cells show on average where only the pilots are known, (count, rows, columns)."""
    out = np.full((count, *layout.shape), 0.5, np.float32)
    out[:, layout.pilot] = pilots()[(begin + np.arange(count)) % PERIOD, None]
    return out


def known_cells(layout: Layout, begin: int, data: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """All cells of symbols whose data cells (n, cells) are known, (n, rows, columns)."""
    out = np.zeros((len(data), *layout.shape), np.bool_)
    out.reshape(len(data), -1)[:, layout.data] = data
    out[:, layout.pilot] = pilots()[(begin + np.arange(len(data))) % PERIOD, None]
    return out


class Sampling(NamedTuple):
    """How witnesses are drawn.

    Attributes:
        pixels: number of them, at most.
        of_pilots: whether they lie on pilot cells; otherwise within the panel.
        pure: whether pixels that see several cells are left out if enough others are there: where
            cells meet, light follows blur and registration, whose errors would pass for delay.
        seed: of the draw.
    """

    pixels: int = 1500
    of_pilots: bool = False
    pure: bool = True
    seed: int = 1


DEFAULT: Final = Sampling()


def choose_witnesses(
    recording: Recording, layout: Layout, registration: Registration, timing: Timing,
    known: npt.NDArray[np.bool_] | npt.NDArray[np.float32], begin: int, how: Sampling = DEFAULT,
) -> Witnesses | None:  # fmt: skip
    """Pixels whose light is known, drawn at random; None if there are too few pixels or ticks.

    Args:
        recording: of the camera.
        layout, registration, timing: of the panel on it.
        known: cells of consecutive symbols, (n, rows, columns).
        begin: number of the first of these symbols.
        how: pixels are drawn.
    """
    count, of_pilots, pure, seed = how
    mode, h = layout.mode, registration.homography
    rng = np.random.default_rng(seed)
    middle = float(timing.start(begin + len(known) / 2, timing.rows / 2))
    dx, dy = registration.shift(middle)
    h = np.array([[1, 0, dx], [0, 1, dy], [0, 0, 1]]) @ h
    if of_pilots:
        row, column = np.nonzero(layout.pilot)
        pick = rng.permutation(len(row))[: 4 * count]
        x, y = ((a[pick] + 0.5) * mode.cell - 0.5 for a in (column, row))
    else:
        edge = layout.tag
        x = rng.uniform(mode.width * 0.02, mode.width * 0.98 - 1, 4 * count)
        y = rng.uniform(edge, mode.height - edge - 1, 4 * count)
    u, v = (np.rint(a) for a in project(h, x, y))
    height, width = recording.shape
    in_view = (u >= 0) & (v >= 0) & (u < width) & (v < height)
    u, v = u[in_view], v[in_view]
    share, cell = _purity(layout, h, registration.blur, u, v)
    within = share > _PURE
    if pure and np.count_nonzero(within) >= _ENOUGH:
        u, v, cell = u[within], v[within], cell[within]
    u, v, cell = u[:count], v[:count], cell[:count]
    if len(u) < _LEAST_PIXELS:
        return None
    late = (timing.start(begin, v), timing.start(begin + len(known), v))
    low = max(int(np.ceil(late[0].max())) + 2, recording.first)
    high = min(int(np.floor(late[1].min())) - 2, recording.stop)
    if high - low < _LEAST_TICKS:
        return None
    bits = recording.pixels(v.astype(np.intp), u.astype(np.intp))
    bits = np.ascontiguousarray(bits[low - recording.first : high - recording.first].T)
    light = light_on(layout, h, registration.blur, u, v, known)
    return Witnesses(v, u, light, begin, bits, low, len(np.unique(cell)))


def light_on(
    layout: Layout, h: Floats, blur: float, u: Floats, v: Floats, known: npt.NDArray[Any]
) -> Floats:
    """Share of full light on camera pixels in each symbol, (pixels, n)."""
    row, column, weight = _taps(layout, h, blur, u, v)
    out = np.empty((len(u), len(known)))
    for n, cells in enumerate(known):
        out[:, n] = np.sum(weight * cells[row, column], axis=1)
    return out


def _purity(
    layout: Layout, h: Floats, blur: float, u: Floats, v: Floats
) -> tuple[Floats, npt.NDArray[np.intp]]:
    """Of camera pixels: the share of light from the cell in their middle, and which it is."""
    row, column, weight = _taps(layout, h, blur, u, v)
    cell = row * layout.shape[1] + column
    middle = cell[:, cell.shape[1] // 2]
    return np.sum(weight * (cell == middle[:, None]), axis=1), middle


def _taps(
    layout: Layout, h: Floats, blur: float, u: Floats, v: Floats
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Floats]:
    """Cell row and column of the panel pixels around camera pixels, and their weights, each
    (pixels, taps)."""
    mode = layout.mode
    scale = float(np.sqrt(abs(np.linalg.det(h[:2, :2]))))
    spread = max(blur, 0.05)
    reach = int(np.clip(np.ceil((2.6 * spread + (1 + scale) / 2) / scale), 1, 14))
    near = np.arange(-reach, reach + 1)
    x0, y0 = project(np.linalg.inv(h), u, v)
    qx = (np.rint(x0)[:, None, None] + near + 0 * near[:, None]).reshape(len(u), -1)
    qy = (np.rint(y0)[:, None, None] + near[:, None] + 0 * near).reshape(len(u), -1)
    cu, cv = project(h, qx, qy)
    weight = _overlap(cu - u[:, None], spread, scale) * _overlap(cv - v[:, None], spread, scale)
    rows, columns = layout.shape
    row = np.clip((qy // mode.cell).astype(np.intp), 0, rows - 1)
    column = np.clip((qx // mode.cell).astype(np.intp), 0, columns - 1)
    return row, column, weight / weight.sum(1, keepdims=True)


def _overlap(distance: Floats, blur: float, side: float) -> Floats:
    """Light along one axis between a camera pixel and a panel pixel of `side` at a distance,
    through a Gaussian blur: a box of 1, one of `side` and the Gaussian, convolved."""
    from scipy.special import ndtr

    value = np.zeros_like(distance)
    for sign, edge in ((1, (1 + side) / 2), (-1, (1 - side) / 2), (-1, (side - 1) / 2),
                       (1, -(1 + side) / 2)):  # fmt: skip
        z = (distance + edge) / blur
        value += sign * blur * (z * ndtr(z) + np.exp(-z * z / 2) / np.sqrt(2 * np.pi))
    return value / side


def likelihoods(w: Witnesses, timing: Timing, levels: Levels) -> Floats:
    """ln P of the observed bits of each pixel, (n,)."""
    return np.asarray(
        compiled(
            w.bits, w.light, timing.start(w.begin, w.rows), w.tick, timing.period, levels.on,
            levels.background, RULES.index(levels.reset), NOISE, FLOOR, SKIP,
        )
    )  # fmt: skip


def likelihood(w: Witnesses, timing: Timing, on: float, background: float, reset: str) -> float:
    """Mean ln P of the observed bits."""
    total = float(likelihoods(w, timing, Levels(on, background, reset, 0.0)).sum())
    return total / (len(w.rows) * max(w.bits.shape[1] - SKIP, 1))


def match(w: Witnesses, timing: Timing) -> float:
    """Correlation of the spikes with the light of the symbols that are said to be known, symbol by
    symbol: near 0 where they were others."""
    ticks = np.arange(w.bits.shape[1])
    at = (w.tick + ticks[None, :] + 0.5 - timing.start(w.begin, w.rows)[:, None]) / timing.period
    index = np.clip(at.astype(np.intp), 0, w.light.shape[1] - 1)
    light = np.take_along_axis(w.light, index, axis=1)
    a = light - light.mean(1, keepdims=True)
    b = w.bits - w.bits.mean(1, keepdims=True)
    size = float(np.sqrt((a * a).sum() * (b * b).sum()))
    return float((a * b).sum()) / size if size > 0 else 0.0
