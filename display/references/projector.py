"""A projector of binary planes, fed the true light."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Light, Piece, seconds_to_ps
from display.observe.integration import LightPlanes, Span
from display.panels.panel import Projector

__all__ = ["ProjectorShow", "spread_errors"]

BATCH = 32
"""Planes shown at a time: few enough for the cache, many enough to pass over the images seldom."""
SPREAD = (0.7548776662466927, 0.5698402909980532)
"""Steps of the low-discrepancy sequence R2: 1/g and 1/g^2 with g^3 = g + 1."""


def spread_errors(row: npt.ArrayLike, column: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """The errors, -1/2 to 1/2, that a projector's pixels begin with, by their place: spread evenly
    (the sequence R2 of Roberts), so that neighbours do not flash together. Assumed."""
    return (np.asarray(row) * SPREAD[0] + np.asarray(column) * SPREAD[1]) % 1 - 0.5


class ProjectorShow:
    """What a projector shows of light, plane after plane: 1 or 0 for each pixel.

    A pixel's error is carried on to its next plane (first-order delta-sigma), so that the light of
    n planes of a steady level is within 1/n of it. The errors begin spread over the pixels, so that
    neighbours do not flash together (assumed). white: light, in its own unit, that is on in every
    plane. State: the number of the next plane, and the errors.
    """

    def __init__(self, panel: Projector, shape: tuple[int, int], white: float) -> None:
        self.panel = panel
        self._scale = np.float32(1 / white)
        self._late = seconds_to_ps(panel.latency)
        self._next = 0
        self._error = np.ascontiguousarray(spread_errors(*np.indices(shape)), np.float32)
        self._planes = np.empty((BATCH, *shape), np.uint8)

    def step(self, light: Light, until: int) -> Iterator[LightPlanes]:
        """What the light from where the last step ended to `until` (ps) makes shine."""
        rate = self.panel.rate
        while rate.edge(self._next) < until:
            count = 1
            while count < BATCH and rate.edge(self._next + count) < until:
                count += 1
            at = [rate.edge(self._next + k) for k in range(count)]
            planes = self._planes[:count]
            for piece in light.pieces:
                inside = [k for k, ps in enumerate(at) if piece.start <= ps < piece.stop]
                if inside:
                    self._show(piece, [at[k] for k in inside], planes[inside[0] : inside[-1] + 1])
            spans = [
                Span(k, at[k] + self._late, rate.edge(self._next + k + 1) + self._late)
                for k in range(count)
            ]
            self._next += count
            yield LightPlanes(planes, spans)

    def _show(self, piece: Piece, at: list[int], planes: npt.NDArray[np.uint8]) -> None:
        from display.observe.row_kernels import by_rows, carry_errors  # imports numba, 0.4 s

        whole = piece.stop - piece.start
        part = np.array([(ps - piece.start) / whole for ps in at], np.float32)
        given = (piece.first, piece.last, self._scale, part, self._error, planes)
        by_rows(carry_errors, len(self._error), *given)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next step depends on."""
        return {"next": np.array(self._next), "error": self._error.copy()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        self._next = int(state["next"])
        self._error = np.ascontiguousarray(state["error"], np.float32)
