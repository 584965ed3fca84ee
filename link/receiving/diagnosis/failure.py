"""The cause of failure for a stream without a detected transmission, also if none or only some of
the panel's tags were detected.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import TRAINING, Layout
from link.mode import TICKS, Mode
from link.receiving.acquiring import Evidence
from link.receiving.diagnosis.loss import SATURATED, WRONG_PPM, brightness_verdict
from link.receiving.pilots.sequence import global_clock, pilot_signal
from link.receiving.recording import Recording
from link.receiving.refining import project
from link.receiving.tags import LEAST_MODULE, find_tags, tag_corners, tag_places
from link.verdict import Cause, Verdict

Floats = npt.NDArray[np.float64]
_SHINES: Final = 0.1
"""Rate of the brightest pixels below which the content of an image cannot be identified."""
PEAK: Final = 6.5
"""Height of the pilots' peak in a whole image from which a panel is transmitting, standard
deviations."""
_FILLS = 0.95
"""Lit share of the image from which the light has no edge within it."""
_LEAST: Final = 40
"""Smallest shorter side of an image that can contain a panel's tags, camera pixels: two tags of ten
modules, two pixels each."""
_TAGGED: Final = 96 * LEAST_MODULE
"""Shorter side of a panel's image below which its tags may be too small, camera pixels: it has at
most so many of their modules (`link.layout`)."""
_TOUCHES: Final = 0.2
"""Lit share of a side of the image from which the light reaches beyond it."""
_DIM: Final = 0.25
"""Rate of a lit pixel over that of the brightest: half of a panel of which each cell is on half of
the time."""
_IN_FOCUS: Final = 3.0
"""Blur of the edge of a panel in focus, at most, camera pixels. Tags that are found need 1.6 pixels
a module, and cells more than one."""
_SMOOTHED: Final = 2.0
"""Standard deviation that the image is smoothed by before its edges are measured: the data's noise
is finer."""
_BLOB, _SHARP = 0.04, 0.03
"""Thresholds for a panel out of focus: _BLOB is the smallest lit share of the image, _SHARP the
largest share of fine detail in its variance."""
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


def no_tag_verdict(recording: Recording, evidence: Evidence) -> Verdict:
    """Cause if no tag was detected."""
    totals = recording.totals(2)
    _, _, score = global_clock(totals, TICKS, 2000.0, 500.0)
    sends = score >= PEAK
    lit = evidence.rates > 0.5 * evidence.most
    rows, columns = np.flatnonzero(lit.any(1)), np.flatnonzero(lit.any(0))
    sharp = _sharpness(evidence.rates)
    at_edge = (
        lit[0].mean() > 0.2 or lit[-1].mean() > 0.2
        or lit[:, 0].mean() > 0.2 or lit[:, -1].mean() > 0.2
    )  # fmt: skip
    figure = (
        f"the pilots' peak is {score:.1f} standard deviations high"
        if sends
        else (f"no pilots show (peak {score:.1f} standard deviations)")
    )
    if len(rows) and len(columns):
        figure += f", light stands on {lit.mean():.0%} of the image"
    # A panel far out of focus has no edge: its light is away from the image's edge, or covers all.
    apart = not at_edge and lit.mean() > _BLOB
    blob = (apart or lit.mean() > _FILLS) and evidence.most > 0.05 and min(lit.shape) >= _LEAST
    mirrored = find_tags(np.ascontiguousarray(evidence.rates[:, ::-1]))
    if mirrored.tags:
        return Verdict(
            Cause.MIRRORED,
            f"no tag is readable, but {len(mirrored.tags)} of 4 are in the image's mirror image "
            f"({figure}); turn the recording's rows or columns round",
        )
    sides = _sides_beyond(evidence)
    if sides and edge_blur(evidence.rates) < _IN_FOCUS:
        return Verdict(
            Cause.OUT_OF_VIEW,
            f"no tag is readable ({figure}): light with a sharp edge reaches beyond the image at "
            f"{sides} of its 4 sides, so the panel's corners are outside; aim the camera at the "
            "middle of the panel, turn it upright, or step back",
        )
    if sharp < _SHARP and blob:
        return Verdict(
            Cause.OUT_OF_FOCUS,
            f"something bright is in view ({figure}), but no tag is readable and only {sharp:.1%} "
            "of the image's variance is fine detail; focus the lens at the panel",
        )
    if sends and not at_edge:
        small = f"{columns[-1] - columns[0] + 1} x {rows[-1] - rows[0] + 1}"
        return Verdict(
            Cause.OUT_OF_FOCUS if sharp < 2 * _SHARP else Cause.TOO_SMALL,
            f"a panel sends ({figure}), about {small} camera pixels large, but no tag is readable; "
            "focus the lens, or step nearer",
        )
    lit_box = len(rows) and len(columns) and not at_edge
    shorter = min(columns[-1] - columns[0], rows[-1] - rows[0]) + 1 if lit_box else 0
    if 0 < shorter < _TAGGED and evidence.most >= _SHINES:
        size = f"{columns[-1] - columns[0] + 1} x {rows[-1] - rows[0] + 1}"
        return Verdict(
            Cause.TOO_SMALL,
            f"what shines is {size} camera pixels large, and no tag is readable ({figure}): tags "
            f"too small, whose modules need {LEAST_MODULE:g} camera pixels or more; step nearer, "
            "or take a longer lens",
        )
    if evidence.most < _SHINES:
        return Verdict(
            Cause.DIM,
            f"no tag is readable and the brightest pixels fire {evidence.most:.2g} times a tick "
            f"({figure}); open the lens or lower the threshold",
        )
    return Verdict(
        Cause.OUT_OF_VIEW,
        f"no tag of a panel is in view ({figure}); aim the camera at the panel, or "
        "step back where it is larger than the view",
    )


def _sides_beyond(evidence: Evidence) -> int:
    """Number of sides of the image at which light reaches beyond it; 0 for an image that is too
    small or too dark to tell."""
    if evidence.most < _SHINES or min(evidence.rates.shape) < _LEAST:
        return 0
    lit = evidence.rates > _DIM * evidence.most
    ends = (lit[0], lit[-1], lit[:, 0], lit[:, -1])
    return sum(float(end.mean()) > _TOUCHES for end in ends)


def edge_blur(rates: npt.NDArray[np.float32]) -> float:
    """Blur of an image's longest edges, as the standard deviation of a normal law, camera pixels;
    infinite without an edge.

    A step of height h that is blurred by s has the slope h / (s sqrt(2 pi)) in its middle. h is the
    contrast of the image, and the slope that of the steepest 0.3 % of its pixels.
    """
    import cv2

    smooth = cv2.GaussianBlur(rates.astype(np.float32), (0, 0), _SMOOTHED)
    down, across = np.gradient(smooth)
    slope = float(np.percentile(np.hypot(down, across), 99.7))
    low, high = np.percentile(smooth, [5, 95])
    if slope <= 0:
        return math.inf
    both = float(high - low) / (slope * math.sqrt(2 * math.pi))
    return math.sqrt(max(both**2 - _SMOOTHED**2, 0.0))


def _sharpness(rates: npt.NDArray[np.float32]) -> float:
    """Share of an image's variance that is finer than about three pixels."""
    import cv2

    smooth = cv2.GaussianBlur(rates, (0, 0), 2.0)
    all_of_it = float(np.var(rates))
    return float(np.var(rates - smooth)) / all_of_it if all_of_it > 0 else 0.0


