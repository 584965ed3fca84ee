"""Why nothing, or not all, arrived: one cause, with the figures that show it and what mends it."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from link.layout import TRAINING, Layout
from link.mode import TICKS, Mode
from link.receiving.acquiring import Evidence
from link.receiving.clocking import global_clock, pilot_signal
from link.receiving.gap import gap_told
from link.receiving.recording import Recording
from link.receiving.refining import project
from link.receiving.session import Session
from link.receiving.tags import LEAST_MODULE, find_tags, tag_corners, tag_places
from link.verdict import Cause, Verdict

__all__ = ["explain_failure", "explain_loss"]

Floats = npt.NDArray[np.float64]
_DARK: Final = 0.004
"""Rate below which nothing is said to shine: a spike in 250 ticks."""
_DIM: Final = 0.6
"""Rate of the tags' white below which the panel is said to be dim."""
_SHINES: Final = 0.1
"""Rate of the brightest pixels below which it is too dark to say what an image holds."""
_FULL: Final = 0.5
"""Share of pixels at every tick, or rate of the tags' black, from which the sensor is saturated."""
_SHORT: Final = 48
"""Ticks below which a stream is too short to find anything in."""
_CLOCKS: Final = (100_000.0, 500.0)
"""Parts per million of the widest search for a clock, and its step."""
_CLOCK: Final = 2000.0
"""Parts per million from which a clock is said to be off."""
_SEEN: Final = 6.5
"""Standard deviations of the pilots' peak in a whole image that show that a panel sends."""
_BLURRED: Final = 0.7
"""Standard deviations of blur, in cells, from which the panel is said to be out of focus."""
_CELL: Final = 1.5
"""Camera pixels to a cell's side below which cells are too small."""
_HOLE: Final = 0.03
"""Share of the panel without light that is said to be hidden."""
_FILLS = 0.95
"""Share of the image that light stands on from which it has no edge within it."""
_LEAST: Final = 40
"""Camera pixels to the shorter side of an image in which a panel's tags could stand: two of them,
of ten modules, at two pixels each."""
_TAGGED: Final = 96 * LEAST_MODULE
"""Camera pixels to the shorter side of a panel's image below which its tags may be too small: it
has at most so many of their modules (`link.layout`)."""
_BLOB, _SHARP = 0.04, 0.03
"""Share of the image that light stands on at least, and of its variance that is fine detail at
most, of a panel out of focus."""
_MENDED: Final = 0.02
"""Share of codewords lost up to which decoding is said to work."""
_SURE: Final = 1e-3
"""Share of wrong decisions that soft values promise below which noise is no reason for losing every
frame."""


def explain_failure(recording: Recording, evidence: Evidence | None) -> Verdict:
    """Of a stream in which no transmission was found."""
    if evidence is None or recording.ticks < _SHORT:
        return Verdict(
            Cause.TRUNCATED,
            f"the stream has {recording.ticks} ticks, too few to find a panel in; record {_SHORT} "
            "ticks of the panel at least",
        )
    e = evidence
    if e.most < _DARK:
        return Verdict(
            Cause.DARK,
            f"the brightest pixels fire {e.most:.3g} times a tick; switch the panel on, open the "
            "lens, or lower the threshold",
        )
    if e.bright >= _FULL:
        return Verdict(
            Cause.SATURATED,
            f"{e.bright:.0%} of the pixels fire at every tick; stop the lens down, raise the "
            "threshold, or shade the camera",
        )
    if e.tiny is not None:
        assert e.mode is not None
        return Verdict(
            Cause.TOO_SMALL,
            f"the tags say {e.mode.width} x {e.mode.height} panel pixels with cells of "
            f"{e.mode.cell} x {e.mode.cell}, of which one is {e.tiny:.2g} camera pixels wide; step "
            "nearer or send larger cells",
        )
    if e.refined is not None:
        return _of_panel(recording, e)
    if e.found.tags:
        return _of_few_tags(recording, e)
    return _of_no_tag(recording, e)


def _of_panel(recording: Recording, e: Evidence) -> Verdict:
    """The panel was found, its symbols were not."""
    assert e.refined is not None
    if e.mode is None or e.lit is None:
        return Verdict(
            Cause.DIM,
            f"the tags' white fires {e.refined.white:.3g} times a tick, their black "
            f"{e.refined.black:.3g}; open the lens or lower the threshold",
        )
    signal = pilot_signal(recording, Layout(e.mode), e.refined.homography)
    wrong = None
    if signal is not None:
        low, high = (tick - signal.first for tick in e.lit)
        wrong = _clock((signal.bits @ signal.pixels)[max(low, 0) : high], e.mode.ticks)
    if wrong is not None:
        return wrong
    least = (TRAINING + Layout(e.mode).group) * e.mode.ticks
    weak = _of_light(e.refined.white, e.refined.black)
    if weak is not None:
        return weak
    if e.lit[1] - e.lit[0] < max(_SHORT, least):
        return Verdict(
            Cause.TRUNCATED,
            f"the panel is on for {e.lit[1] - e.lit[0]} ticks of the stream only, and its training "
            f"and first group take {least}; record longer",
        )
    return Verdict(
        Cause.WRONG_CLOCK,
        "the panel is in view but its pilots do not show at any clock within "
        f"{_CLOCKS[0] / 1e4:.0f} % of the camera's; show {e.mode.ticks} planes of the panel's "
        "clock a symbol, at the camera's rate",
    )


