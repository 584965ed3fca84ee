"""Bytes to bits and back: CRC, codes of words, interleaver, fountain, frames."""

from link.coding.adaptive_blocks import AdaptiveBlocks
from link.coding.blocks import Blocks
from link.coding.fountain import MOST_BYTES
from link.coding.inbox import Inbox
from link.coding.kinds import blocks_of
from link.coding.names import safe_name
from link.coding.outbox import Outbox
from link.coding.reader import BlockReader
from link.coding.reed_solomon import WORD_BYTES
from link.coding.soft_blocks import SoftBlocks
from link.coding.writer import BlockWriter

__all__ = [
    "MOST_BYTES", "WORD_BYTES", "AdaptiveBlocks", "BlockReader", "BlockWriter", "Blocks",
    "Inbox", "Outbox", "SoftBlocks", "blocks_of", "safe_name",
]  # fmt: skip
