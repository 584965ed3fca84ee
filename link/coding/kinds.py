"""The blocks of a layout, by the code of its mode."""

from __future__ import annotations

from link.coding.adaptive_blocks import AdaptiveBlocks
from link.coding.blocks import Blocks
from link.coding.soft_blocks import SoftBlocks
from link.layout import Layout


def blocks_of(layout: Layout, interleave: bool = True, period: int | None = None) -> Blocks:
    """Blocks of a layout, by the code of its mode; with a rate for each block, those of the highest
    rate."""
    if layout.mode.adaptive:
        return AdaptiveBlocks(layout, interleave, period)
    kind = Blocks if layout.mode.rate is None else SoftBlocks
    return kind(layout, interleave, period)
