"""The outer code: a file as packets, any slightly larger number of which recovers it.

RaptorQ (RFC 6330), from the library of that name. The library trusts what it is given and panics on
what it cannot code: no data, more than 255 blocks, a packet of another length or of an unknown
block. All of this is checked before (`codable`, `Gathering.put`), and the decoded file carries a
CRC. A panic is then a fault of the library.

A panic arrives as an exception, but the library, in Rust, writes its lines to descriptor 2 before,
and only Rust code could stop it. The calls that compute are therefore `muted`, so that our line
alone tells of it. To point the descriptor elsewhere for the time of a call would take the lines of
other threads and of children that they start. So the call is made in a thread with a table of
descriptors of its own: `close_range` with CLOSE_RANGE_UNSHARE copies the table for the calling
thread alone (Linux 5.9, close_range(2)). It also closes the copies, so that no pipe and no file
stays open for the time of the call. The thread ends with the call, because a fork would lose one
that waits for the next. A child process would do as well, but takes 50 ms to start and holds the
data twice.
"""

from __future__ import annotations

import ctypes
import os
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from threading import Thread
from typing import Final, ParamSpec, TypeVar

from cosim.errors import InputError, shorten
from link.coding.packed_file import MOST_BYTES, Delivered, unpack_file

_UNSHARE: Final = 2
"""CLOSE_RANGE_UNSHARE (linux/close_range.h)."""
_P = ParamSpec("_P")
_T = TypeVar("_T")
Packet = bytes
"""Four bytes of number, then the symbol."""
_MOST_SYMBOLS: Final = 56403
"""Largest number of source symbols of a block (RFC 6330, section 5.1.2)."""
_MOST_BLOCKS: Final = 255
"""Largest number of blocks of the library, which counts them in a byte."""
_NUMBER: Final = 4
"""Bytes of a packet's number: block and symbol (RFC 6330, section 3.2)."""
_NUMBERS: Final = 2**24
"""Packets of a block that have a number."""
_LARGE, _ALIGNMENT = 64, 8
"""The library cuts symbols from the first size on to multiples of the second."""


def packets(packed: bytes, symbol: int, count: int) -> list[Packet]:
    """The first `count` packets, those of the file itself first.

    Packets of several blocks alternate, so that a burst of losses is shared among them.

    Raises InputError for a file that the code has no blocks or numbers for.
    """
    from raptorq import Encoder

    if not codable(len(packed), symbol):
        raise _refusal(packed, symbol, f"at most {_MOST_BLOCKS} blocks of {_MOST_SYMBOLS} symbols")
    needed, blocks = source_symbols(len(packed), symbol), source_blocks(len(packed), symbol)
    repair = -(-max(count - needed, 0) // blocks)
    if repair > _NUMBERS - _MOST_SYMBOLS:
        raise _refusal(packed, symbol, f"{count} packets are too many")
    try:
        encoder = muted(Encoder.with_defaults, packed, symbol)
        encoded = muted(encoder.get_encoded_packets, repair)
    except BaseException as exc:
        if not _is_panic(exc):
            raise
        raise _refusal(packed, symbol, str(exc)) from exc
    if blocks > 1:  # by symbol, then by block
        encoded.sort(key=lambda packet: (packet[1:4], packet[0]))
    return [bytes(packet) for packet in encoded[:count]]


def _refusal(packed: bytes, symbol: int, why: str) -> InputError:
    return InputError(
        "the file", "one that the fountain code can encode",
        f"{len(packed)} bytes in symbols of {symbol} ({shorten(why)})",
        "send another, or change link.modem",
    )  # fmt: skip


class Gathering:
    """The packets of one session, until there are enough.

    Attributes:
        length: bytes of the fountain.
        symbol: bytes of a symbol.
        needed: source symbols of the file.

    Raises:
        ValueError: for a length and a symbol that are not `codable`.
    """

    def __init__(self, length: int, symbol: int) -> None:
        if not codable(length, symbol):
            raise ValueError(f"the file must be codable, not {length} bytes in {symbol}")
        self.length, self.symbol = length, symbol
        self._blocks = source_blocks(length, symbol)
        self.needed = source_symbols(length, symbol)
        self._done = False
        self._begin()

    def _begin(self) -> None:
        from raptorq import Decoder

        self._decoder = Decoder.with_defaults(self.length, self.symbol)
        self._numbers: set[bytes] = set()
        self._of_block: Counter[bytes] = Counter()

    def __len__(self) -> int:
        return len(self._numbers)

    def put(self, packet: Packet) -> Delivered | None:
        """Takes a packet; gives the file with the packet that completes it. A packet that cannot be
        of this file is ignored.

        If the CRC of a decoded file is wrong, the file and all packets are discarded.
        """
        number, block = packet[:_NUMBER], packet[:1]
        if len(packet) != _NUMBER + self.symbol or packet[0] >= self._blocks:
            return None
        if self._done or number in self._numbers:
            return None
        self._numbers.add(number)
        self._of_block[block] += 1
        try:
            # Before a block has as many as its symbols, the library only stores the packet.
            if self._of_block[block] < self.needed // self._blocks:
                packed = self._decoder.decode(packet)
            else:
                packed = muted(self._decoder.decode, packet)
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


def source_symbols(length: int, symbol: int) -> int:
    """Number of symbols that `length` bytes fill."""
    return -(-length // symbol)


def source_blocks(length: int, symbol: int) -> int:
    """Number of blocks that the library codes separately (RFC 6330, section 4.3, 10 MiB)."""
    return -(-source_symbols(length, symbol) // _MOST_SYMBOLS)


def codable(length: int, symbol: int) -> bool:
    """Whether the library codes so many bytes in symbols of `symbol` bytes."""
    whole = 0 < symbol < 2**16 and (symbol < _LARGE or symbol % _ALIGNMENT == 0)
    return whole and 0 < length <= MOST_BYTES and source_blocks(length, symbol) <= _MOST_BLOCKS


def muted(function: Callable[_P, _T], *args: _P.args, **options: _P.kwargs) -> _T:
    """Calls a function that opens no file of ours, and returns or raises what it does.

    What it writes to standard error is lost; where the system lacks the call, it is seen. A call
    takes about 0.1 ms more.
    """
    outcome: Future[_T] = Future()

    def call() -> None:
        try:
            _turn_away()
            outcome.set_result(function(*args, **options))
        except BaseException as exc:  # a panic is no Exception
            outcome.set_exception(exc)

    thread = Thread(target=call)
    thread.start()
    thread.join()
    return outcome.result()


def _turn_away() -> None:
    """Gives this thread a table of descriptors with standard error on nothing."""
    try:
        close_range = ctypes.CDLL(None).close_range
    except AttributeError:  # glibc before 2.34
        return
    close_range.argtypes = (ctypes.c_uint, ctypes.c_uint, ctypes.c_int)
    if close_range(3, ~0 & 0xFFFF_FFFF, _UNSHARE) == 0:  # else the table is that of all threads
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def _is_panic(error: BaseException) -> bool:
    """Whether a fault of the library raised it, whose class is no Exception and cannot be
    imported."""
    return type(error).__name__ == "PanicException"
