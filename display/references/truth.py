"""The true light as a lossless reference display."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Light, Piece, Plane
from display.observe.integration import Gain, LightPlanes, Span, Values

BATCH = 32
"""Number of planes of light that are integrated together."""
Instants = npt.NDArray[np.int64]
Stack = npt.NDArray[np.float32]


def _ramp(piece: Piece, rising: bool) -> Gain:
    """Share of the last level (`rising`) or of the first level of a piece in its light, mean over
    an interval."""

    def mean(start: Instants, stop: Instants) -> Values:
        begin = (np.asarray(start - piece.start, np.float64) + (stop - piece.start)) / 2
        part = begin / (piece.stop - piece.start)
        return part if rising else 1 - part

    return mean


class TruthShow:
    """The light of a scene, piecewise linear in time, as planes with gains.

    Spans are counted from the start of each piece, so they do not depend on the steps. State: the
    instant up to which light has been shown.

    Args:
        white: light that counts as 1, in the unit of the light.
        longest: longest span, ps; within a span, the weight of an observer is its integral.
        end: end of the light, ps.
    """

    def __init__(self, white: float, longest: int, end: int) -> None:
        self._white, self._longest, self._end = np.float32(white), longest, end
        self._done = 0
        self._planes: Stack | None = None

    def step(self, light: Light, until: int) -> Iterator[LightPlanes]:
        """Yields the light from the end of the last step to `until`, ps, or to the end of a span
        after it."""
        planes: list[Plane] = []
        spans: list[Span] = []
        for piece in light.pieces:
            times = self._times(piece, min(until, self._end))
            if not times:
                continue
            if len(planes) >= BATCH:
                yield self._lit(planes, spans)
                planes, spans = [], []
            if not planes or planes[-1] is not piece.first:
                planes.append(piece.first)
            place = len(planes) - 1
            if piece.constant:
                spans += [Span(place, a, b) for a, b in times]
                continue
            planes.append(piece.last)
            falls, rises = _ramp(piece, False), _ramp(piece, True)
            spans += [Span(place, a, b, falls) for a, b in times]
            spans += [Span(place + 1, a, b, rises) for a, b in times]
        if spans:
            yield self._lit(planes, spans)

    def _lit(self, planes: list[Plane], spans: list[Span]) -> LightPlanes:
        if self._planes is None:
            self._planes = np.empty((BATCH + 1, *planes[0].shape), np.float32)
        for relative, plane in zip(self._planes, planes, strict=False):
            np.divide(plane, self._white, out=relative)
        return LightPlanes(self._planes[: len(planes)], spans)

    def _times(self, piece: Piece, until: int) -> list[tuple[int, int]]:
        """Spans of the piece that begin before `until` and have not been shown."""
        stop = min(piece.stop, self._end)
        times = []
        while max(self._done, piece.start) < min(until, stop):
            begin = max(self._done, piece.start)
            whole = (begin - piece.start) // self._longest + 1
            times.append((begin, min(piece.start + whole * self._longest, stop)))
            self._done = times[-1][1]
        return times

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next step depends on."""
        return {"done": np.array(self._done)}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        self._done = int(state["done"])
