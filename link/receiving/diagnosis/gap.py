"""Detection of a gap in a recording, from the frames that arrived."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from link.coding import blocks_of
from link.receiving.received import Instant
from link.receiving.session import Session

_FRAMES: Final = 4
"""Number of lost frames in a row, and of correct frames around them, from which a stream has a
gap."""
_STRAY: Final = 0.02
"""Share of the frames far from a gap that may be lost: twice what a rate for each block may lose
(`link.setup.adapting`)."""


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
