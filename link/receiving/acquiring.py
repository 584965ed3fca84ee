"""Acquisition of a transmission: position of the panel, its mode, and the time of its symbols.

All intermediate results are stored as evidence, so that a failure can be explained.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.spikes.viform import WORD
from link.layout import PERIOD, TAG_MODULES, TRAINING, Layout, training
from link.mode import Mode
from link.receiving.gaps import whole_parts
from link.receiving.pacing import Pace
from link.receiving.phasing import Fit, fit_levels, fit_timing, nudge
from link.receiving.pilots.clocking import Clocking, clock_by_pilots
from link.receiving.pilots.sequence import missing_ticks, pilot_signal
from link.receiving.recording import Recording
from link.receiving.refining import Refined, project, refine_homography
from link.receiving.synthesis import (
    Levels,
    Witnesses,
    choose_witnesses,
    fit_by_known,
    known_cells,
    known_pilots,
    match,
)
from link.receiving.tags import TagSearch, art_of, find_tags, fit_homography, tag_places
from link.timing import Registration, Timing

Floats = npt.NDArray[np.float64]
_BRIGHT: Final = 0.98
"""Rate from which a pixel counts as saturated, spikes a tick."""
_SMOOTH: Final = 8
"""Ticks over which the tags' light is averaged to detect when they are on."""
_CONTRAST: Final = 0.02
"""Smallest difference of the tags' white and black, spikes a tick."""
_MATCH: Final = 0.15
"""Smallest correlation with the training."""
_SMALL_TAG: Final = 4.0
"""Camera pixels of a tag's module below which the cells give a better registration."""
_LEAST_CELL: Final = 0.5
"""Smallest side of a cell, camera pixels. Tags that claim smaller cells would cost memory by the
number of cells, not of camera pixels."""
_NEAR: Final = 0.45
"""Largest distance of the phase by the spikes from the phase by the pilots, ticks."""
_GAPS: Final = 4
"""Gaps of a few ticks that are filled at a time."""
_PILOT_SYMBOLS: Final = 64
"""Symbols of the timing by pilots alone."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Results of an acquisition, as far as it went.

    Attributes:
        rates: (height, width) float32, spikes a tick where the stream is brightest.
        bright: share of pixels that fire in every tick.
        most: rate exceeded by one pixel in a thousand.
        search: the tags.
        mode: the mode in the tags.
        refined: the registration.
        off: largest distance of a tag's corner from the homography, camera pixels.
        tiny: side of a cell, camera pixels, if it is too small.
        lit: ticks in which the panel is on.
        clocking: the timing by the pilots.
    """

    rates: npt.NDArray[np.float32]
    bright: float
    most: float
    search: TagSearch
    mode: Mode | None = None
    refined: Refined | None = None
    off: float | None = None
    tiny: float | None = None
    lit: tuple[int, int] | None = None
    clocking: Clocking | None = None


@dataclass(frozen=True, eq=False)
class Acquired:
    """A transmission that was located and timed.

    Attributes:
        layout: layout of the transmission's mode.
        refined: the registration.
        pace: the timing with its uncertainty.
        levels: light of the cells.
        lit: ticks in which the panel is on.
        trained: symbols of the training in the recording, end excluded; None without any.
        evidence: intermediate results.
    """

    layout: Layout
    refined: Refined
    pace: Pace
    levels: Levels
    lit: tuple[int, int]
    trained: tuple[int, int] | None
    evidence: Evidence

    @property
    def timing(self) -> Timing:
        return self.pace.timing

    def numbered_as(self, timing: Timing) -> Acquired:
        """The same with symbols numbered as in an earlier timing of the same transmission. Without
        the training a number is known only modulo the pilots' period."""
        if self.trained is not None:
            return self
        mine = self.pace.timing
        turn = PERIOD * mine.period
        first = mine.first + round((timing.first - mine.first) / turn) * turn
        return replace(self, pace=replace(self.pace, timing=replace(mine, first=first)))


def brightest_ticks(recording: Recording) -> tuple[int, int]:
    """Ticks of the words with at least half of the largest number of spikes."""
    words = recording.ticks // WORD
    if words < 2:
        return recording.first, recording.stop
    counts = np.array(
        [int(np.bitwise_count(recording.words[w, ::4]).sum(dtype=np.int64)) for w in range(words)]
    )
    much = np.flatnonzero(2 * counts >= counts.max())
    return recording.first + int(much[0]) * WORD, recording.first + (int(much[-1]) + 1) * WORD


