"""The spikes of the pilots, band by band of camera rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import Layout
from link.receiving.recording import Recording
from link.receiving.refining import project

Floats = npt.NDArray[np.float64]
_BANDS: Final = 32
"""Bands of camera rows, at most."""


@dataclass(frozen=True, eq=False)
class PilotSignal:
    """Spikes of the pilots in bands of camera rows.

    Attributes:
        first: first tick.
        bits: (ticks, bands) share of the pilot pixels of a band that fire in each tick.
        rows: (bands,) mean camera row.
        pixels: (bands,) number of pixels.
    """

    first: int
    bits: Floats
    rows: Floats
    pixels: npt.NDArray[np.intp]


def pilot_signal(recording: Recording, layout: Layout, homography: Floats) -> PilotSignal | None:
    """Spikes of the pilots in a recording; None if no pilot is in view."""
    rows, columns = _pilot_pixels(layout, homography, recording.shape)
    if not len(rows) or not recording.ticks:
        return None
    height = rows[-1] - rows[0] + 1  # rows come in order
    bands = int(np.clip(height // 4, 1, _BANDS))
    band = (rows - rows[0]) * bands // height
    present, starts = np.unique(band, return_index=True)
    bits = recording.pixels(rows, columns)
    total = np.add.reduceat(bits, starts, axis=1, dtype=np.int64)
    pixels = np.diff(np.append(starts, len(rows)))
    middle = np.add.reduceat(rows.astype(np.float64), starts) / pixels
    assert len(present) == total.shape[1]
    return PilotSignal(recording.first, total / pixels, middle, pixels)


def _pilot_pixels(
    layout: Layout, homography: Floats, shape: tuple[int, int]
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Camera rows and columns of the pixels well inside pilots."""
    row, column = np.nonzero(layout.pilot)
    cell = layout.mode.cell
    scale = float(np.sqrt(abs(np.linalg.det(homography[:2, :2]))))
    count = max(1, min(4, int(cell * scale)))
    inner = (np.arange(count) - (count - 1) / 2) * cell / count
    middle = (cell - 1) / 2
    dx, dy = (a.ravel() for a in np.meshgrid(inner, inner))
    x = (column[:, None] * cell + middle + dx).ravel()
    y = (row[:, None] * cell + middle + dy).ravel()
    u, v = project(homography, x, y)
    u, v = np.rint(u), np.rint(v)
    in_view = (u >= 0) & (v >= 0) & (u < shape[1]) & (v < shape[0])
    flat = np.unique(v[in_view].astype(np.intp) * shape[1] + u[in_view].astype(np.intp))
    return flat // shape[1], flat % shape[1]
