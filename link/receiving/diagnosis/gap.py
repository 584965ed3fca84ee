"""Detection of a gap in a recording, from the frames that arrived."""

from __future__ import annotations

from typing import Final

from link.coding import blocks_of
from link.receiving.session import Session

__all__ = ["gap_text"]

_FRAMES: Final = 4
"""Number of lost frames in a row, and of correct frames around them, from which a stream has a
gap."""


def gap_text(session: Session) -> str | None:
    """Returns the evidence of missing or dark ticks; None if frames were lost in another way.

    A gap is one sequence of blocks that are lost completely, between correct ones.
    """
    form = blocks_of(session.layout)
    blocks: dict[int, tuple[int, int]] = {}
    for each in session.instants:
        block = each.group // form.groups
        blocks[block] = each.tick, blocks.get(block, (0, 0))[1] + each.right
    ticks, right = zip(*(blocks[block] for block in sorted(blocks)), strict=True)
    lost = [n for n, frames in enumerate(right) if frames == 0]
    if not lost or lost[0] == 0 or lost[-1] - lost[0] + 1 > len(lost):
        return None
    # Blocks at the ends of the gap may be partly correct.
    far = [n for n in range(len(right)) if not lost[0] - 1 <= n <= lost[-1] + 1]
    whole = sum(frames == form.frames for frames in right)
    if any(right[n] < form.frames for n in far) or min(len(lost), whole) * form.frames < _FRAMES:
        return None
    return (
        f"what ended by tick {ticks[lost[0] - 1]} is right"
        + (f", what began after tick {ticks[lost[-1]]} too" if right[-1] else "")
        + ", nothing else: ticks are missing from the recording, or the light was broken; record "
        "without gaps, or send the file again"
    )
