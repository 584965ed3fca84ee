"""Bytes to bits and back: CRC, Reed-Solomon, interleaver, fountain, frames."""

from link.coding.blocks import Blocks
from link.coding.crc import crc16_ibm_3740, crc16_kermit, crc32_iso_hdlc, crc32c, crc64_xz
from link.coding.fountain import MOST_BYTES, Delivered
from link.coding.inbox import Inbox
from link.coding.names import safe_name
from link.coding.outbox import Outbox
from link.coding.reed_solomon import WORD_BYTES, ReedSolomon

__all__ = [
    "MOST_BYTES",
    "WORD_BYTES",
    "Blocks",
    "Delivered",
    "Inbox",
    "Outbox",
    "ReedSolomon",
    "crc16_ibm_3740",
    "crc16_kermit",
    "crc32_iso_hdlc",
    "crc32c",
    "crc64_xz",
    "safe_name",
]
