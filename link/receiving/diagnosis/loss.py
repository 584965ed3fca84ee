"""The cause of loss for a transmission that was detected, but did not arrive whole.

Light that is too strong or too weak, and a gap in the recording, which the frames that arrived
tell, are causes among others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from link.coding import blocks_of
from link.receiving.received import Instant
from link.receiving.session import Session
from link.verdict import Cause, Verdict

_DIM: Final = 0.6
"""Rate of the tags' white below which the panel is dim."""
SATURATED: Final = 0.5
"""Share of pixels that fire in every tick, or rate of the tags' black, from which the sensor is
saturated."""
_FRAMES: Final = 4
"""Number of lost frames in a row, and of correct frames around them, from which a stream has a
gap."""
_STRAY: Final = 0.02
"""Share of the frames far from a gap that may be lost: twice what a rate for each block may lose
(`link.setup.adapting`)."""
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
    ppm = (layout.mode.ticks / session.timing.period - 1) * 1e6
    wrong_clock = abs(ppm) > WRONG_PPM  # missing ticks bend the period too
    silent = Verdict(
        Cause.TRUNCATED,
        f"{frames}, {loss}, and the panel sends nothing after tick {session.lit_stop}; send "
        "the file again, with more overhead",
    )
    enough = needed is not None and inbox.frames_read >= needed
    if share <= _CORRECTED and not enough and not wrong_clock:
        return silent  # whatever the light is like, what was sent is too little
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
    gap = gap_text(session, ends=wrong_clock or unbroken)
    if gap is None and wrong_clock:
        return Verdict(
            Cause.WRONG_CLOCK,
            f"{why}; the panel's clock is {ppm:+.0f} parts per million off the camera's; set both "
            "to the same frequency",
        )
    if share <= _CORRECTED:
        return silent
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


def brightness_verdict(white: float, black: float) -> Verdict | None:
    """Verdict; None if the light is adequate.

    Args:
        white, black: spikes a tick of the white and the black of the tags.
    """
    if black >= SATURATED:
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


def gap_text(session: Session, ends: bool = False) -> str | None:
    """Evidence of missing or dark ticks; None if frames were lost in another way.

    A gap is one sequence of blocks that are lost completely, and correct blocks before it, behind
    it or on both sides. If they are on both sides in the same timing, no ticks are missing: the
    panel was dark, or noise is the cause. ends: whether blocks behind it must be correct.
    """
    blocks = _blocks(session)
    lost = [n for n, block in enumerate(blocks) if block.right == 0]
    if not lost or len(lost) == len(blocks) or lost[-1] - lost[0] + 1 > len(lost):
        return None
    if ends and lost[-1] == len(blocks) - 1:
        return None
    if lost[0] > 0 and lost[-1] < len(blocks) - 1 and not session.dark:
        return None
    # Blocks at the ends of the gap may be partly correct.
    far = [b for n, b in enumerate(blocks) if not lost[0] - 1 <= n <= lost[-1] + 1]
    right, frames = sum(b.right for b in far), sum(b.frames for b in far)
    if right < (1 - _STRAY) * frames:
        return None
    whole = [b.frames for b in blocks if 0 < b.frames == b.right]
    each = sum(whole) / max(len(whole), 1)  # a lost block tells nothing of its frames
    if min(len(lost), len(whole)) * each < _FRAMES:
        return None
    sound = []
    if lost[0] > 0:
        sound.append(f"what ended by tick {blocks[lost[0] - 1].tick} is right")
    if lost[-1] < len(blocks) - 1:
        sound.append(
            f"what began after tick {blocks[lost[-1]].tick} {'too' if sound else 'is right'}"
        )
    return (
        ", ".join(sound)
        + ", nothing else: ticks are missing from the recording, or the light was broken; record "
        "without gaps, or send the file again"
    )


@dataclass(frozen=True)
class _Block:
    """A block that was read: tick at which it ended, and frames."""

    tick: int
    right: int
    frames: int


def _blocks(session: Session) -> list[_Block]:
    """Blocks in order. Of a group that was read more than once, the best reading counts."""
    groups: dict[int, Instant] = {}
    for each in session.instants:
        known = groups.get(each.group)
        if known is None or each.right >= known.right:
            groups[each.group] = each
    form = blocks_of(session.layout)
    parts: dict[int, list[Instant]] = {}
    for number in sorted(groups):
        parts.setdefault(number // form.groups, []).append(groups[number])
    return [
        _Block(some[-1].tick, sum(i.right for i in some), sum(i.frames for i in some))
        for some in parts.values()
    ]
