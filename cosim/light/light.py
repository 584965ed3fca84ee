"""`Light`: light on a plane over time, in a compact form.

Light is piecewise linear in time. A piece has a level at its start and one at its end, for each
pixel; a constant piece refers to one array twice. Light may jump between pieces. A piece may begin
at any picosecond and is not bound to a clock.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.clock import PS

Plane = npt.NDArray[np.float32]
"""(height, width) float32."""
Box = tuple[int, int, int, int]
"""(y0, y1, x0, x1): rows y0 to y1 and columns x0 to x1, without the ends."""


@dataclass(frozen=True, eq=False)
class Scaled:
    """A plane times a factor, which is multiplied where the light is read: in a kernel, or by numpy
    where it is taken as an array.

    Attributes:
        plane: (H, W) float32.
        factor: Product of float32.
    """

    plane: Plane
    factor: np.float32

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W)."""
        return self.plane.shape

    @property
    def ndim(self) -> int:
        """2."""
        return self.plane.ndim

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> Plane:
        return np.asarray(self.plane * self.factor, dtype)


@dataclass(frozen=True, eq=False)
class Piece:
    """Light that changes linearly from `first` at instant `start` to `last` at `stop`.

    Attributes:
        start, stop: instants in picoseconds, start < stop.
        first, last: (H, W) float32 >= 0, or `Scaled` for pixels that multiply; the same object if
            the light is constant.
        changed: box outside which the piece is constant and follows the previous piece without a
            jump; None if unknown. Parts may use it to save work, but their results must not depend
            on it.
    """

    start: int
    stop: int
    first: Plane
    last: Plane
    changed: Box | None = None

    def __post_init__(self) -> None:
        if self.stop <= self.start:
            raise ValueError(f"a piece must end after its start {self.start}, not at {self.stop}")
        if self.first.shape != self.last.shape or self.first.ndim != 2:
            raise ValueError(
                f"levels must share one (height, width), not {self.first.shape}, {self.last.shape}"
            )

    @property
    def constant(self) -> bool:
        """Whether the light of the piece does not change."""
        return self.first is self.last

    def part(self, ps: int) -> np.float32:
        """Position of instant `ps` within the piece, 0 to 1."""
        return np.float32((ps - self.start) / (self.stop - self.start))

    def level(self, ps: int) -> Plane:
        """Level at instant `ps` within the piece."""
        if self.constant:
            return self.first
        return self.first + (self.last - self.first) * self.part(ps)


@dataclass(frozen=True, eq=False)
class Light:
    """Light on a plane during at least a block of time: pieces in order, without gaps.

    The pieces may extend beyond the block. All blocks that a piece overlaps have the same `Piece`
    object, so that a part needs to prepare it only once.

    Attributes:
        pieces: pieces in order; each starts where the previous one stops.
        unit: "lux" on the plane.
    """

    pieces: tuple[Piece, ...]
    unit: str = "lux"

    def __post_init__(self) -> None:
        if not self.pieces:
            raise ValueError("light must hold at least one piece, not none")
        for one, two in zip(self.pieces, self.pieces[1:], strict=False):
            if one.stop != two.start:
                raise ValueError(f"pieces must join at {one.stop} ps, not {two.start} ps")
            if one.first.shape != two.first.shape:
                raise ValueError(
                    f"pieces must share one (height, width), not {one.first.shape}, "
                    f"{two.first.shape}"
                )

    @property
    def shape(self) -> tuple[int, int]:
        """(H, W) of the plane."""
        height, width = self.pieces[0].first.shape
        return height, width

    def at(self, ps: int) -> Plane:
        """Level at instant `ps`; where two pieces meet, that of the second."""
        for piece in self.pieces:
            if piece.start <= ps < piece.stop:
                return piece.level(ps)
        raise ValueError(
            f"instant must be from {self.pieces[0].start} to before {self.pieces[-1].stop} ps, "
            f"not {ps} ps"
        )

    def integral(self, start: int, stop: int) -> npt.NDArray[np.float64]:
        """Exposure from `start` to `stop` (ps) in unit x seconds, (H, W), in closed form.

        Raises ValueError if the pieces do not cover this time.
        """
        if not self.pieces[0].start <= start <= stop <= self.pieces[-1].stop:
            raise ValueError(
                f"light must cover {start} to {stop} ps, not {self.pieces[0].start} to "
                f"{self.pieces[-1].stop} ps"
            )
        total = np.zeros(self.shape)
        for piece in self.pieces:
            a, b = max(start, piece.start), min(stop, piece.stop)
            if a < b:
                whole = piece.stop - piece.start
                part = ((a - piece.start) + (b - piece.start)) / (2 * whole)
                first = piece.first.astype(np.float64)
                total += (first + (piece.last - first) * part) * ((b - a) / PS)
        return total


class PlaneMap:
    """Applies a function to the levels of light, once to each level.

    The pieces of the previous light and the last four planes are cached, and nothing older, because
    planes are large.

    Args:
        function: map of a plane, linear and independent of time (a lens, air, a relay).
        grow: pixels by which its influence extends beyond a changed box; None for the whole plane.
        part: computes the values of the function in a box only, with the same bits, so that
            unchanged values are not computed again; None if there is no such form.
    """

    def __init__(
        self,
        function: Callable[[Plane], Plane],
        grow: int | None = 0,
        part: Callable[[Plane, Box], Plane] | None = None,
    ) -> None:
        self._function, self._grow, self._part = function, grow, part
        self._planes: list[tuple[Plane, Plane]] = []
        self._pieces: list[tuple[Piece, Piece]] = []

    def _plane(self, plane: Plane, before: Plane | None = None, box: Box | None = None) -> Plane:
        """Image of a plane. before: image of a plane that differs from it only in `box`."""
        for source, image in self._planes:
            if source is plane:
                return image
        if before is None or box is None or self._part is None:
            image = self._function(plane)
        else:
            image = before.copy()
            image[box[0] : box[1], box[2] : box[3]] = self._part(plane, box)
        self._planes = [*self._planes[-3:], (plane, image)]
        return image

    def _piece(self, piece: Piece) -> Piece:
        """The mapped piece."""
        for source, image in self._pieces:
            if source is piece:
                return image
        box = piece.changed
        if box is not None and self._grow is None:
            box = None
        elif box is not None and self._grow:
            (h, w), g = piece.first.shape, self._grow
            box = (max(box[0] - g, 0), min(box[1] + g, h), max(box[2] - g, 0), min(box[3] + g, w))
        first = self._plane(piece.first)
        return Piece(piece.start, piece.stop, first, self._plane(piece.last, first, box), box)

    def __call__(self, light: Light) -> Light:
        self._pieces = [(piece, self._piece(piece)) for piece in light.pieces]
        return Light(tuple(image for _, image in self._pieces), light.unit)
