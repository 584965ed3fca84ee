"""Timing and position of a panel from known symbols, by a model of the pixels' charge.

A pixel with hard reset hides the instant within a tick at which a symbol begins: half a tick of
light may fire or not, depending on the remaining charge. Correlation is then wrong by up to half a
tick. So the charge of about a thousand pixels is computed from the known cells around them. The
phase, the light's level and its background are those that maximise the likelihood of the observed
spikes. The prediction for a pixel uses its spikes so far, so that errors do not accumulate.

The position follows from the same model, with the image shifted slightly to each side. The change
of the likelihood of each pixel's spikes gives its displacement, and all of them together the
homography: a Newton step with numerical derivatives. Every cell is then a mark, so this registers a
panel whose tags are only a few camera pixels large.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from link.layout import PERIOD, Layout, pilots
from link.receiving.kernels import likelihood as compiled
from link.receiving.kernels import overlap
from link.receiving.recording import Recording
from link.receiving.refining import project
from link.timing import Registration, Timing

Floats = npt.NDArray[np.float64]
NOISE: Final = 0.09
"""Standard deviation of charge at a spike, thresholds: of light, threshold and model together."""
FLOOR: Final = 0.02
"""Smallest probability of any observation, so that a pixel outside the model has limited weight."""
RULES: Final = ("residual", "hard", "subtract")
SKIP: Final = 4
"""Ticks until a pixel's charge is known."""
_PURE, _ENOUGH = 0.98, 400
"""Share of light from one cell for a pixel to count as pure, and the number of pure pixels that is
enough."""
_LEAST_PIXELS, _LEAST_TICKS = 100, 16
_PIXELS: Final = 1500
_STEPS: Final = 2
_MOVE: Final = 0.15
"""Step of the numerical derivatives, camera pixels."""
_FAR: Final = 1.0
"""Largest plausible change at a corner, camera pixels."""


@dataclass(frozen=True)
class Levels:
    """Light of the cells.

    Attributes:
        on: charge of a tick that full light adds, thresholds.
        background: charge of a tick without light, thresholds.
        reset: estimated reset rule.
        likelihood: mean ln P of an observed bit.
        noise: standard deviation of the charge at a spike, thresholds.
    """

    on: float
    background: float
    reset: str
    likelihood: float
    noise: float = NOISE