def few_tags_verdict(recording: Recording, evidence: Evidence) -> Verdict:
    """Cause if one to three tags were detected, or four that belong to no mode."""
    in_view = sorted(evidence.search.tags)
    names = ("top left", "top right", "bottom right", "bottom left")
    if len(in_view) == 4:
        return Verdict(
            Cause.NOISY,
            "four tags are in view, but they are of no mode of this link; show one panel alone",
        )
    missing = [corner for corner in range(4) if corner not in in_view]
    where = _missing_places(evidence, missing)
    height, width = recording.shape
    # Detection needs the margin, so a tag that is cut there is lost.
    outside = [
        corner
        for corner, places in where.items()
        if not ((places >= -0.5) & (places <= (width - 0.5, height - 0.5))).all()
    ]
    places_text = " and ".join(names[corner] for corner in missing)
    if outside:
        return Verdict(
            Cause.OUT_OF_VIEW,
            f"{len(in_view)} of 4 tags are in view; that at the {places_text} reaches beyond the "
            "image's edge; aim the camera at the middle of the panel, or step back",
        )
    module = _module(evidence)
    if module < LEAST_MODULE:
        return Verdict(
            Cause.TOO_SMALL,
            f"{len(in_view)} of 4 tags are readable, not that at the {places_text}: tags too "
            f"small, whose modules are {module:.2g} camera pixels and need {LEAST_MODULE:g} or "
            "more; step nearer, or take a longer lens or a larger panel",
        )
    return Verdict(
        Cause.OCCLUDED,
        f"{len(in_view)} of 4 tags are in view; that at the {places_text} is hidden or unreadable, "
        "though its place is within the image; clear the line of sight",
    )


