"""Displacement of the image by the tags, for each word of 32 ticks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD
from link.layout import Layout
from link.receiving.recording import Recording
from link.receiving.refining import Refined, TagArt, shift_of

Floats = npt.NDArray[np.float64]
_REAL: Final = 3.0
"""Ratio of the displacements' scatter to their standard error below which the image counts as
static."""


def drift_by_tags(
    recording: Recording, layout: Layout, refined: Refined, lit: tuple[int, int]
) -> Floats:
    """Rows (tick, dx, dy), (n, 3), camera pixels against the refined homography.

    There are no rows if no significant motion was measured.
    """
    tags = TagArt(layout)
    low = -(-max(lit[0] - recording.first, 0) // WORD)
    high = min(lit[1] - recording.first, recording.ticks) // WORD
    out: list[tuple[float, float, float]] = []
    errors: list[float] = []
    at = (0.0, 0.0)
    for w in range(low, high):
        rates = np.bitwise_count(recording.words[w]).astype(np.float32) / np.float32(WORD)
        moved = shift_of(rates, refined, tags, at)
        if moved is None:
            continue
        at, error = moved
        out.append((recording.first + (w + 0.5) * WORD, *at))
        errors.append(error)
    if len(out) < 2:
        return np.zeros((0, 3))
    drift = np.array(out)
    spread = float(np.sqrt(np.mean(np.var(drift[:, 1:], axis=0))))
    if spread < _REAL * float(np.mean(errors)):
        return np.zeros((0, 3))
    # Extrapolate to the ends of the lit ticks.
    ends = []
    for at_end, next_to, tick in ((drift[0], drift[1], lit[0]), (drift[-1], drift[-2], lit[1])):
        speed = (at_end[1:] - next_to[1:]) / (at_end[0] - next_to[0])
        reach = float(np.clip(tick - at_end[0], -WORD, WORD))
        ends.append([at_end[0] + reach, *(at_end[1:] + speed * reach)])
    low_end = [ends[0]] if ends[0][0] < drift[0, 0] else []
    high_end = [ends[1]] if ends[1][0] > drift[-1, 0] else []
    return np.array([*low_end, *drift.tolist(), *high_end])


def joined(parts: Sequence[Floats]) -> Floats:
    """Displacements of all parts of a recording, (n, 3), in order of ticks."""
    some = [part for part in parts if len(part)]
    if not some:
        return np.zeros((0, 3))
    rows = np.concatenate(some)
    return rows[np.unique(rows[:, 0], return_index=True)[1]]
