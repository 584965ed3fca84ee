"""Registration of the panel to hundredths of a camera pixel, by a fit of the artwork of its tags.

A pixel's rate is a monotone but not a linear function of its light: if a spike resets the charge to
zero, it is a staircase. The model is therefore r = g(P(x - d)), with the blurred artwork P, the
displacement d by the change of the homography, and a separate function g for each tag, piecewise
linear, which is fitted as well. Gauss-Newton steps on all tags together. A linear g leaves errors
of a tenth of a pixel if the artwork is not symmetric; with a free g they are some hundredths.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from link.layout import TAG_MODULES, Layout
from link.receiving.tags import art_of, tag_places

Floats = npt.NDArray[np.float64]
_FINE: Final = 3
"""Samples along a side of a camera pixel."""
_BLURS: Final = (0.25, 0.35, 0.5, 0.65, 0.8, 1.0, 1.25, 1.6, 2.0, 2.5, 3.2, 4.0, 5.0, 6.5)
"""Standard deviations that are tried, camera pixels."""
_MARGIN: Final = 0.45
"""Share of the white margin's module next to the panel's data that is not used."""
_KNOTS: Final = 16
"""Knots of g between no light and full light, if a tag has enough pixels."""
_ROUNDS: Final = ((0.65, 2), (None, 2), (None, 2))
"""Blur (None for the best one) and number of steps of each round."""
_SHIFTS: Final = 4
_SETTLED: Final = 0.1
"""_SHIFTS: largest number of steps of a displacement. _SETTLED: step after which it ends, camera
pixels."""
_FAR: Final = 6.0
"""Largest displacement of the image from word to word, camera pixels."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A tag in the image.

    Attributes:
        x, y: its top left camera pixel.
        fine: artwork at _FINE samples a pixel, before blur.
        use: (height, width) bool, pixels that count.
    """

    x: int
    y: int
    fine: npt.NDArray[np.float32]
    use: npt.NDArray[np.bool_]

    def blurred(self, blur: float) -> Floats:
        """Blurred artwork, (height, width), 0 to 1."""
        import cv2

        image = cv2.GaussianBlur(self.fine, (0, 0), blur * _FINE)
        size = (self.use.shape[1], self.use.shape[0])
        return cv2.resize(image, size, interpolation=cv2.INTER_AREA).astype(np.float64)

    def of(self, rates: npt.NDArray[np.float32]) -> Floats:
        """An image's pixels at its place."""
        h, w = self.use.shape
        return rates[self.y : self.y + h, self.x : self.x + w].astype(np.float64)


@dataclass(frozen=True, eq=False)
class Refined:
    """A refined registration.

    Attributes:
        homography: (3, 3) float64.
        blur: standard deviation, camera pixels.
        rms: RMS of the residuals, spikes a tick.
        white, black: rates of the tags' white and black; the difference is the contrast.
    """

    homography: Floats
    blur: float
    rms: float
    white: float
    black: float


def project(
    homography: npt.NDArray[Any], x: npt.ArrayLike, y: npt.ArrayLike
) -> tuple[Floats, Floats]:
    """Points through a homography."""
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    h = homography
    w = h[2, 0] * x + h[2, 1] * y + h[2, 2]
    return (h[0, 0] * x + h[0, 1] * y + h[0, 2]) / w, (h[1, 0] * x + h[1, 1] * y + h[1, 2]) / w


