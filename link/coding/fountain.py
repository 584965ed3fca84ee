"""The outer code: a file as packets, any slightly larger number of which recovers it.

RaptorQ (RFC 6330), from the library of that name. The library trusts every packet and panics on an
impossible one (wrong length, unknown block). Packets are therefore checked before, and the decoded
file carries a CRC.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from cosim.errors import InputError
from link.coding.crc import crc32c, crc64_xz
from link.coding.names import NAME_BYTES, safe_name

__all__ = [
    "MOST_BYTES", "Delivered", "Gathering", "Packet", "pack_file", "packets", "source_blocks",
    "source_symbols", "unpack_file",
]  # fmt: skip

Packet = bytes
"""Four bytes of number, then the symbol."""
MOST_BYTES: Final = 2**30
"""Largest number of bytes of the fountain: the decoder's tables grow with the length in a
header."""
_MOST_SYMBOLS: Final = 56403
"""Largest number of source symbols of a block (RFC 6330, section 5.1.2)."""
_HEAD: Final = struct.Struct("<QB")


@dataclass(frozen=True)
class Delivered:
    """A file that arrived whole.

    Attributes:
        data: its bytes.
        name: a name that is safe to write.
    """

    data: bytes
    name: str


def pack_file(data: bytes, name: str) -> tuple[int, bytes]:
    """Returns the session's number, and the bytes for the fountain: CRC, name and data. Never
    empty."""
    called = safe_name(name).encode()
    body = called + data
    packed = _HEAD.pack(crc64_xz(bytes([len(called)]) + body), len(called)) + body
    if len(packed) > MOST_BYTES:
        raise ValueError(
            f"the file must be at most {MOST_BYTES // 2**20} MiB, not {len(data)} bytes"
        )
    return crc32c(_HEAD.pack(len(packed), len(called)) + packed[: _HEAD.size] + called), packed


def unpack_file(packed: bytes) -> Delivered | None:
    """Returns the file; None if the CRC is wrong."""
    if len(packed) < _HEAD.size:
        return None
    crc, called = _HEAD.unpack_from(packed)
    body = packed[_HEAD.size :]
    if called > min(len(body), NAME_BYTES) or crc64_xz(bytes([called]) + body) != crc:
        return None
    return Delivered(body[called:], safe_name(body[:called].decode(errors="replace")))


def source_symbols(length: int, symbol: int) -> int:
    """Returns the number of symbols that `length` bytes fill."""
    return -(-length // symbol)


def source_blocks(length: int, symbol: int) -> int:
    """Returns the number of blocks that the library codes separately (RFC 6330, section 4.3, 10
    MiB)."""
    return -(-source_symbols(length, symbol) // _MOST_SYMBOLS)


def _is_panic(error: BaseException) -> bool:
    """Whether a fault of the library raised it, whose class is no Exception and cannot be
    imported."""
    return type(error).__name__ == "PanicException"


def packets(packed: bytes, symbol: int, count: int) -> list[Packet]:
    """Returns the first `count` packets, those of the file itself first.

    Packets of several blocks alternate, so that a burst of losses is shared among them.
    """
    from raptorq import Encoder

    needed, blocks = source_symbols(len(packed), symbol), source_blocks(len(packed), symbol)
    repair = -(-max(count - needed, 0) // blocks)
    try:
        encoded = Encoder.with_defaults(packed, symbol).get_encoded_packets(repair)
    except BaseException as exc:
        if not _is_panic(exc):
            raise
        raise InputError(
            "the file", "one that the fountain code can encode",
            f"{len(packed)} bytes in symbols of {symbol} ({exc})",
            "send another, or change link.modem",
        ) from exc  # fmt: skip
    if blocks > 1:  # by symbol, then by block
        encoded.sort(key=lambda packet: (packet[1:4], packet[0]))
    return [bytes(packet) for packet in encoded[:count]]


class Gathering:
    """The packets of one session, until there are enough.

    Attributes:
        length: bytes of the fountain.
        symbol: bytes of a symbol.
        needed: source symbols of the file.
    """

    def __init__(self, length: int, symbol: int) -> None:
        self.length, self.symbol = length, symbol
        self.needed = source_symbols(length, symbol)
        self._done = False
        self._begin()

    def _begin(self) -> None:
        from raptorq import Decoder

        self._decoder = Decoder.with_defaults(self.length, self.symbol)
        self._numbers: set[bytes] = set()

    def __len__(self) -> int:
        return len(self._numbers)

    def put(self, packet: Packet) -> Delivered | None:
        """Returns the file, with the packet that completes it.

        If the CRC of a decoded file is wrong, the file and all packets are discarded.
        """
        number = packet[:4]
        if self._done or number in self._numbers:
            return None
        self._numbers.add(number)
        try:
            packed = self._decoder.decode(packet)
        except BaseException as exc:
            if not isinstance(exc, Exception) and not _is_panic(exc):
                raise
            self._begin()
            return None
        if packed is None:
            return None
        file = unpack_file(bytes(packed))
        self._done = file is not None
        if not self._done:
            self._begin()
        return file
