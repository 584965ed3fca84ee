"""Cyclic redundancy checks from fastcrc, under their names in the CRC RevEng catalogue.

Frames carry CRC-32C, files CRC-64/XZ: with two different polynomials, no error pattern passes both
for the same reason.
"""

from __future__ import annotations

from fastcrc import crc32, crc64


def crc32c(data: bytes) -> int:
    """CRC-32C (Castagnoli), also CRC-32/ISCSI."""
    return int(crc32.iscsi(data))


def crc64_xz(data: bytes) -> int:
    """CRC-64/XZ."""
    return int(crc64.xz(data))
