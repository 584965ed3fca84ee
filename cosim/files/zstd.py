"""The size that a Zstandard frame states of its content, for a check before it is unpacked."""

from __future__ import annotations

from typing import Final

HEAD: Final = 18
"""Bytes of the longest header of a frame (RFC 8878, section 3.1.1)."""
_MAGIC: Final = b"\x28\xb5\x2f\xfd"
_ID: Final = (0, 1, 2, 4)
"""Bytes of the dictionary's number, by the two lowest bits of the descriptor."""


def content_size(head: bytes) -> int | None:
    """Bytes of a frame's content by its header (RFC 8878, section 3.1.1.1); None if it states none,
    or is no header.

    Args:
        head: the first `HEAD` bytes of a frame, or all of a shorter one.
    """
    if head[:4] != _MAGIC or len(head) < 5:
        return None
    descriptor = head[4]
    single = descriptor >> 5 & 1
    wide = (single, 2, 4, 8)[descriptor >> 6]
    at = 5 + (not single) + _ID[descriptor & 3]
    field = head[at : at + wide]
    if not wide or len(field) < wide:
        return None
    return int.from_bytes(field, "little") + (256 if wide == 2 else 0)