def _seen_layout(evidence: Evidence) -> Layout | None:
    """A layout of the size in the ids of the detected tags; None if there is none. A panel with one
    unknown side is taken to be square."""
    tags = evidence.search.tags
    sides = [tags[corner][0] // 4 * 32 if corner in tags else None for corner in (0, 1)]
    known = [side for side in sides if side]
    width, height = (side or (known[0] if known else 960) for side in sides)
    try:
        return Layout(Mode(width, height, 1, 1, "none", 32))
    except ValueError:
        return None


def _module(evidence: Evidence) -> float:
    """Size of a module of the detected tags, mean, camera pixels; infinite if unknown."""
    layout = _seen_layout(evidence)
    if layout is None:
        return math.inf
    around = [1, 2, 3, 0]
    sizes = []
    for corner, (_, places) in evidence.search.tags.items():
        panel = np.asarray(tag_corners(layout, corner), np.float64)
        camera = np.asarray(places, np.float64)
        seen, own = (
            np.linalg.norm(points[around] - points, axis=1).mean() for points in (camera, panel)
        )
        sizes.append(float(seen / own) * layout.module)
    return float(np.mean(sizes))


def _missing_places(evidence: Evidence, missing: list[int]) -> dict[int, npt.NDArray[np.float64]]:
    """Camera (x, y) of the corners, (4, 2), of the missing tags, half of their margin included.

    They follow from the detected tags and from the size of the panel in their ids.
    """
    import cv2

    tags, layout = evidence.search.tags, _seen_layout(evidence)
    if layout is None:
        return {}
    panel = np.concatenate([tag_corners(layout, corner) for corner in tags])
    camera = np.concatenate([tags[corner][1] for corner in tags])
    if len(tags) > 1:
        h, _ = cv2.findHomography(panel, camera, 0)
    else:  # one small tag does not determine the perspective
        part, _ = cv2.estimateAffine2D(panel, camera)
        h = np.vstack([part, [0, 0, 1]]) if part is not None else None
    if h is None or not np.isfinite(h).all():
        return {}
    out = {}
    for corner in missing:
        x, y = tag_places(layout)[corner]
        inset = layout.module / 2 - 0.5  # half of the margin is enough
        low, high = np.array([x, y]) + inset, np.array([x, y]) + layout.tag - 1 - inset
        across = np.array([low[0], high[0], high[0], low[0]])
        down = np.array([low[1], low[1], high[1], high[1]])
        out[corner] = np.stack(project(np.asarray(h), across, down), axis=-1)
    return out