def _clock(pilots: Floats, ticks: int) -> Verdict | None:
    """Of the spikes of all pilots in each tick."""
    if len(pilots) < _SHORT:
        return None
    _, ppm, score = global_clock(pilots, (ticks,), *_CLOCKS)
    if score < _SEEN or abs(ppm) < _CLOCK:
        return None
    return Verdict(
        Cause.WRONG_CLOCK,
        f"the panel's clock is {ppm:+.0f} parts per million off the camera's (symbols of {ticks} "
        "planes); set both to the same frequency",
    )


def _of_light(white: float, black: float) -> Verdict | None:
    if black >= _FULL:
        return Verdict(
            Cause.SATURATED,
            f"black of the panel fires {black:.2f} times a tick; stop the lens down, raise the "
            "threshold, or shade the panel",
        )
    if white < _DIM:
        return Verdict(
            Cause.DIM,
            f"white of the panel fires {white:.2f} times a tick, so symbols are missed; open the "
            "lens, lower the threshold, or show symbols of more ticks",
        )
    return None


def _of_few_tags(recording: Recording, e: Evidence) -> Verdict:
    """One to three tags, or four that are of no mode."""
    seen = sorted(e.found.tags)
    names = ("top left", "top right", "bottom right", "bottom left")
    if len(seen) == 4:
        return Verdict(
            Cause.NOISY,
            "four tags are in view, but they are of no mode of this link; show one panel alone",
        )
    missing = [corner for corner in range(4) if corner not in seen]
    where = _missing_places(e, missing)
    height, width = recording.shape
    # A tag is read by its margin, so one that is cut there is as good as gone.
    outside = [
        corner
        for corner, places in where.items()
        if not ((places >= -0.5) & (places <= (width - 0.5, height - 0.5))).all()
    ]
    told = " and ".join(names[corner] for corner in missing)
    if outside:
        return Verdict(
            Cause.OUT_OF_VIEW,
            f"{len(seen)} of 4 tags are in view; that at the {told} reaches beyond the image's "
            "edge; aim the camera at the middle of the panel, or step back",
        )
    return Verdict(
        Cause.OCCLUDED,
        f"{len(seen)} of 4 tags are in view; that at the {told} is hidden or unreadable, though "
        "its place is within the image; clear the line of sight",
    )


