"""The cause of loss for a transmission that was detected, but did not arrive whole."""

from __future__ import annotations

from typing import Final

import numpy as np

from link.receiving.diagnosis.brightness import brightness_verdict
from link.receiving.diagnosis.gap import gap_text
from link.receiving.session import Session
from link.verdict import Cause, Verdict

WRONG_PPM: Final = 2000.0
"""Clock offset from which a clock counts as wrong, parts per million."""
_BLURRED: Final = 0.7
"""Standard deviation of blur, in cells, from which the panel counts as out of focus."""
_CELL: Final = 1.5
"""Side of a cell below which it is too small, camera pixels."""
_HOLE: Final = 0.03
"""Share of the panel without light from which it counts as occluded."""
_CORRECTED: Final = 0.02
"""Share of codewords lost up to which decoding counts as working."""
_SURE: Final = 1e-3
"""Share of wrong decisions, predicted by the soft values, below which noise does not explain the
loss of every frame."""


def explain_loss(
    session: Session, recording_stop: int,
    interrupted: tuple[int, float] | None = None, unbroken: bool = False,
) -> Verdict:  # fmt: skip
    """Cause for a transmission that was detected, but did not arrive whole.

    Args:
        session: session of the transmission.
        recording_stop: end of the recording, ticks.
        interrupted: tick after which the sequence of the pilots jumped, and by how many ticks.
        unbroken: whether the pilots were found to go on in light without a jump.
    """
    inbox, refined, layout = session.inbox, session.refined, session.layout
    needed, right = inbox.frames_needed, inbox.frames_right
    share = inbox.codewords_wrong / inbox.codewords if inbox.codewords else 0.0
    ended = session.lit_stop >= recording_stop - 2
    frames = f"{right} of {needed if needed is not None else 'unknown'} frames arrived"
    loss = f"{inbox.codewords_wrong} of {inbox.codewords} codewords could not be mended"
    if interrupted is not None:
        tick, delay = interrupted
        amount = f"{abs(delay):.0f} tick{'' if round(abs(delay)) == 1 else 's'}"
        way = "early" if delay < 0 else "late"
        return Verdict(
            Cause.INTERRUPTED,
            f"{frames}, {loss}, and by tick {tick} or so the pilots go on {amount} {way}: words "
            "of the stream were lost, or another transmission begins; record without a gap, "
            "or send with more overhead",
        )
    if inbox.codewords == 0 or (ended and share <= _CORRECTED):
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
    light = brightness_verdict(refined.white, refined.black)
    if light is not None:
        return Verdict(light.cause, f"{why}; {light.text}")
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
    wrong_clock = abs(ppm) > WRONG_PPM  # missing ticks bend the period too
    gap = gap_text(session, ends=wrong_clock or unbroken)
    if gap is None and wrong_clock:
        return Verdict(
            Cause.WRONG_CLOCK,
            f"{why}; the panel's clock is {ppm:+.0f} parts per million off the camera's; set both "
            "to the same frequency",
        )
    if share <= _CORRECTED:
        return Verdict(
            Cause.TRUNCATED,
            f"{frames}, {loss}, and the panel sends nothing after tick {session.lit_stop}; send "
            "the file again, with more overhead",
        )
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
    """Share of the data cells whose soft values are much smaller than the usual ones."""
    if not session.symbols:
        return 0.0
    quality = session.quality / session.symbols
    usual = float(np.quantile(quality, 0.9))
    return float(np.mean(quality < 0.15 * usual)) if usual > 1 else 0.0
