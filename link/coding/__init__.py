"""Bytes to bits and back: CRC, codes of words, interleaver, fountain, frames."""

from link.coding.adaptive_blocks import AdaptiveBlocks
from link.coding.blocks import Blocks
from link.coding.boxes import Inbox, Outbox
from link.coding.packed_file import MOST_BYTES, safe_name
from link.coding.reader import BlockReader
from link.coding.reed_solomon import WORD_BYTES
from link.coding.soft_blocks import SoftBlocks
from link.coding.writer import BlockWriter, blocks_of

__all__ = [
    "MOST_BYTES", "WORD_BYTES", "AdaptiveBlocks", "BlockReader", "BlockWriter", "Blocks",
    "Inbox", "Outbox", "SoftBlocks", "blocks_of", "safe_name",
]  # fmt: skip
