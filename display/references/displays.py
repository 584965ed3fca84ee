"""Reference displays that show the true light: frame panels, a projector, and a lossless one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import PS, Light, Piece, Plane, seconds_to_ps
from cosim.compute.cores import by_rows
from display.observe.integration import Gain, LightPlanes, Span, Values
from display.panels.panel import FramePanel, Projector

Instants = npt.NDArray[np.int64]
Stack = npt.NDArray[np.float32]
PARTS, MOST = 16, 1024
"""Number of integration intervals in a time constant of a slow pixel, and maximum number in a
frame. Beyond the maximum, the light in an interval is still its true mean."""
BATCH = 128
"""Maximum number of planes computed at a time: each time, all images are read and written."""
SPREAD = (0.7548776662466927, 0.5698402909980532)
"""Steps of the low-discrepancy sequence R2, 1/g and 1/g^2 with g^3 = g + 1."""
TRUTH_BATCH = 32
"""Number of planes of light that are integrated together."""


def _approach(begin: int, constant: float) -> Gain:
    """The mean of exp(-(t - begin) / constant) over [start, stop), in closed form; `begin` in ps,
    `constant` in s."""

    def mean(start: Instants, stop: Instants) -> Values:
        a, b = (np.asarray(t - begin, np.float64) / (constant * PS) for t in (start, stop))
        return np.exp(-a) * -np.expm1(a - b) / (b - a)

    return mean


def _times(gain: Gain | None, factor: float) -> Gain | None:
    if factor == 1:
        return gain

    def mean(start: Instants, stop: Instants) -> Values:
        return factor * (np.ones(len(start)) if gain is None else gain(start, stop))

    return mean


class FrameShow:
    """The light of a frame panel that shows the true light.

    The panel is dark before the first frame. With `response`, the level of a pixel follows the
    frame as y' = (x - y) / response, in closed form; a strobe shows this level in the first
    `persistence` of each frame. State: number of the next frame, and level at its start.

    Args:
        panel: the frame panel.
        shape: (height, width), pixels.
        white: light that the panel shows as 1, in the unit of the light; brighter light is clipped.
    """

    def __init__(self, panel: FramePanel, shape: tuple[int, int], white: float) -> None:
        self.panel = panel
        self._white = np.float32(white)
        self._delay = seconds_to_ps(panel.latency)
        self._next = 0
        self._level = np.zeros(shape, np.float32)

    def step(self, light: Light, until: int) -> Iterator[LightPlanes]:
        """Yields the emitted light of the frames that start before `until`, ps, after those of the
        last step. The light of a frame may extend beyond `until`."""
        while self.panel.rate.edge(self._next) < until:
            values = light.at(self.panel.rate.edge(self._next))
            yield self._frame(np.clip(values / self._white, 0, 1, dtype=np.float32))
            self._next += 1

    def _frame(self, level: Plane) -> LightPlanes:
        panel = self.panel
        start = panel.rate.edge(self._next) + self._delay
        stop = panel.rate.edge(self._next + 1) + self._delay
        dark = start + max(round((stop - start) * panel.persistence), 1)
        bright = (stop - start) / (dark - start)
        spans = [Span(0, start, dark, _times(None, bright))]
        if panel.response == 0:
            return LightPlanes(level[None], spans)
        behind = self._level - level
        parts = min(math.ceil((dark - start) / (panel.response * PS) * PARTS), MOST)
        spans.append(Span(1, start, dark, _times(_approach(start, panel.response), bright), parts))
        left = np.float32(math.exp(-(stop - start) / (panel.response * PS)))
        self._level = level + behind * left
        return LightPlanes(np.stack([level, behind]), spans)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next step depends on."""
        state = {"next": np.array(self._next)}
        return state | ({"level": self._level.copy()} if self.panel.response else {})

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        self._next = int(state["next"])
        if self.panel.response:
            self._level = np.ascontiguousarray(state["level"], np.float32)


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
            if len(planes) >= TRUTH_BATCH:
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
            self._planes = np.empty((TRUTH_BATCH + 1, *planes[0].shape), np.float32)
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