@dataclass(frozen=True, eq=False)
class Witnesses:
    """Pixels whose charge is modelled.

    Attributes:
        rows, columns: (n,) float64, camera pixels.
        light: (n, symbols) float64, light of each symbol from `begin` on, 0 to 1.
        begin: first symbol.
        bits: (n, ticks) uint8 of 0 and 1, from tick `tick` on.
        tick: tick of the first bit.
        cells: number of different cells in their middles.
    """

    rows: Floats
    columns: Floats
    light: Floats
    begin: int
    bits: npt.NDArray[np.uint8]
    tick: int
    cells: int

    @property
    def independent(self) -> float:
        """Share of the pixels with independent errors: pixels of one cell share its model
        errors."""
        return min(self.cells / len(self.rows), 1.0)

    def some(self, count: int) -> Witnesses:
        """About `count` of the witnesses, evenly chosen."""
        pick = slice(None, None, max(1, len(self.rows) // count))
        return replace(
            self,
            rows=self.rows[pick],
            columns=self.columns[pick],
            light=self.light[pick],
            bits=self.bits[pick],
        )


@dataclass(frozen=True, eq=False)
class KnownSymbols:
    """Symbols whose cells are known.

    Attributes:
        begin: number of the first symbol.
        cells: (n, rows, columns) bool of all cells, or float32 means.
        pilots_only: whether only the pilots are known.
    """

    begin: int
    cells: npt.NDArray[np.bool_] | npt.NDArray[np.float32]
    pilots_only: bool = False


def known_pilots(layout: Layout, begin: int, count: int) -> KnownSymbols:
    """Symbols of which only the pilots are known; data cells have their mean."""
    out = np.full((count, *layout.shape), 0.5, np.float32)
    out[:, layout.pilot] = pilots()[(begin + np.arange(count)) % PERIOD, None]
    return KnownSymbols(begin, out, pilots_only=True)


def known_cells(layout: Layout, begin: int, data: npt.NDArray[np.bool_]) -> KnownSymbols:
    """Symbols whose data cells, (n, cells), are known."""
    out = np.zeros((len(data), *layout.shape), np.bool_)
    out.reshape(len(data), -1)[:, layout.data] = data
    out[:, layout.pilot] = pilots()[(begin + np.arange(len(data))) % PERIOD, None]
    return KnownSymbols(begin, out)


def choose_witnesses(
    recording: Recording, layout: Layout, registration: Registration, timing: Timing,
    known: KnownSymbols, *, count: int = 1500, pure: bool = True, seed: int = 1,
) -> Witnesses | None:  # fmt: skip
    """Random pixels within the panel, or on its pilots; None with too few pixels or ticks.

    Args:
        recording: spikes.
        layout, registration, timing: layout, registration and timing of the transmission.
        known: the known symbols.
        count: number of pixels.
        pure: whether to use only pixels within one cell, if there are enough. At the border of
            cells the light depends on blur and registration, whose errors would appear as delay.
        seed: seed of the choice.
    """
    mode, h = layout.mode, registration.homography
    rng = np.random.default_rng(seed)
    middle = float(timing.start(known.begin + len(known.cells) / 2, timing.rows / 2))
    dx, dy = registration.shift(middle)
    h = np.array([[1, 0, dx], [0, 1, dy], [0, 0, 1]]) @ h
    if known.pilots_only:
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
    taps = _taps(layout, h, registration.blur, u, v)
    share, cell = _purity(taps)
    within = share > _PURE
    if not (pure and np.count_nonzero(within) >= _ENOUGH):
        within[:] = True
    chosen = np.flatnonzero(within)[:count]
    u, v, cell = u[chosen], v[chosen], cell[chosen]
    if len(u) < _LEAST_PIXELS:
        return None
    starts = timing.start(known.begin, v), timing.start(known.begin + len(known.cells), v)
    low = max(int(np.ceil(starts[0].max())) + 2, recording.first)
    high = min(int(np.floor(starts[1].min())) - 2, recording.stop)
    if high - low < _LEAST_TICKS:
        return None
    bits = recording.pixels(v.astype(np.intp), u.astype(np.intp))
    bits = np.ascontiguousarray(bits[low - recording.first : high - recording.first].T)
    light = _light(taps.of(chosen), known.cells)
    return Witnesses(v, u, light, known.begin, bits, low, len(np.unique(cell)))


def likelihood(w: Witnesses, timing: Timing, on: float, background: float, reset: str) -> float:
    """Mean ln P of the observed bits."""
    total = float(likelihoods(w, timing, Levels(on, background, reset, 0.0)).sum())
    return total / (len(w.rows) * max(w.bits.shape[1] - SKIP, 1))


def likelihoods(w: Witnesses, timing: Timing, levels: Levels) -> Floats:
    """ln P of the observed bits of each pixel, (n,)."""
    return np.asarray(
        compiled(
            w.bits, w.light, timing.start(w.begin, w.rows), w.tick, timing.period, levels.on,
            levels.background, RULES.index(levels.reset), levels.noise, FLOOR, SKIP,
        )
    )  # fmt: skip


def match(w: Witnesses, timing: Timing) -> float:
    """Correlation of the spikes with the light of the known symbols.

    It is close to 0 if other symbols were shown.
    """
    ticks = np.arange(w.bits.shape[1])
    at = (w.tick + ticks[None, :] + 0.5 - timing.start(w.begin, w.rows)[:, None]) / timing.period
    index = np.clip(at.astype(np.intp), 0, w.light.shape[1] - 1)
    light = np.take_along_axis(w.light, index, axis=1)
    a = light - light.mean(1, keepdims=True)
    b = w.bits - w.bits.mean(1, keepdims=True)
    size = float(np.sqrt((a * a).sum() * (b * b).sum()))
    return float((a * b).sum()) / size if size > 0 else 0.0


def fit_by_known(
    recording: Recording, layout: Layout, registration: Registration, timing: Timing,
    levels: Levels, known: KnownSymbols,
) -> Floats | None:  # fmt: skip
    """Homography; None with too few pixels, or if it changes implausibly.

    Args:
        recording: spikes.
        layout, registration, timing: layout, registration and timing of the transmission, so far.
        levels: light of the cells.
        known: the known symbols.
    """
    mode = layout.mode
    half = np.array([(mode.width - 1) / 2, (mode.height - 1) / 2])
    unit = np.array([[half[0], 0, half[0]], [0, half[1], half[1]], [0, 0, 1.0]])
    back = np.linalg.inv(unit)
    w = choose_witnesses(
        recording, layout, registration, timing, known, count=_PIXELS, pure=False, seed=2
    )
    if w is None:
        return None
    dx, dy = registration.shift(
        float(timing.start(known.begin + len(known.cells) / 2, timing.rows / 2))
    )
    u, v = w.columns - dx, w.rows - dy
    h = registration.homography @ unit
    h = h / h[2, 2]
    for _ in range(_STEPS):
        by: list[Floats] = []
        for mx, my in ((0.0, 0.0), (_MOVE, 0.0), (-_MOVE, 0.0), (0.0, _MOVE), (0.0, -_MOVE)):
            # The image shifted by (mx, my) shows at u what it showed at u - mx.
            light = light_on(layout, h @ back, registration.blur, u - mx, v - my, known.cells)
            by.append(likelihoods(replace(w, light=light), timing, levels))
        step = _newton(h, u, v, by)
        if step is None:
            return None
        h = h + step
    out = h @ back
    out = out / out[2, 2]
    x = np.array([0, 1, 1, 0]) * (mode.width - 1)
    y = np.array([0, 0, 1, 1]) * (mode.height - 1)
    before, after = project(registration.homography, x, y), project(out, x, y)
    off = float(np.hypot(after[0] - before[0], after[1] - before[1]).max())
    return out if np.isfinite(off) and off < _FAR else None


def _newton(h: Floats, u: Floats, v: Floats, by: list[Floats]) -> Floats | None:
    """Change of the homography, from ln P without shift and shifted right, left, down, up."""
    still, right, left, down, up = by
    slope_x, slope_y = (right - left) / (2 * _MOVE), (down - up) / (2 * _MOVE)
    bend_x, bend_y = (2 * still - right - left) / _MOVE**2, (2 * still - down - up) / _MOVE**2
    mx, my = project(np.linalg.inv(h), u, v)
    w = (h[2, 0] * mx + h[2, 1] * my + h[2, 2])[:, None]
    zero, one = np.zeros_like(mx), np.ones_like(mx)
    by_x = np.stack([mx, my, one, zero, zero, zero, -u * mx, -u * my], 1) / w
    by_y = np.stack([zero, zero, zero, mx, my, one, -v * mx, -v * my], 1) / w
    bend = by_x.T @ (bend_x[:, None] * by_x) + by_y.T @ (bend_y[:, None] * by_y)
    slope = by_x.T @ slope_x + by_y.T @ slope_y
    # Scaled, since the last two columns are large. All curvatures must be those of a maximum.
    size = np.sqrt(np.abs(np.diag(bend)))
    if not np.isfinite(bend).all() or (size <= 0).any():
        return None
    scaled = bend / size[:, None] / size[None, :]
    if np.linalg.eigvalsh(scaled)[0] <= 1e-9:
        return None
    return np.append(np.linalg.solve(scaled, slope / size) / size, 0).reshape(3, 3)


def light_on(
    layout: Layout, h: Floats, blur: float, u: Floats, v: Floats, cells: npt.NDArray[Any]
) -> Floats:
    """Share of full light on camera pixels in each symbol, (pixels, n).

    Args:
        layout: layout of the mode.
        h: homography.
        blur: standard deviation, camera pixels.
        u, v: (pixels,) camera pixels.
        cells: (n, rows, columns) of the symbols.
    """
    return _light(_taps(layout, h, blur, u, v), cells)


def _light(taps: _Taps, cells: npt.NDArray[Any]) -> Floats:
    """`light_on` of the camera pixels of `taps`."""
    out = np.empty((len(taps.cell), len(cells)))
    for n, values in enumerate(cells.reshape(len(cells), -1)):
        out[:, n] = np.einsum("pt,pt->p", taps.weight, values[taps.cell])
    return out


def _purity(taps: _Taps) -> tuple[Floats, npt.NDArray[np.intp]]:
    """Share of light from the cell in the middle of camera pixels, and the cell."""
    middle = taps.cell[:, taps.cell.shape[1] // 2]
    return np.sum(taps.weight * (taps.cell == middle[:, None]), axis=1), middle


@dataclass(frozen=True, eq=False)
class _Taps:
    """Panel pixels around camera pixels.

    Attributes:
        cell: (pixels, taps) index of their cell in the flattened (rows, columns).
        weight: (pixels, taps) their share of the camera pixel's light.
    """

    cell: npt.NDArray[np.intp]
    weight: Floats

    def of(self, which: npt.NDArray[np.intp]) -> _Taps:
        """Taps of some of the camera pixels."""
        return _Taps(self.cell[which], self.weight[which])


def _taps(layout: Layout, h: Floats, blur: float, u: Floats, v: Floats) -> _Taps:
    """Panel pixels around camera pixels."""
    mode = layout.mode
    scale = float(np.sqrt(abs(np.linalg.det(h[:2, :2]))))
    spread = max(blur, 0.05)
    reach = int(np.clip(np.ceil((2.6 * spread + (1 + scale) / 2) / scale), 1, 14))
    near = np.arange(-reach, reach + 1)
    x0, y0 = project(np.linalg.inv(h), u, v)
    qx = (np.rint(x0)[:, None, None] + near + 0 * near[:, None]).reshape(len(u), -1)
    qy = (np.rint(y0)[:, None, None] + near[:, None] + 0 * near).reshape(len(u), -1)
    cu, cv = project(h, qx, qy)
    weight = overlap(cu - u[:, None], spread, scale) * overlap(cv - v[:, None], spread, scale)
    rows, columns = layout.shape
    row = np.clip((qy // mode.cell).astype(np.intp), 0, rows - 1)
    column = np.clip((qx // mode.cell).astype(np.intp), 0, columns - 1)
    return _Taps(row * columns + column, weight / weight.sum(1, keepdims=True))
