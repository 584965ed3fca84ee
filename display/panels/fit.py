"""Maps a stream to a panel of another size."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import numpy.typing as npt

Fit = Literal["exact", "nearest", "centre"]
Words = npt.NDArray[np.uint32]


def _nearest(panel: int, stream: int) -> npt.NDArray[np.intp]:
    """For each panel pixel, the pixel of the stream that contains its centre; both cover the same
    picture."""
    return ((2 * np.arange(panel) + 1) * stream // (2 * panel)).astype(np.intp)


def _centred(panel: int, stream: int) -> tuple[slice, slice]:
    """The part of the panel that shows the centre of the stream, and that part of the stream; an
    odd remainder is at the right and at the bottom."""
    size = min(panel, stream)
    on, of = (panel - size) // 2, (stream - size) // 2
    return slice(on, on + size), slice(of, of + size)


def fit_words(
    fit: Fit, stream: tuple[int, int], panel: tuple[int, int]
) -> Callable[[Words], Words]:
    """The function from words of a stream, (words, *stream) uint32, to words of a panel, (words,
    *panel). For equal sizes it returns its argument.

    Args:
        fit: "exact" requires equal sizes; "nearest" shows the spikes of the nearest pixel of the
            stream; "centre" crops the stream or adds a dark frame.
        stream, panel: (height, width), pixels.

    Raises:
        ValueError: `fit` is "exact" and the sizes differ.
    """
    if stream == panel:
        return lambda words: words
    if fit == "exact":
        raise ValueError(f"the panel must be of the stream's {stream} pixels, not {panel}")
    if fit == "nearest":
        rows, columns = (_nearest(*sizes) for sizes in zip(panel, stream, strict=True))

        def nearest(words: Words) -> Words:
            return np.ascontiguousarray(words[:, rows[:, None], columns])

        return nearest
    (on_y, of_y), (on_x, of_x) = (_centred(*s) for s in zip(panel, stream, strict=True))

    def centre(words: Words) -> Words:
        if (on_y, on_x) == (slice(0, panel[0]), slice(0, panel[1])):
            return np.ascontiguousarray(words[:, of_y, of_x])
        framed = np.zeros((len(words), *panel), np.uint32)
        framed[:, on_y, on_x] = words[:, of_y, of_x]
        return framed

    return centre
