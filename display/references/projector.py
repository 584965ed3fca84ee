"""A projector of binary planes that shows the true light."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Light, Piece, seconds_to_ps
from cosim.compute.cores import by_rows
from display.observe.integration import LightPlanes, Span
from display.panels.panel import Projector

BATCH = 128
"""Maximum number of planes computed at a time: each time, all images are read and written."""
SPREAD = (0.7548776662466927, 0.5698402909980532)
"""Steps of the low-discrepancy sequence R2, 1/g and 1/g^2 with g^3 = g + 1."""


def spread_errors(row: npt.ArrayLike, column: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """The initial errors of a projector's pixels, -1/2 to 1/2, by their position. They are
    uniformly distributed (the sequence R2 of Roberts), so that neighbours do not flash together
    (assumed)."""
    return (np.asarray(row) * SPREAD[0] + np.asarray(column) * SPREAD[1]) % 1 - 0.5


class ProjectorShow:
    """The light of a projector that shows the true light in binary planes.

    The error of a pixel is carried to its next plane (first-order delta-sigma modulation), so the
    light of n planes of a steady level is within 1/n of the level. `spread_errors` sets the initial
    errors. State: number of the next plane, and errors.

    Args:
        panel: the projector.
        shape: (height, width), pixels.
        white: light that is on in every plane, in the unit of the light.
    """

    def __init__(self, panel: Projector, shape: tuple[int, int], white: float) -> None:
        self.panel = panel
        self._scale = np.float32(1 / white)
        self._delay = seconds_to_ps(panel.latency)
        self._next = 0
        row, column = np.ogrid[: shape[0], : shape[1]]
        self._error = np.ascontiguousarray(spread_errors(row, column), np.float32)
        self._planes = np.empty((BATCH, *shape), np.uint8)

    def step(self, light: Light, until: int) -> Iterator[LightPlanes]:
        """Yields the planes that sample the light before `until`, ps, after those of the last
        step."""
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
                Span(k, at[k] + self._delay, rate.edge(self._next + k + 1) + self._delay)
                for k in range(count)
            ]
            self._next += count
            yield LightPlanes(planes, spans)

    def _show(self, piece: Piece, at: list[int], planes: npt.NDArray[np.uint8]) -> None:
        from display.observe.row_kernels import carry_errors  # imports numba, 0.4 s

        whole = piece.stop - piece.start
        part = np.array([(ps - piece.start) / whole for ps in at], np.float32)
        by_rows(
            carry_errors, len(self._error), piece.first, piece.last, self._scale, part, self._error,
            planes,
        )  # fmt: skip

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next step depends on."""
        return {"next": np.array(self._next), "error": self._error.copy()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        self._next = int(state["next"])
        self._error = np.ascontiguousarray(state["error"], np.float32)
