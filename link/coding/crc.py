"""Cyclic redundancy checks, by fastcrc, under the names of the CRC RevEng catalogue.

Frames carry CRC-32C, files CRC-64/XZ: two polynomials, so that no pattern passes both by one flaw.
"""

from __future__ import annotations

from fastcrc import crc16, crc32, crc64

__all__ = ["crc16_ibm_3740", "crc16_kermit", "crc32_iso_hdlc", "crc32c", "crc64_xz"]


def crc32c(data: bytes) -> int:
    """CRC-32C (Castagnoli), also CRC-32/ISCSI."""
    return int(crc32.iscsi(data))


def crc32_iso_hdlc(data: bytes) -> int:
    """CRC-32 of Ethernet and zip."""
    return int(crc32.iso_hdlc(data))


def crc16_ibm_3740(data: bytes) -> int:
    """CRC-16/IBM-3740, which IEEE 802.15.7 and CCSDS frames carry."""
    return int(crc16.ibm_3740(data))


def crc16_kermit(data: bytes) -> int:
    """CRC-16/KERMIT."""
    return int(crc16.kermit(data))


def crc64_xz(data: bytes) -> int:
    """CRC-64/XZ."""
    return int(crc64.xz(data))
