"""Layers of an analytic scene: static layers are painted once, moving ones at every instant.

A static layer is an affine map of the picture below it (covering: value + (1 - part) below;
shading: factor times below). It is stored as two pictures, an offset and a factor. They result from
painting the layer over black and over white.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Box, Plane
from scenarios.scenes.drawing import bodies, shapes
from scenarios.scenes.drawing.shading import Surface

NOTHING: Box = (0, 0, 0, 0)
SMALLEST, LARGEST = 8, 2000
BAND = 1 << 14
"""Number of pixels painted at a time: the arrays then fit into the processor's cache."""
NO_BUMPS = np.zeros((0, 5))
NO_BUMPS.setflags(write=False)


def check_shape(shape: tuple[int, int]) -> None:
    """Raises ValueError unless shape is (height, width), each 8 to 2000 pixels."""
    whole = len(shape) == 2 and all(isinstance(n, (int, np.integer)) for n in shape)
    if not whole or not all(SMALLEST <= n <= LARGEST for n in shape):
        raise ValueError(
            f"shape must be (height, width), each {SMALLEST} to {LARGEST} pixels, not {shape}"
        )


def check_number(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Raises ValueError unless value is from low to high."""
    if not low <= value <= high:
        unit = f" {unit}" if unit else ""
        raise ValueError(f"{name} must be {low:g} to {high:g}{unit}, not {value}")


def check_instant(t: float) -> float:
    """The instant t, s, as a float. Raises ValueError unless it is finite."""
    if not math.isfinite(t):
        raise ValueError(f"t must be finite seconds, not {t}")
    return float(t)


@dataclass(frozen=True)
class View:
    """The picture plane on the sensor grid; the origin is in the centre.

    Attributes:
        shape: (height, width), pixels.
        field: length of the shorter side, m.
    """

    shape: tuple[int, int]
    field: float

    @property
    def pixel(self) -> float:
        """Side of a pixel, m."""
        return self.field / min(self.shape)

    @property
    def cam(self) -> tuple[float, float, float]:
        """The argument `cam` of painters: side of a pixel, m; row and column of the origin."""
        return self.pixel, 0.5 * self.shape[0], 0.5 * self.shape[1]

    @property
    def whole(self) -> Box:
        return 0, self.shape[0], 0, self.shape[1]

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Row and column coordinate of a point, m; pixel (i, j) spans i to i + 1."""
        return 0.5 * self.shape[0] + y / self.pixel, 0.5 * self.shape[1] + x / self.pixel

    def point(self, x: float, y: float) -> tuple[int, int]:
        """The pixel that contains a point, or the nearest pixel of the picture."""
        row, column = self.at(x, y)
        h, w = self.shape
        return min(max(int(row), 0), h - 1), min(max(int(column), 0), w - 1)

    def box(self, extent: tuple[float, float, float, float], grow: float = 0.0) -> Box:
        """The box of pixels that a rectangle (x0, y0, x1, y1), m, touches, enlarged by `grow`
        pixels, within the picture."""
        top, left = self.at(extent[0], extent[1])
        low, right = self.at(extent[2], extent[3])
        h, w = self.shape
        y0, y1 = max(math.floor(top - grow), 0), min(math.ceil(low + grow), h)
        x0, x1 = max(math.floor(left - grow), 0), min(math.ceil(right + grow), w)
        return (y0, y1, x0, x1) if y0 < y1 and x0 < x1 else NOTHING


def both(a: Box, b: Box) -> Box:
    """The intersection of two boxes."""
    y0, y1, x0, x1 = max(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), min(a[3], b[3])
    return (y0, y1, x0, x1) if y0 < y1 and x0 < x1 else NOTHING


def around(a: Box, b: Box) -> Box:
    """The smallest box that contains two boxes."""
    if a == NOTHING or b == NOTHING:
        return b if a == NOTHING else a
    return min(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), max(a[3], b[3])


@dataclass(frozen=True, eq=False)
class Item:
    """One shape.

    Attributes:
        extent: rectangle (x0, y0, x1, y1) that contains it, m.
        paint: painter, called with (image, win, cam, *rest).
        rest: further arguments of the painter.
    """

    extent: tuple[float, float, float, float]
    paint: Callable[..., None]
    rest: tuple[Any, ...]

    def draw(self, image: Plane, box: Box, view: View) -> None:
        """Paints into `image`, which is the part `box` of the picture, with one pixel of margin for
        the coverage of edges."""
        y0, y1, x0, x1 = both(view.box(self.extent, 1.0), box)
        rows = max(BAND // max(x1 - x0, 1), 1)
        for a in range(y0, y1, rows):
            b = min(a + rows, y1)
            self.paint(image, (a, b, x0, x1, box[0], box[2]), view.cam, *self.rest)


@dataclass(frozen=True, eq=False)
class Layer:
    """Items in painting order.

    Attributes:
        still: items that do not move.
        items: items at an instant in seconds; None for a layer that does not move.
        speed: upper bound of the speed of any point, m/s.
        reach: region (x0, y0, x1, y1) that the layer never leaves, m; None if unknown.
    """

    still: tuple[Item, ...] = ()
    items: Callable[[float], Sequence[Item]] | None = None
    speed: float = 0.0
    reach: tuple[float, float, float, float] | None = None


@dataclass(eq=False)
class Canvas:
    """A view and its layers, lowest first; the first layer is static and covers the picture."""

    view: View
    layers: tuple[Layer, ...]
    _static: list[tuple[Box, Plane, Plane]] = field(init=False)
    _items: list[Callable[[float], Sequence[Item]] | None] = field(init=False)

    def __post_init__(self) -> None:
        self._static = []
        # Callers of `moving` for an interval then draw the picture at its end, with the same items.
        self._items = [layer.items and lru_cache(maxsize=16)(layer.items) for layer in self.layers]
        for layer in self.layers:
            box = NOTHING
            for item in layer.still:
                box = around(box, self.view.box(item.extent, 1.0))
            size = (box[1] - box[0], box[3] - box[2])
            adds, passes = np.zeros(size, np.float32), np.ones(size, np.float32)
            for item in layer.still:
                item.draw(adds, box, self.view)
                if self._static:  # nothing is below the first layer
                    item.draw(passes, box, self.view)
            passes -= adds
            self._static.append((box, adds, passes))

    def patch(self, t: float, box: Box) -> Plane:
        """Reflectance at t within a box, (y1 - y0, x1 - x0) float32 in [0, 1]: the same values as
        in the whole picture. Raises ValueError for a box beyond the picture."""
        t = check_instant(t)
        y0, y1, x0, x1 = box
        if box != both(box, self.view.whole):
            raise ValueError(f"box must lie within {self.view.whole}, not {box}")
        image = self._static[0][1][y0:y1, x0:x1].copy()
        for items, (where, adds, passes) in zip(self._items[1:], self._static[1:], strict=True):
            if items is not None:
                for item in items(t):
                    item.draw(image, box, self.view)
                continue
            a, b, c, d = both(where, box)
            part = image[a - y0 : b - y0, c - x0 : d - x0]
            cut = slice(a - where[0], b - where[0]), slice(c - where[2], d - where[2])
            part *= passes[cut]
            part += adds[cut]
        return np.clip(image, 0.0, 1.0, out=image)

    def direct(self, t: float) -> Plane:
        """The whole picture at t, painted item by item without stored layers."""
        image = np.zeros(self.view.shape, np.float32)
        for layer in self.layers:
            for item in layer.items(t) if layer.items else layer.still:
                item.draw(image, self.view.whole, self.view)
        return np.clip(image, 0.0, 1.0, out=image)

    def moving(self, start: float, stop: float) -> Box:
        """Box that contains all changes from start to stop, s; (0, 0, 0, 0) without a change.
        Raises ValueError if stop is before start.

        The items are evaluated at 2 to 9 instants. Between two instants, a point moves at most half
        of the step, at the greatest speed of its layer, from its position at the nearer one.
        """
        start, stop = check_instant(start), check_instant(stop)
        if stop < start:
            raise ValueError(f"stop must be at or after start {start}, not {stop}")
        if stop == start:
            return NOTHING
        total = NOTHING
        for layer, items in zip(self.layers, self._items, strict=True):
            if items is None or layer.speed == 0.0:
                continue
            limit = self.view.box(layer.reach, 1.0) if layer.reach else self.view.whole
            travel = layer.speed * (stop - start) / self.view.pixel
            steps = min(max(math.ceil(travel / 4), 1), 8)
            grow = 1.0 + 0.5 * travel / steps
            box = limit if grow > max(self.view.shape) else NOTHING
            for m in range(steps + 1 if box == NOTHING else 0):
                t = stop if m == steps else start + (stop - start) * m / steps
                for item in items(t):
                    box = around(box, self.view.box(item.extent, grow))
            total = around(total, both(box, limit))
        return total


def _extent(parts: npt.NDArray[np.float64], margin: float) -> tuple[float, float, float, float]:
    """Rectangle that contains the capsules and a margin, m."""
    ends = parts[:, 0:2] + parts[:, 2:4] * parts[:, 4:5]
    low = np.minimum(parts[:, 0:2] - parts[:, 5:6], ends - parts[:, 6:7]).min(axis=0) - margin
    high = np.maximum(parts[:, 0:2] + parts[:, 5:6], ends + parts[:, 6:7]).max(axis=0) + margin
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _oval(x: float, y: float, a: float, b: float, turn: float) -> tuple[float, float, float, float]:
    """Rectangle that contains an ellipse, m."""
    cos, sin = math.cos(turn), math.sin(turn)
    w, h = math.hypot(a * cos, b * sin), math.hypot(a * sin, b * cos)
    return x - w, y - h, x + w, y + h


def body(rows: Any, surface: Surface, blend: float = 1e-6, bumps: Any = NO_BUMPS) -> Item:
    """A shaded solid of round cones; see `paint_body`."""
    parts = bodies.capsules(rows)
    bumps = np.array(bumps, np.float64).reshape(-1, 5)  # writable, as `shade` is compiled for
    # The union grows by a quarter of the blend where two parts meet; several may meet.
    return Item(_extent(parts, blend), bodies.paint_body, (parts, blend, surface, bumps))


def shadow(rows: Any, soft: float, depth: float, blend: float = 1e-6) -> Item:
    """The soft shadow of a solid of round cones; see `paint_shadow`."""
    parts = bodies.capsules(rows)
    return Item(_extent(parts, blend + soft), bodies.paint_shadow, (parts, blend, soft, depth))


def everywhere(tone: float) -> Item:
    """One tone over the whole picture."""
    return Item((-1e4, -1e4, 1e4, 1e4), shapes.paint_all, (float(tone),))


def ellipse(
    x: float, y: float, a: float, b: float, tone: float, lit: float = 0.0, shine: float = 0.0
) -> Item:
    """An ellipse of semi-axes a and b; see `Ellipse`."""
    shape = shapes.Ellipse(*map(float, (x, y, a, b, tone, lit, shine)))
    return Item(_oval(x, y, a, b, 0.0), shapes.paint_ellipse, (shape,))


def blob(x: float, y: float, a: float, b: float, gain: float, turn: float = 0.0) -> Item:
    """A soft shadow or glow; see `Blob`."""
    r = shapes.BLOB_REACH
    shape = shapes.Blob(*map(float, (x, y, a, b, turn, gain)))
    return Item(_oval(x, y, r * a, r * b, turn), shapes.paint_blob, (shape,))


class Drawn(ABC):
    """Base class of scenes that are drawn on a canvas."""

    @abstractmethod
    def canvas(self) -> Canvas:
        """The canvas of the scene; equal scenes share it."""

    def reflectance(self, t: float) -> Plane:
        """Linear reflectance at t, s, (H, W) float32 in [0, 1]. Raises ValueError unless t is
        finite."""
        canvas = self.canvas()
        return canvas.patch(t, canvas.view.whole)

    def patch(self, t: float, box: Box) -> Plane:
        """The same within a box (y0, y1, x0, x1), (y1 - y0, x1 - x0) float32."""
        return self.canvas().patch(t, box)

    def moving(self, start: float, stop: float) -> Box:
        """Box (y0, y1, x0, x1) that contains all changes between two instants, s."""
        return self.canvas().moving(start, stop)
