"""The cause of failure for a stream without a detected transmission."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import TRAINING, Layout
from link.receiving.acquiring import Evidence
from link.receiving.diagnosis.brightness import SATURATED, brightness_verdict
from link.receiving.diagnosis.loss import WRONG_PPM
from link.receiving.diagnosis.missing_tags import PEAK, few_tags_verdict, no_tag_verdict
from link.receiving.pilots.sequence import global_clock
from link.receiving.pilots.signal import pilot_signal
from link.receiving.recording import Recording
from link.verdict import Cause, Verdict

Floats = npt.NDArray[np.float64]
_DARK: Final = 0.004
"""Rate below which the image counts as dark: a spike in 250 ticks."""
_SHORT: Final = 48
"""Ticks below which a stream is too short for a detection."""
_CLOCKS: Final = (100_000.0, 500.0)
"""Range of the widest search for a clock, and its step, parts per million."""


def explain_failure(recording: Recording, evidence: Evidence | None) -> Verdict:
    """Cause for a stream without a detected transmission."""
    if evidence is None or recording.ticks < _SHORT:
        return Verdict(
            Cause.TRUNCATED,
            f"the stream has {recording.ticks} ticks, too few to find a panel in; record {_SHORT} "
            "ticks of the panel at least",
        )
    if evidence.most < _DARK:
        return Verdict(
            Cause.DARK,
            f"the brightest pixels fire {evidence.most:.3g} times a tick; switch the panel on, "
            "open the lens, or lower the threshold",
        )
    if evidence.bright >= SATURATED:
        return Verdict(
            Cause.SATURATED,
            f"{evidence.bright:.0%} of the pixels fire at every tick; stop the lens down, raise "
            "the threshold, or shade the camera",
        )
    if evidence.tiny is not None:
        mode = evidence.mode
        assert mode is not None
        return Verdict(
            Cause.TOO_SMALL,
            f"the tags say {mode.width} x {mode.height} panel pixels with cells of "
            f"{mode.cell} x {mode.cell}, of which one is {evidence.tiny:.2g} camera pixels wide; "
            "step nearer or send larger cells",
        )
    if evidence.refined is not None:
        return _no_symbols(recording, evidence)
    if evidence.search.tags:
        return few_tags_verdict(recording, evidence)
    return no_tag_verdict(recording, evidence)


def _no_symbols(recording: Recording, evidence: Evidence) -> Verdict:
    """Cause if the panel was detected, but not its symbols."""
    assert evidence.refined is not None
    if evidence.mode is None or evidence.lit is None:
        return Verdict(
            Cause.DIM,
            f"the tags' white fires {evidence.refined.white:.3g} times a tick, their black "
            f"{evidence.refined.black:.3g}; open the lens or lower the threshold",
        )
    signal = pilot_signal(recording, Layout(evidence.mode), evidence.refined.homography)
    clock = None
    if signal is not None:
        low, high = (tick - signal.first for tick in evidence.lit)
        pilots = (signal.bits @ signal.pixels)[max(low, 0) : high]
        clock = _clock_verdict(pilots, evidence.mode.ticks)
    if clock is not None:
        return clock
    least = (TRAINING + Layout(evidence.mode).group) * evidence.mode.ticks
    light = brightness_verdict(evidence.refined.white, evidence.refined.black)
    if light is not None:
        return light
    if evidence.lit[1] - evidence.lit[0] < max(_SHORT, least):
        return Verdict(
            Cause.TRUNCATED,
            f"the panel is on for {evidence.lit[1] - evidence.lit[0]} ticks of the stream only, "
            f"and its training and first group take {least}; record longer",
        )
    return Verdict(
        Cause.WRONG_CLOCK,
        "the panel is in view but its pilots do not show at any clock within "
        f"{_CLOCKS[0] / 1e4:.0f} % of the camera's; show {evidence.mode.ticks} planes of the "
        "panel's clock a symbol, at the camera's rate",
    )


def _clock_verdict(pilots: Floats, ticks: int) -> Verdict | None:
    """Verdict if the clock is off, else None. pilots: (ticks,) spikes of all pilots."""
    if len(pilots) < _SHORT:
        return None
    _, ppm, score = global_clock(pilots, (ticks,), *_CLOCKS)
    if score < PEAK or abs(ppm) < WRONG_PPM:
        return None
    return Verdict(
        Cause.WRONG_CLOCK,
        f"the panel's clock is {ppm:+.0f} parts per million off the camera's (symbols of {ticks} "
        "planes); set both to the same frequency",
    )