def _missing_places(e: Evidence, missing: list[int]) -> dict[int, npt.NDArray[np.float64]]:
    """Camera (x, y) of the corners, (4, 2), of tags that were not found, with half of their margin,
    by those that were and the panel's size as far as their ids tell; a panel of which one side is
    not known is taken to be as wide as it is high."""
    import cv2

    tags = e.found.tags
    sides = [tags[corner][0] // 4 * 32 if corner in tags else None for corner in (0, 1)]
    known = [side for side in sides if side]
    width, height = (side or (known[0] if known else 960) for side in sides)
    try:
        layout = Layout(Mode(width, height, 1, 1, "none", 32))
    except ValueError:
        return {}
    panel = np.concatenate([tag_corners(layout, corner) for corner in tags])
    camera = np.concatenate([tags[corner][1] for corner in tags])
    if len(tags) > 1:
        h, _ = cv2.findHomography(panel, camera, 0)
    else:  # one small tag says little of perspective
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


def _sharpness(rates: npt.NDArray[np.float32]) -> float:
    """Share of an image's variance that is finer than about three pixels."""
    import cv2

    smooth = cv2.GaussianBlur(rates, (0, 0), 2.0)
    all_of_it = float(np.var(rates))
    return float(np.var(rates - smooth)) / all_of_it if all_of_it > 0 else 0.0


def _of_no_tag(recording: Recording, e: Evidence) -> Verdict:
    totals = recording.totals(2)
    _, _, score = global_clock(totals, TICKS, 2000.0, 500.0)
    sends = score >= _SEEN
    lit = e.rates > 0.5 * e.most
    rows, columns = np.flatnonzero(lit.any(1)), np.flatnonzero(lit.any(0))
    sharp = _sharpness(e.rates)
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
    # What is far out of focus has no edge: it stands away from the image's, or on all of it.
    apart = not at_edge and lit.mean() > _BLOB
    blob = (apart or lit.mean() > _FILLS) and e.most > 0.05 and min(lit.shape) >= _LEAST
    mirrored = find_tags(np.ascontiguousarray(e.rates[:, ::-1]))
    if mirrored.tags:
        return Verdict(
            Cause.MIRRORED,
            f"no tag is readable, but {len(mirrored.tags)} of 4 are in the image's mirror image "
            f"({figure}); turn the recording's rows or columns round",
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
    if 0 < shorter < _TAGGED and e.most >= _SHINES:
        size = f"{columns[-1] - columns[0] + 1} x {rows[-1] - rows[0] + 1}"
        return Verdict(
            Cause.TOO_SMALL,
            f"what shines is {size} camera pixels large, and no tag is readable ({figure}): tags "
            f"too small, whose modules need {LEAST_MODULE:g} camera pixels or more; step nearer, "
            "or take a longer lens",
        )
    if e.most < _SHINES:
        return Verdict(
            Cause.DIM,
            f"no tag is readable and the brightest pixels fire {e.most:.2g} times a tick "
            f"({figure}); open the lens or lower the threshold",
        )
    return Verdict(
        Cause.OUT_OF_VIEW,
        f"no tag of a panel is in view ({figure}); aim the camera at the panel, or "
        "step back where it is larger than the view",
    )


def explain_loss(
    session: Session, evidence: Evidence, recording_stop: int,
    interrupted: tuple[int, float] | None = None,
) -> Verdict:  # fmt: skip
    """Of a transmission that was found, but did not arrive whole. interrupted: tick behind which
    the pilots' sequence jumped, and by how many ticks."""
    inbox, refined, layout = session.inbox, session.refined, session.layout
    needed, right = inbox.frames_needed, inbox.frames_right
    share = inbox.codewords_wrong / inbox.codewords if inbox.codewords else 0.0
    ended = session.lit_stop >= recording_stop - 2
    frames = f"{right} of {needed if needed is not None else 'unknown'} frames arrived"
    loss = f"{inbox.codewords_wrong} of {inbox.codewords} codewords could not be mended"
    if interrupted is not None:
        tick, late = interrupted
        return Verdict(
            Cause.INTERRUPTED,
            f"{frames}, {loss}, and by tick {tick} or so the pilots go on {late:+.0f} ticks late: "
            "words of the stream were lost, or another transmission begins; record without a gap, "
            "or send with more overhead",
        )
    if inbox.codewords == 0 or (ended and share <= _MENDED):
        how = f"while the panel is on, at tick {recording_stop}"
        if not ended:
            how = f"with {session.lit_stop} ticks, before a group of symbols is whole"
        begun, since = "", ""
        if session.trained is None:
            begun, since = "the recording begins after first light, ", "from first light "
        return Verdict(
            Cause.TRUNCATED,
            f"{frames}, {loss}, {begun}and the transmission ends {how}; record {since}to the end, "
            "or send the file again",
        )
    why = f"{frames}; {loss}"
    hole = _hole(session)
    if hole >= _HOLE:
        return Verdict(
            Cause.OCCLUDED,
            f"{why}; {hole:.0%} of the cells tell nothing; clear the line of sight",
        )
    light = _of_light(refined.white, refined.black)
    if light is not None:
        return Verdict(light.cause, f"{why}; {light.told}")
    scale = float(np.sqrt(abs(np.linalg.det(refined.homography[:2, :2]))))
    cell = scale * layout.mode.cell
    if refined.blur > _BLURRED * max(cell, 1.0):
        return Verdict(
            Cause.OUT_OF_FOCUS,
            f"{why}; the image is blurred by {refined.blur:.2g} camera pixels and a cell is "
            f"{cell:.2g} wide; focus the lens, or send larger cells",
        )
    if cell < _CELL:
        return Verdict(
            Cause.TOO_SMALL,
            f"{why}; a cell is {cell:.2g} camera pixels wide; step nearer or send larger cells",
        )
    ppm = (layout.mode.ticks / session.timing.period - 1) * 1e6
    if abs(ppm) > _CLOCK:
        return Verdict(
            Cause.WRONG_CLOCK,
            f"{why}; the panel's clock is {ppm:+.0f} parts per million off the camera's; set both "
            "to the same frequency",
        )
    if share <= _MENDED:
        return Verdict(
            Cause.TRUNCATED,
            f"{frames}, {loss}, and the panel sends nothing after tick {session.lit_stop}; send "
            "the file again, with more overhead",
        )
    gap = gap_told(session)
    if gap is not None:
        return Verdict(Cause.INTERRUPTED, f"{why}; {gap}")
    wrong = session.promised / max(session.symbols * layout.cells, 1)
    if right == 0 and wrong < _SURE:
        return Verdict(
            Cause.NOISY,
            f"{why}, though only {wrong:.1g} of the decisions seem doubtful; receive with "
            "`interleave` as the sender had it, or send the file again",
        )
    return Verdict(
        Cause.NOISY,
        f"{why}; send larger cells, longer symbols, or more parity",
    )


def _hole(session: Session) -> float:
    """Share of the data cells whose soft values are next to nothing beside the usual ones."""
    if not session.symbols:
        return 0.0
    quality = session.quality / session.symbols
    usual = float(np.quantile(quality, 0.9))
    return float(np.mean(quality < 0.15 * usual)) if usual > 1 else 0.0