def survey_recording(recording: Recording) -> Evidence:
    """Image and the tags in it."""
    rates = recording.rates(*brightest_ticks(recording))
    most = float(np.quantile(rates, 0.999)) if rates.size else 0.0
    bright = float(np.mean(rates >= _BRIGHT)) if rates.size else 0.0
    if most <= 0 or bright > 0.98:
        return Evidence(rates, bright, most, TagSearch({}))
    search = find_tags(rates)
    return Evidence(rates, bright, most, search, search.mode)


def tag_light(recording: Recording, layout: Layout, homography: Floats) -> Floats:
    """Spikes of the tags' white minus those of their black in each tick, (ticks,)."""
    m = layout.module
    points: tuple[list[tuple[float, float]], list[tuple[float, float]]] = ([], [])
    for tag, (px, py) in zip(layout.mode.tags, tag_places(layout), strict=True):
        art = art_of(tag)
        for row in range(TAG_MODULES):
            for column in range(TAG_MODULES):
                middle = (px + (column + 0.5) * m - 0.5, py + (row + 0.5) * m - 0.5)
                points[1 if art[row, column] else 0].append(middle)
    out = []
    height, width = recording.shape
    for group in points:
        x, y = np.array(group).T
        u, v = (np.rint(a) for a in project(homography, x, y))
        in_view = (u >= 0) & (v >= 0) & (u < width) & (v < height)
        bits = recording.pixels(v[in_view].astype(np.intp), u[in_view].astype(np.intp))
        out.append(bits.mean(1) if bits.shape[1] else np.zeros(recording.ticks))
    return np.asarray(out[1] - out[0], np.float64)


def lit_span(recording: Recording, layout: Layout, homography: Floats) -> tuple[int, int] | None:
    """Ticks in which the tags are on; None if they never are."""
    spans = lit_spans(recording, layout, homography)
    return (spans[0][0], spans[-1][1]) if spans else None


def lit_spans(recording: Recording, layout: Layout, homography: Floats) -> list[tuple[int, int]]:
    """Spans of ticks in which the tags are on, in order; end excluded."""
    light = tag_light(recording, layout, homography)
    if len(light) < 2 * _SMOOTH:
        return []
    smooth = np.convolve(light, np.full(_SMOOTH, 1 / _SMOOTH), "same")
    level = float(np.quantile(smooth, 0.9))
    if level < _CONTRAST:
        return []
    on = np.flatnonzero(smooth > level / 2)
    spans = []
    for part in np.split(on, np.flatnonzero(np.diff(on) > 1) + 1):
        first, last = int(part[0]), int(part[-1])
        near = slice(max(first - _SMOOTH, 0), first + _SMOOTH)
        begun = np.flatnonzero(light[near] > level / 2)
        first = near.start + int(begun[0]) if len(begun) else first
        near = slice(max(last - _SMOOTH, 0), last + _SMOOTH)
        ended = np.flatnonzero(light[near] > level / 2)
        last = near.start + int(ended[-1]) if len(ended) else last
        spans.append((recording.first + first, recording.first + last + 1))
    return spans


def cell_side(homography: Floats, layout: Layout, shape: tuple[int, int]) -> float:
    """Side of a cell, camera pixels.

    It is the root of the area of the panel's image, at most the camera's, over the number of cells.
    """
    (rows, columns), side = layout.shape, layout.mode.cell
    u, v = project(
        homography,
        np.array([0, columns, columns, 0]) * side - 0.5, np.array([0, 0, rows, rows]) * side - 0.5,
    )  # fmt: skip
    area = abs(np.dot(u, np.roll(v, -1)) - np.dot(v, np.roll(u, -1))) / 2
    return float(np.sqrt(min(area, shape[0] * shape[1]) / (rows * columns)))