class TagArt:
    """Artwork of the four tags of a layout.

    Attributes:
        layout: layout of the mode.
        arts: modules of each tag.
        places: places of the tags on the panel.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.arts = [art_of(tag).astype(np.float32) for tag in layout.mode.tags]
        self.places = tag_places(layout)

    def patches(self, homography: Floats, shape: tuple[int, int]) -> list[Patch]:
        """Tags that lie within an image of `shape`."""
        patches = (self._patch(corner, homography, shape) for corner in range(4))
        return [patch for patch in patches if patch is not None]

    def _patch(self, corner: int, homography: Floats, shape: tuple[int, int]) -> Patch | None:
        (px, py), side = self.places[corner], self.layout.tag
        ends = np.array([[px, py], [px + side, py], [px + side, py + side], [px, py + side]]) - 0.5
        u, v = project(homography, ends[:, 0], ends[:, 1])
        x0, x1 = max(int(u.min()) - 3, 0), min(int(u.max()) + 4, shape[1])
        y0, y1 = max(int(v.min()) - 3, 0), min(int(v.max()) + 4, shape[0])
        if x1 - x0 < 4 or y1 - y0 < 4:
            return None
        inner = (np.arange(_FINE) - (_FINE - 1) / 2) / _FINE
        xs = (np.arange(x0, x1)[:, None] + inner).ravel()
        ys = (np.arange(y0, y1)[:, None] + inner).ravel()
        mx, my = project(np.linalg.inv(homography), xs, ys[:, None])
        column = np.floor((mx + 0.5 - px) / self.layout.module).astype(np.intp)
        row = np.floor((my + 0.5 - py) / self.layout.module).astype(np.intp)
        last = TAG_MODULES - 1  # unknown content beyond the white margin is taken as white
        fine = self.arts[corner][np.clip(row, 0, last), np.clip(column, 0, last)]
        middle = slice(_FINE // 2, None, _FINE)
        cx, cy = mx[middle, middle] - px + 0.5, my[middle, middle] - py + 0.5
        edge = _MARGIN * self.layout.module
        use = (cx > edge) & (cy > edge) & (cx < side - edge) & (cy < side - edge)
        return Patch(x0, y0, fine, use) if np.count_nonzero(use) >= 2 * _KNOTS else None


def _hats(light: Floats, knots: int) -> Floats:
    """Weights of the knots of a piecewise linear function, (n, knots)."""
    at = np.clip(light, 0, 1) * (knots - 1)
    low = np.minimum(at.astype(np.intp), knots - 2)
    out = np.zeros((len(light), knots))
    rows = np.arange(len(light))
    out[rows, low] = 1 - (at - low)
    out[rows, low + 1] = at - low
    return out


def _curve(light: Floats, rate: Floats) -> Floats:
    """g of a tag at its knots, smoothed where there are few pixels."""
    knots = max(3, min(_KNOTS, len(light) // 40))
    hats = _hats(light, knots)
    bend = np.diff(np.eye(knots), 2, axis=0)
    stiff = 1e-3 * len(light) / knots
    left = hats.T @ hats + stiff * bend.T @ bend + 1e-9 * np.eye(knots)
    return np.asarray(np.linalg.solve(left, hats.T @ rate), np.float64)


def _expected(light: Floats, curve: Floats) -> Floats:
    """g of an image of light."""
    return np.asarray(np.interp(light, np.linspace(0, 1, len(curve)), curve))


def refine_homography(
    rates: npt.NDArray[np.float32], homography: Floats, layout: Layout
) -> Refined | None:
    """Homography and blur with the best fit of the tags; None if the tags are not visible.

    Args:
        rates: (height, width) spikes a tick.
        homography: initial value, accurate to about half a module.
        layout: layout of the mode.
    """
    mode, tags = layout.mode, TagArt(layout)
    half = np.array([(mode.width - 1) / 2, (mode.height - 1) / 2])
    unit = np.array([[half[0], 0, half[0]], [0, half[1], half[1]], [0, 0, 1.0]])
    back = np.linalg.inv(unit)
    h = homography @ unit  # from panel coordinates within -1 and 1
    h = h / h[2, 2]
    blur: float
    for blur_given, steps in _ROUNDS:
        patches = tags.patches(h @ back, rates.shape)
        if len(patches) < 4:
            return None
        blur = blur_given if blur_given is not None else _best_blur(patches, rates)
        for _ in range(steps):
            step = _step(tags.patches(h @ back, rates.shape), rates, blur, h)
            if step is None:
                return None
            h = h + step
    final = h @ back
    if not np.isfinite(final).all() or abs(final[2, 2]) < 1e-9:
        return None
    final = final / final[2, 2]
    patches = tags.patches(final, rates.shape)
    if len(patches) < 4:
        return None
    curves, square, count = [], 0.0, 0
    for patch in patches:
        light, rate = patch.blurred(blur)[patch.use], patch.of(rates)[patch.use]
        curve = _curve(light, rate)
        square += float(np.sum((rate - _expected(light, curve)) ** 2))
        count += len(rate)
        curves.append(curve)
    white = float(np.mean([curve[-1] for curve in curves]))
    black = float(np.mean([curve[0] for curve in curves]))
    return Refined(final, blur, float(np.sqrt(square / count)), white, black)


def _best_blur(patches: list[Patch], rates: npt.NDArray[np.float32]) -> float:
    """Blur with the smallest residuals."""
    left: list[float] = []
    for blur in _BLURS:
        total = 0.0
        for patch in patches:
            light, rate = patch.blurred(blur)[patch.use], patch.of(rates)[patch.use]
            total += float(np.sum((rate - _expected(light, _curve(light, rate))) ** 2))
        left.append(total)
        if total > 1.5 * min(left):
            break
    at = int(np.argmin(left))
    if not 0 < at < len(left) - 1:
        return _BLURS[at]
    x, y = np.log(_BLURS[at - 1 : at + 2]), np.array(left[at - 1 : at + 2])
    bend, tilt, _ = np.polyfit(x - x[1], y, 2)
    step = -tilt / (2 * bend) if bend > 0 else 0.0
    return float(np.exp(np.clip(x[1] + step, x[0], x[2])))


def _step(
    patches: list[Patch], rates: npt.NDArray[np.float32], blur: float, h: Floats
) -> Floats | None:
    """Change of the homography from panel coordinates within -1 and 1."""
    if len(patches) < 4:
        return None
    inverse = np.linalg.inv(h)
    left, right = np.zeros((8, 8)), np.zeros(8)
    for patch in patches:
        light, rate = patch.blurred(blur), patch.of(rates)
        curve = _curve(light[patch.use], rate[patch.use])
        expected = _expected(light, curve)
        along_y, along_x = (np.asarray(a, np.float64) for a in np.gradient(expected))
        rows, columns = np.nonzero(patch.use)
        x, y = columns + float(patch.x), rows + float(patch.y)
        mx, my = project(inverse, x, y)
        w = h[2, 0] * mx + h[2, 1] * my + h[2, 2]
        # A displacement d gives g(P(x - d)), so rates change by -grad . d.
        gx, gy = -along_x[patch.use] / w, -along_y[patch.use] / w
        both = gx * x + gy * y
        columns_of = [gx * mx, gx * my, gx, gy * mx, gy * my, gy, -both * mx, -both * my]
        design = np.stack(columns_of, 1)
        # Project out what g can explain: both are solved together.
        hats = _hats(light[patch.use], len(curve))
        inner = hats.T @ hats + 1e-6 * np.eye(len(curve))
        taken = np.linalg.solve(inner, np.column_stack([hats.T @ design, hats.T @ rate[patch.use]]))
        design = design - hats @ taken[:, :8]
        rest = rate[patch.use] - hats @ taken[:, 8]
        left += design.T @ design
        right += design.T @ rest
    if not np.isfinite(left).all() or np.linalg.cond(left) > 1e14:
        return None
    solved = np.linalg.solve(left, right)
    return np.append(solved, 0).reshape(3, 3)


def shift_of(
    rates: npt.NDArray[np.float32], refined: Refined, tags: TagArt, near: tuple[float, float]
) -> tuple[tuple[float, float], float] | None:
    """Displacement (dx, dy) of an image of rates, camera pixels, and its standard error.

    The error is along an axis. None if the tags are not visible.

    Args:
        rates: (height, width) spikes a tick.
        refined: registration.
        tags: artwork.
        near: initial value, camera pixels.
    """
    at = np.array(near)
    error = 0.0
    for _ in range(_SHIFTS):
        move = np.array([[1, 0, at[0]], [0, 1, at[1]], [0, 0, 1]])
        patches = tags.patches(move @ refined.homography, rates.shape)
        if len(patches) < 3:
            return None
        left, right = np.zeros((2, 2)), np.zeros(2)
        square, count = 0.0, 0
        for patch in patches:
            light, use = patch.blurred(refined.blur), patch.use
            rate = patch.of(rates)[use]
            expected = _expected(light, _curve(light[use], rate))
            along_y, along_x = (np.asarray(a, np.float64) for a in np.gradient(expected))
            design = -np.stack([along_x[use], along_y[use]], 1)
            rest = rate - expected[use]
            left += design.T @ design
            right += design.T @ rest
            square += float(rest @ rest)
            count += len(rest)
        if not np.linalg.cond(left) < 1e6:
            return None
        step = np.linalg.solve(left, right)
        at = at + step
        error = float(np.sqrt(square / count * np.trace(np.linalg.inv(left)) / 2))
        if np.abs(at - np.array(near)).max() > _FAR:
            return None
        if np.abs(step).max() < _SETTLED:
            break
    return (float(at[0]), float(at[1])), error
