"""Pieces of a block: the planes of one draw call, with the images that they contribute to."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from display.observe.views import Views


class Piece(NamedTuple):
    """Planes of a block in one draw call.

    Attributes:
        first, planes: first plane, and number of planes.
        group: number of planes in a group with common weights.
        spans: number of the span of each group.
    """

    first: int
    planes: int
    group: int
    spans: list[int]


def group_size(planes: int, batch: int) -> int:
    """Number of planes that always share a span of `batch` planes: the largest power of two that
    divides `batch`, at most `planes`."""
    return min(planes, batch & -batch)


def pieces(cycles: int, most: int, batch: int) -> Iterator[Piece]:
    """Yields the pieces of a block. Their numbers of planes are powers of two; each piece starts
    at a multiple of its number.

    Args:
        cycles: number of planes of the block.
        most: maximum number of planes in a piece, a power of two.
        batch: number of planes in a span.
    """
    first = 0
    while first < cycles:
        planes = min(most, 1 << (cycles - first).bit_length() - 1)
        group = group_size(planes, batch)
        yield Piece(first, planes, group, [(first + n) // batch for n in range(0, planes, group)])
        first += planes


def split_images(views: Views | None) -> tuple[list[int], list[int]]:
    """Numbers of the images of still observers in this block, and of moving observers."""
    if views is None:
        return [], []
    shifts = views.dy, views.dx, views.dy_slope, views.dx_slope
    moves = np.any([shift != 0 for shift in shifts], axis=(0, 2))
    return [n for n in range(views.images) if not moves[n]], list(np.flatnonzero(moves))


def takes_light(views: Views, image: int, spans: list[int]) -> bool:
    """Whether an image has a weight in any of these spans."""
    return bool(views.weight[image, spans].any() or views.slope[image, spans].any())