def acquire(recording: Recording) -> tuple[Evidence, Acquired | None]:
    """Evidence, and the transmission if there is one. A few ticks that the pilots show to be
    missing are put into the recording."""
    evidence = survey_recording(recording)
    mode = evidence.mode
    if mode is None:
        return evidence, None
    layout = Layout(mode)
    fitted = fit_homography(evidence.search, layout)
    if fitted is None:
        return replace(evidence, mode=None), None
    homography, off = fitted
    side = cell_side(homography, layout, recording.shape)
    if side < _LEAST_CELL:
        return replace(evidence, off=off, tiny=side), None
    if layout.cells < 8:
        return replace(evidence, mode=None), None
    refined = refine_homography(evidence.rates, homography, layout)
    evidence = replace(evidence, refined=refined, off=off)
    if refined is None:
        return evidence, None
    lit = lit_span(recording, layout, refined.homography)
    evidence = replace(evidence, lit=lit)
    if lit is None:
        return evidence, None
    signal = pilot_signal(recording, layout, refined.homography)
    if signal is None:
        return evidence, None
    for _ in range(_GAPS):
        gap = missing_ticks(signal, mode.ticks, lit)
        if gap is None:
            break
        recording.put_in(gap)
        lit = lit[0], lit[1] + gap.count
        evidence = replace(evidence, lit=lit)
        signal = pilot_signal(recording, layout, refined.homography)
        assert signal is not None
    clocking = clock_by_pilots(signal, layout, recording.shape[0], lit)
    evidence = replace(evidence, clocking=clocking)
    if clocking is None:
        return evidence, None
    return evidence, _time(recording, layout, refined, lit, clocking, evidence)


def _time(
    recording: Recording, layout: Layout, refined: Refined, lit: tuple[int, int],
    clocking: Clocking, evidence: Evidence,
) -> Acquired | None:  # fmt: skip
    """Numbers the symbols and refines the timing."""
    registration = Registration(refined.homography, np.zeros((0, 3)), refined.blur)
    rough = clocking.timing
    turn = PERIOD * rough.period
    in_view = max(clocking.lit[0] if clocking.broken else lit[0], recording.first)
    # Training that the recording may contain: of the period that begins nearest to first light.
    first = rough.first + round((in_view - rough.first) / turn) * turn
    begun = replace(rough, first=first)
    low = max(0, int(np.ceil((in_view - first) / rough.period)) + 1 if in_view - first > 2 else 0)
    high = min(
        TRAINING,
        int(
            (min(clocking.lit[1] if clocking.broken else lit[1], recording.stop) - first)
            / rough.period
        )
        - 1,
    )
    if high - low >= 8:
        # What lies around missing ticks would bend the timing.
        parts = whole_parts(recording, begun, low, high - low)
        begin, end = max(parts, key=lambda part: part[1] - part[0], default=(low, high))
        known = known_cells(layout, begin, training(layout)[begin:end])
        w = choose_witnesses(recording, layout, registration, begun, known)
        if w is not None and match(w, begun) > _MATCH:
            fit = fit_timing(w, begun, clocking.span)
            timing, levels = fit.timing, fit.levels
            mixed = choose_witnesses(recording, layout, registration, timing, known, pure=False)
            if mixed is not None:
                levels = fit_levels(mixed, timing, levels)
            pace = _phased(w, fit, levels)
            timing = pace.timing
            scale = float(np.sqrt(abs(np.linalg.det(refined.homography[:2, :2]))))
            if scale * layout.module < _SMALL_TAG:
                better = fit_by_known(recording, layout, registration, timing, levels, known)
                if better is not None:
                    refined = replace(refined, homography=better)
            return Acquired(layout, refined, pace, levels, lit, (low, high), evidence)
    # No training: number the symbols so that the first one in the recording belongs to a group. But
    # if first light is in the recording, the sequence was interrupted, and continues early.
    count = int(np.ceil((in_view - rough.first) / rough.period))
    turns = (count - (0 if lit[0] > recording.first + _SMOOTH else TRAINING)) // PERIOD
    begun = replace(rough, first=rough.first + turns * turn)
    begin = count - turns * PERIOD + 2
    known_part = known_pilots(layout, begin, _PILOT_SYMBOLS)
    w = choose_witnesses(recording, layout, registration, begun, known_part)
    if w is None:
        return None
    fit = fit_timing(w, begun, clocking.span)
    pace = _phased(w, fit, fit.levels)
    return Acquired(layout, refined, pace, fit.levels, lit, None, evidence)


def _phased(w: Witnesses, fit: Fit, levels: Levels) -> Pace:
    """Pace, with the phase of the pilots if it explains the spikes as well as the fitted one."""
    timing = fit.timing
    guess = replace(timing, first=timing.first - fit.delay)
    better = nudge(w, guess, levels)
    if abs(fit.delay) < _NEAR and abs(better) < _NEAR:
        timing = replace(guess, first=guess.first + better)
    else:
        timing = replace(timing, first=timing.first + nudge(w, timing, levels))
    ticks = w.bits.shape[1]
    return Pace.fitted(timing, w.tick + ticks / 2, ticks, fit.drift)
