"""Changes of an observer's weights of planes at a coarser resolution in time.

An image is the sum over planes n of w_n L_n; the w_n add up to 1. A change of the weights by d_n
(adding up to 0 within a span) changes the image by the sum of d_n L_n. So for any light

    |sum d_n L_n| <= half (max L - min L),  half = 1/2 sum |d_n|        (1)

For light that varies randomly from plane to plane with the variance V

    RMS = root sqrt(V),  root = sqrt(sum d_n^2)                         (2)

For light that varies randomly within each span with the amplitude A

    RMS <= 2 spans A,  spans = sqrt(sum over spans of (1/2 sum |d_n|)^2)     (3)

For light that steps once by A

    |change| <= jump A,  jump = max over spans of 1/2 sum |d_n|             (4)

For a moving eye, the position of plane n changes too, by delta_n pixels. This changes bilinear
light by at most min(|delta_n|, 1) of the difference between neighbours: travel = sum w_n
min(|delta_n|, 1).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final, TypeVar, cast

import numpy as np
import numpy.typing as npt

from display.observe.views import Observer, Values
from display.panels.panel import SpikePanel

_CHUNK: Final = 1 << 14
"""Number of planes that are evaluated together; a multiple of 64."""
_NOTHING: Final = 1e-6
"""Weight below which an image counts as without light of the run."""
_STEP_CLASS: Final = 2.0
"""Ratio of the sizes of neighbouring classes of `weight_steps`."""
_STEP_CLASSES: Final = 26
"""Number of classes: the smallest size is 3e-8."""
Instants = npt.NDArray[np.int64]


F = TypeVar("F", bound=Callable[..., Any])


def _cached(function: F) -> F:
    """Caches the last results, because a plan needs the same ones many times."""
    return cast(F, lru_cache(maxsize=64)(function))


@dataclass(frozen=True)
class Change:
    """A change of weights: the maximum over the images and over the first and the last row of the
    panel, for images whose weights add up to 1.

    Attributes:
        half, root, spans, jump, travel: see the equations of the module.
        travelled: sqrt(sum (w_n min(|delta_n|, 1))^2).
        lost: |sum d_n|, weight beyond the run.
        grain: sqrt(sum w_n^2).
        unseen: number of planes before the first one that an image integrates.
    """

    half: float
    root: float
    spans: float
    jump: float
    travel: float
    travelled: float
    lost: float
    grain: float
    unseen: int


def _chunks(observer: Observer, panel: SpikePanel, planes: int) -> Iterator[tuple[int, Instants]]:
    """Yields the first plane and the plane edges, ps, of every chunk that an image integrates."""
    for first in range(0, planes, _CHUNK):
        edges = range(first, min(first + _CHUNK, planes) + 1)
        ends = np.array([panel.start(edges[0]), panel.start(edges[-1])], np.int64)
        if observer.weights(ends[:1], ends[1:]).any():
            yield first, np.array([panel.start(n) for n in edges], np.int64)


def _means(values: Values, batch: int) -> Values:
    """The mean of each span, repeated for its planes, (..., planes)."""
    first = np.arange(0, values.shape[-1], batch)
    counts = np.diff(np.append(first, values.shape[-1]))
    return np.repeat(np.add.reduceat(values, first, axis=-1) / counts, counts, axis=-1)


class _Sums:
    """The sums of a Change, accumulated chunk by chunk."""

    def __init__(self, images: int) -> None:
        (
            self.whole,
            self.half,
            self.root,
            self.spans,
            self.jump,
            self.travel,
            self.travelled,
            self.lost,
        ) = np.zeros((8, images))
        self.grain = np.zeros(images)
        self.unseen = -1

    def add(self, first: int, change: Values, weight: Values, away: Values, span: int) -> None:
        size = np.abs(change)
        used = ((weight > _NOTHING) | (np.abs(change) > _NOTHING)).any(axis=0)
        if self.unseen < 0 and used.any():
            self.unseen = first + int(np.argmax(used))
        self.whole += weight.sum(axis=1)
        self.lost += change.sum(axis=1)
        self.half += size.sum(axis=1) / 2
        self.root += (change**2).sum(axis=1)
        spans = np.add.reduceat(size, np.arange(0, size.shape[1], span), axis=1) / 2
        self.spans += (spans**2).sum(axis=1)
        self.jump = np.maximum(self.jump, spans.max(axis=1))
        self.grain += (weight**2).sum(axis=1)
        moved = weight * np.minimum(away, 1.0)
        self.travel += moved.sum(axis=1)
        self.travelled += (moved**2).sum(axis=1)

    def change(self) -> Change:
        used = self.whole > _NOTHING
        whole = np.where(used, self.whole, 1.0)

        def most(values: Values) -> float:
            return float(np.where(used, values / whole, 0.0).max(initial=0.0))

        return Change(
            most(self.half), most(np.sqrt(self.root)), most(np.sqrt(self.spans)), most(self.jump),
            most(self.travel), most(np.sqrt(self.travelled)),
            most(np.abs(self.lost)), most(np.sqrt(self.grain)), max(self.unseen, 0),
        )  # fmt: skip


def _worse(one: Change, other: Change) -> Change:
    most = {name: max(value, getattr(other, name)) for name, value in vars(one).items()}
    return Change(**most | {"unseen": min(one.unseen, other.unseen)})


def _apart(one: tuple[Values, Values], other: tuple[Values, Values]) -> Values:
    """Distance between two shifts, pixels: the sum over rows and columns."""
    return np.abs(one[0] - other[0]) + np.abs(one[1] - other[1])


@_cached
def span_change(
    observer: Observer, panel: SpikePanel, planes: int, fine: int, coarse: int
) -> Change:
    """The change from spans of `fine` planes to spans of `coarse` planes, a multiple."""
    return _worse(
        *(_span_change(observer, panel, planes, fine, coarse, delay) for delay in _rows(panel))
    )


def _rows(panel: SpikePanel) -> tuple[int, int]:
    """Delays of the first and the last row, ps."""
    return 0, round(panel.row_delay)


def _span_change(
    observer: Observer, panel: SpikePanel, planes: int, fine: int, coarse: int, delay: int
) -> Change:
    sums = _Sums(observer.images)
    for begin, edges in _chunks(observer, panel, planes):
        at = edges + delay
        weight = observer.weights(at[:-1], at[1:])
        change = _means(weight, coarse) - _means(weight, fine)
        middles = []
        for batch in (fine, coarse):
            first = np.arange(0, len(at) - 1, batch)
            last = np.minimum(first + batch, len(at) - 1)
            middle = (at[first] + at[last]) // 2
            middles.append(np.repeat(middle, last - first))
        away = _apart(*(observer.shifts(m) for m in middles))
        sums.add(begin, change, weight, away, coarse)
    return sums.change()


@_cached
def delay_change(observer: Observer, panel: SpikePanel, planes: int, delay: int) -> Change:
    """The change by a delay of all light, ps."""
    sums = _Sums(observer.images)
    for begin, at in _chunks(observer, panel, planes):
        weight = observer.weights(at[:-1], at[1:])
        later = observer.weights(at[:-1] + delay, at[1:] + delay)
        middle = (at[:-1] + at[1:]) // 2
        away = _apart(observer.shifts(middle), observer.shifts(middle + delay))
        sums.add(begin, later - weight, np.maximum(weight, later), away, len(at) - 1)
    return sums.change()


def effective_planes(observer: Observer, panel: SpikePanel, planes: int) -> float:
    """The effective number of planes, 1 / sum w_n^2, minimum over the images."""
    grain = steps(observer, panel, planes).grain
    return 1 / grain**2 if grain > 0 else float(planes)


@_cached
def steps(observer: Observer, panel: SpikePanel, planes: int) -> Change:
    """The differences between the weights of consecutive planes, as for light delayed by one plane.
    At the ends of the run, the weights step from and to zero."""
    plane = panel.start(1) - panel.start(0)
    first, last = (
        delay_change(observer, replace(panel, transport=panel.transport + delay), planes, plane)
        for delay in _rows(panel)
    )
    return _worse(first, last)


@_cached
def weight_steps(
    observer: Observer, panel: SpikePanel, planes: int, held: int, end: bool
) -> tuple[tuple[float, float], ...]:
    """Differences between the weights of consecutive planes, relative to the sum of all weights,
    for light that is held for `held` planes: classes of similar size, (largest size, number of
    planes in the image with most). end: only those of the end of the run, where the weights step to
    zero; else all others."""
    rows = [_step_classes(observer, panel, planes, held, end, delay) for delay in _rows(panel)]
    sizes = _STEP_CLASS ** -np.arange(float(_STEP_CLASSES))
    counts = np.maximum(*rows)
    return tuple((float(s), float(n)) for s, n in zip(sizes, counts, strict=True) if n > 0)


def _step_classes(
    observer: Observer, panel: SpikePanel, planes: int, held: int, end: bool, row: int
) -> Values:
    """Number of planes in each class of `weight_steps` for rows with this delay, ps: class k has
    sizes up to _STEP_CLASS^-k, the last one all smaller sizes."""
    plane, last = panel.start(1) - panel.start(0), panel.start(planes - held) + row
    whole, found = np.zeros(observer.images), []
    for _, edges in _chunks(observer, panel, planes):
        at = edges + row
        weight = observer.weights(at[:-1], at[1:])
        whole += weight.sum(axis=1)
        later = at + held * plane
        change = np.abs(observer.weights(later[:-1], later[1:]) - weight) / held
        found.append(change[:, (at[1:] > last) == end])
    if not found:
        return np.zeros(_STEP_CLASSES)
    share = np.concatenate(found, axis=1) / np.where(whole > _NOTHING, whole, np.inf)[:, None]
    power = np.floor(-np.log(np.maximum(share, 1e-300)) / np.log(_STEP_CLASS) + 1e-9)
    power = np.clip(power, 0, _STEP_CLASSES - 1)
    counts = [(power == k).sum(axis=1) for k in range(_STEP_CLASSES)]
    return np.asarray(np.stack(counts, axis=1).max(axis=0), np.float64)
