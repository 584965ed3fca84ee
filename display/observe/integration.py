"""Integrates the images of an observer from planes of light that are emitted in spans of time.

A span of constant light that moves on the retina is split into parts in which it moves by at most a
quarter of a pixel. The bilinear shifts of the parts form a small kernel for each image: a hold at
60 Hz that smears over 67 pixels is one pass of 68 taps along the rows instead of 267 shifted
pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.cores import by_rows
from display.observe.views import Observer

WAITING = 4
"""Maximum number of planes of light that wait to be added together."""
Plane = npt.NDArray[np.float32]
Values = npt.NDArray[np.float64]
Instants = npt.NDArray[np.int64]
Gain = Callable[[Instants, Instants], Values]
"""Mean gain over each interval [start, stop), ps."""
MOTION_STEP = 0.25
"""Maximum motion of light on the retina within a part of a span, pixels; the position is that of
the middle of the part."""
NEGLIGIBLE = 1e-9
"""Weight of light in an image below which it is neglected."""


@dataclass(frozen=True)
class Span:
    """A time span in which a plane emits light.

    Attributes:
        plane: number of the plane.
        start, stop: limits of the span, ps.
        gain: factor over time, None for 1.
        parts: minimum number of parts into which the span is split.
    """

    plane: int
    start: int
    stop: int
    gain: Gain | None = None
    parts: int = 1


@dataclass(frozen=True, eq=False)
class LightPlanes:
    """Planes of light with their time spans.

    Attributes:
        planes: (n, H, W) float32, or uint8 of 0 and 1; white = 1. Valid until the next planes are
            generated: their source reuses the memory.
        spans: time spans of the planes.
    """

    planes: npt.NDArray[Any]
    spans: list[Span]

    def reduced(self, observer: Observer, by: int) -> Plane:
        """The images of a still observer as means over `by` x `by` pixels, (images, H // by, W //
        by) float32; incomplete squares at the right and at the bottom are left out."""
        parts = _parts(self.spans, observer)
        weights = [np.bincount(parts.plane, w, len(self.planes)) for w in parts.weight]
        return reduced(self.planes, np.array(weights, np.float32), by)


def reduced(planes: npt.NDArray[Any], weights: npt.NDArray[np.float32], by: int) -> Plane:
    """Weighted sums of planes as means over `by` x `by` pixels, (images, H // by, W // by) float32.

    Args:
        planes: (n, H, W) float32, float64 or uint8.
        weights: (images, n) float32.
        by: side of the squares, 1 to the shorter side of a plane.

    Raises:
        ValueError: `by` is out of range.
    """
    from display.observe.row_kernels import add_reduced  # imports numba, 0.4 s

    height, width = planes.shape[1:]
    if not 1 <= by <= min(height, width):
        raise ValueError(f"by must be 1 to {min(height, width)}, not {by}")
    # A plane that many images share, such as a frame in slow motion, is reduced once.
    shared = np.count_nonzero(weights) > 2 * len(planes)
    each = np.eye(len(planes), dtype=np.float32) if shared else weights
    images = np.zeros((len(each), height // by, width // by), np.float32)
    by_rows(add_reduced, height // by, planes, by, each, images)
    return np.tensordot(weights, images, 1) if shared else images


@dataclass(frozen=True, eq=False)
class _Parts:
    """The parts of all spans of a `LightPlanes`.

    Attributes:
        plane: numbers of the planes, (n,).
        weight: weights in each image, (images, n).
        down, along: shifts across and along the rows, pixels, (images, n).
    """

    plane: npt.NDArray[np.int64]
    weight: Values
    down: Values
    along: Values


def _split(span: Span, observer: Observer) -> Instants:
    """Edges of the parts of a span, ps."""
    ends = np.array([span.start, span.stop], np.int64)
    travel = max(float(np.abs(np.diff(s, axis=1)).max()) for s in observer.shifts(ends))
    parts = max(span.parts, math.ceil(travel / MOTION_STEP - 1e-9))
    parts = max(min(parts, span.stop - span.start), 1)
    part = (span.stop - span.start) * np.arange(parts + 1) / parts
    return span.start + np.rint(part).astype(np.int64)


def _parts(spans: list[Span], observer: Observer) -> _Parts:
    edges = [_split(span, observer) for span in spans]
    start = np.concatenate([e[:-1] for e in edges])
    stop = np.concatenate([e[1:] for e in edges])
    weight = observer.weights(start, stop)
    if any(span.gain is not None for span in spans):
        weight = weight * np.concatenate([
            np.ones(len(e) - 1) if span.gain is None else span.gain(e[:-1], e[1:])
            for span, e in zip(spans, edges, strict=True)
        ])  # fmt: skip
    plane = np.repeat([span.plane for span in spans], [len(e) - 1 for e in edges])
    return _Parts(plane, weight, *observer.shifts((start + stop) // 2))


def _joined(several: Sequence[_Parts]) -> _Parts:
    names = [field.name for field in fields(_Parts)]
    return _Parts(*(np.concatenate([getattr(p, n) for p in several], axis=-1) for n in names))


def _taps(parts: _Parts, shape: tuple[int, int]) -> list[tuple[npt.NDArray[Any], ...]]:
    """The taps of each image: planes, integer shifts across and along the rows, and weights."""
    height, width = shape
    taps = []
    for weight, y, x in zip(parts.weight, parts.down, parts.along, strict=True):
        used = (weight != 0) & (np.abs(y) < height) & (np.abs(x) < width)
        plane, w, y, x = parts.plane[used], weight[used], y[used], x[used]
        row, column = np.floor(y), np.floor(x)
        fy, fx = y - row, x - column
        share = [w * b * a for b in (1 - fy, fy) for a in (1 - fx, fx)]
        places = np.stack([
            np.tile(plane, 4),
            np.concatenate([row + b for b in (0, 0, 1, 1)]).astype(np.int64),
            np.concatenate([column + a for a in (0, 1, 0, 1)]).astype(np.int64),
        ])  # fmt: skip
        every = np.concatenate(share)
        nonzero = every != 0
        if not nonzero.any() or np.abs(w).sum() < NEGLIGIBLE:
            taps.append((*np.zeros((3, 0), np.int64), np.zeros(0)))
            continue
        # One number for each position, to merge equal positions.
        span = np.array([2 * height + 4, 2 * width + 4])
        number = (places[0] * span[0] + places[1] + height + 1) * span[1] + places[2] + width + 1
        _, first, which = np.unique(number[nonzero], return_index=True, return_inverse=True)
        taps.append((*places[:, nonzero][:, first], np.bincount(which, every[nonzero])))
    return taps


class ObserverImages:
    """The images of observers of the same light, which is read once for all of them.

    A frame is one or two planes of light. Several wait to be added together, because each pass
    reads and writes all images.

    Attributes:
        observers: the observers.
        shape: (height, width), pixels.
    """

    def __init__(self, observers: Sequence[Observer], shape: tuple[int, int]) -> None:
        self.observers = tuple(observers)
        self.shape = shape
        self._images = np.zeros((sum(o.images for o in observers), *shape), np.float32)
        self._waiting = np.zeros((0, *shape), np.float32)
        self._parts: list[list[_Parts]] = []
        """The parts of the planes that wait, the first `_planes` of `_waiting`; for each
        observer."""
        self._planes = 0

    @property
    def images(self) -> Plane:
        """The images so far, (images, H, W) float32, white = 1, in the order of the observers."""
        self._add_waiting()
        return self._images

    def add(self, light: LightPlanes) -> None:
        """Adds the planes, with the weights and bilinear shifts of the observers. Raises ValueError
        for planes of another size."""
        if light.planes.shape[1:] != self.shape:
            raise ValueError(f"planes must be of {self.shape} pixels, not {light.planes.shape[1:]}")
        if not light.spans:
            return
        parts, count = [_parts(light.spans, o) for o in self.observers], len(light.planes)
        if count > WAITING // 2:
            self._integrate(light.planes, parts)
            return
        if not len(self._waiting):
            self._waiting = np.empty((WAITING, *self.shape), np.float32)
        if self._planes + count > WAITING:
            self._add_waiting()
        self._waiting[self._planes : self._planes + count] = light.planes
        self._parts.append([replace(p, plane=p.plane + self._planes) for p in parts])
        self._planes += count

    def _add_waiting(self) -> None:
        if self._parts:
            self._integrate(self._waiting[: self._planes], self._joined())
        self._parts, self._planes = [], 0

    def _joined(self) -> list[_Parts]:
        """The parts of all planes that wait, for each observer."""
        return [_joined(parts) for parts in zip(*self._parts, strict=True)]

    def _integrate(self, planes: npt.NDArray[Any], parts: list[_Parts]) -> None:
        taps = [tap for each in parts for tap in _taps(each, self.shape)]
        counts = [len(weight) for *_, weight in taps]
        if not any(counts):
            return
        from display.observe.row_kernels import add_images  # imports numba, 0.4 s

        plane, down, along = (np.concatenate([t[k] for t in taps]) for k in range(3))
        weight = np.concatenate([t[3] for t in taps]).astype(np.float32)
        lines, line = np.unique(np.stack([plane, down]), axis=1, return_inverse=True)
        lines = np.ascontiguousarray(lines)
        begin = np.concatenate([[0], np.cumsum(counts)])
        pad = int(np.abs(along).max())
        place = line.ravel() * (self.shape[1] + 2 * pad) + pad + along
        by_rows(
            add_images, self.shape[0], planes, pad, lines[0], lines[1], begin, place, weight,
            self._images,
        )  # fmt: skip

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """The images, and the light that waits."""
        return {
            "images": self._images.copy(), "planes": self._waiting[: self._planes].copy(),
        } | {
            f"{n} {name}": values
            for n, parts in enumerate(self._joined()) for name, values in vars(parts).items()
        }  # fmt: skip

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        self._images = np.ascontiguousarray(state["images"], np.float32)
        self._planes, self._parts = len(state["planes"]), []
        if self._planes:
            self._waiting = np.empty((WAITING, *self.shape), np.float32)
            self._waiting[: self._planes] = state["planes"]
            names = [field.name for field in fields(_Parts)]
            self._parts = [[
                _Parts(*(state[f"{n} {name}"] for name in names))
                for n in range(len(self.observers))
            ]]  # fmt: skip
