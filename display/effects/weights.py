"""How an observer's weights of planes change when time is resolved more coarsely.

An image is the sum over planes n of w_n L_n; the w_n add up to 1. A change of the weights by d_n
(adding up to 0 within a span) changes the image by the sum of d_n L_n. So for any light

    |sum d_n L_n| <= half (max L - min L),  half = 1/2 sum |d_n|        (1)

and for light that differs by chance from plane to plane with variance V

    RMS = root sqrt(V),  root = sqrt(sum d_n^2)                         (2)

and for light that goes between its ends at random within each span, amplitude A

    RMS <= 2 spans A,  spans = sqrt(sum over spans of (1/2 sum |d_n|)^2)     (3)

and for light that jumps once at any moment by A

    |change| <= jump A,  jump = max over spans of 1/2 sum |d_n|             (4)

For a moving eye the place of plane n changes too, by delta_n pixels. That changes bilinear light
by at most min(|delta_n|, 1) of the difference between neighbours:
travel = sum w_n min(|delta_n|, 1).
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

__all__ = ["Change", "delay_change", "effective_planes", "span_change", "steps"]

_CHUNK: Final = 1 << 14
"""Planes that are evaluated together: whole spans of 64."""
_NOTHING: Final = 1e-6
"""An image of less weight than this takes no light of the run."""
Instants = npt.NDArray[np.int64]


F = TypeVar("F", bound=Callable[..., Any])


def _cached(function: F) -> F:
    """Caches the last results: a plan asks for the same ones many times."""
    return cast(F, lru_cache(maxsize=64)(function))


@dataclass(frozen=True)
class Change:
    """A change of weights: the largest over the images and the panel's first and last row, for
    images whose weights add up to 1.

    Attributes:
        half, root, spans, jump, travel: see the module's equations.
        travelled: sqrt(sum (w_n min(|delta_n|, 1))^2).
        lost: |sum d_n|, weight that falls beyond the run.
        grain: sqrt(sum w_n^2).
        unseen: planes before the first that an image integrates.
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
    """First plane and edges of the planes of every chunk that some image integrates."""
    for first in range(0, planes, _CHUNK):
        edges = range(first, min(first + _CHUNK, planes) + 1)
        ends = np.array([panel.start(edges[0]), panel.start(edges[-1])], np.int64)
        if observer.weights(ends[:1], ends[1:]).any():
            yield first, np.array([panel.start(n) for n in edges], np.int64)


def _means(values: Values, batch: int) -> Values:
    """Each span's mean in all its planes; (..., planes)."""
    first = np.arange(0, values.shape[-1], batch)
    counts = np.diff(np.append(first, values.shape[-1]))
    return np.repeat(np.add.reduceat(values, first, axis=-1) / counts, counts, axis=-1)


class _Sums:
    """The sums of a Change, chunk by chunk."""

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
    """Pixels between two shifts, sum of rows and columns."""
    return np.abs(one[0] - other[0]) + np.abs(one[1] - other[1])


@_cached
def span_change(
    observer: Observer, panel: SpikePanel, planes: int, fine: int, coarse: int
) -> Change:
    """Spans of `coarse` planes for spans of `fine`, which divide them."""
    return _worse(
        *(_span_change(observer, panel, planes, fine, coarse, delay) for delay in _rows(panel))
    )


def _rows(panel: SpikePanel) -> tuple[int, int]:
    """Delay of the first row and of the last, ps."""
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
    """All light `delay` picoseconds later."""
    sums = _Sums(observer.images)
    for begin, at in _chunks(observer, panel, planes):
        weight = observer.weights(at[:-1], at[1:])
        later = observer.weights(at[:-1] + delay, at[1:] + delay)
        middle = (at[:-1] + at[1:]) // 2
        away = _apart(observer.shifts(middle), observer.shifts(middle + delay))
        sums.add(begin, later - weight, np.maximum(weight, later), away, len(at) - 1)
    return sums.change()


def effective_planes(observer: Observer, panel: SpikePanel, planes: int) -> float:
    """Effective number of planes, 1 / sum w_n^2, of the image that has the fewest."""
    grain = steps(observer, panel, planes).grain
    return 1 / grain**2 if grain > 0 else float(planes)


@_cached
def steps(observer: Observer, panel: SpikePanel, planes: int) -> Change:
    """Each plane's weight for that of the plane before, as of light that is a plane late. At the
    run's ends a weight steps from and to nothing."""
    plane = panel.start(1) - panel.start(0)
    first, last = (
        delay_change(observer, replace(panel, transport=panel.transport + delay), planes, plane)
        for delay in _rows(panel)
    )
    return _worse(first, last)
