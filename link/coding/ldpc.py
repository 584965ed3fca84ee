"""Low-density parity-check codes of 3GPP TS 38.212 (5G NR), version 18, with soft decisions.

Bits are sent as the standard's redundancy version 0 has them (clause 5.4.2.1), once: data from bit
2 Z on, Z the lifting size, then parity. The first 2 Z bits of data are never sent, and the decoder
finds them from the parity. Where the data are fewer than the columns of the graph hold, the rest is
zero and not sent. Higher rates send less parity. Bit b of data and of words is bit b % 8 of byte
b // 8.

A base graph has a row for each group of Z checks and a column for each group of Z bits. An edge of
the graph with the value V is the Z x Z identity matrix, whose columns are rotated to the right by
V mod Z: check z has the bit (z + V) mod Z of the column. V depends on the set of the lifting size.
The tables are `ldpc_graph_1.csv` (table 5.3.2-2) and `ldpc_graph_2.csv` (table 5.3.2-3), an edge a
line: row, column, V of the sets 0 to 7. They were read from the data of sionna 2.2.0 and compared
with those of neoradium 0.5.3; the one edge of the 513 that differed, row 6, column 0 of graph 1
(158 and 80 in the sets 3 and 4), was settled by a third copy.

The encoder is compiled and takes 64 bits at a time. The decoder is layered min-sum in eight bits.
It ends as soon as all checks hold. Its three forms give the same bits: numpy
(`link.coding.ldpc_decoding`), compiled, OpenCL.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from importlib.resources import files
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.cores import by_rows
from cosim.compute.opencl import Device
from link.coding.ldpc_decoding import decode_words, quantise_values
from link.coding.ldpc_opencl import decode_on_device

_Integers = npt.NDArray[np.int32]
_Bytes = npt.NDArray[np.uint8]
_Soft = npt.NDArray[np.int8]
_FACTORS: Final = (2, 3, 5, 7, 9, 11, 13, 15)
_LARGEST: Final = 384
LIFTINGS: Final = {
    factor << power: number
    for number, factor in enumerate(_FACTORS)
    for power in range(8)
    if factor << power <= _LARGEST
}
"""Lifting size -> number of its set (table 5.3.2-1)."""
_DATA_COLUMNS: Final = {1: 22, 2: 10}
_U64 = np.uint64
_START = np.int64(0)
"""The first bit, of the type of the others: a literal would compile `_copy_bits` once more."""
STEPS: Final = 4.0
"""Steps of a quantised soft value in a unit of natural logarithm."""
ROUNDS: Final = 30
"""Rounds over all checks after which a word is given up."""
_PUNCTURED: Final = 2
"""Columns of data that are not sent."""


class Ldpc:
    """A code.

    Attributes:
        data_bits, word_bits: bits of data in a word, and bits that are sent.
        lifting: lifting size Z.
        columns, data_columns: columns of the graph in use, of Z bits each, and those of data.
    """

    def __init__(
        self, data_bits: int, word_bits: int, *, lifting: int | None = None, graph: int = 1
    ) -> None:
        """A code of `data_bits` in `word_bits`, both multiples of 8.

        Args:
            lifting: Z of table 5.3.2-1; None for the smallest that holds the data.
            graph: base graph, 1 or 2.

        Raises:
            ValueError: if the graph has no such code.
        """
        base = base_graph(graph)
        if lifting is None:
            fits = [z for z in LIFTINGS if z * base.data_columns >= data_bits]
            lifting = min(fits, default=max(LIFTINGS))
        if lifting not in LIFTINGS:
            raise ValueError(f"lifting must be one of table 5.3.2-1 of TS 38.212, not {lifting}")
        least, most = _PUNCTURED * lifting + 1, base.data_columns * lifting
        if data_bits % 8 or not least <= data_bits <= most:
            raise ValueError(
                f"data_bits must be a multiple of 8, {least} to {most} with lifting {lifting}, "
                f"not {data_bits}"
            )
        sent = data_bits - _PUNCTURED * lifting
        most = sent + base.rows * lifting
        if word_bits % 8 or not data_bits < word_bits <= most:
            raise ValueError(
                f"word_bits must be a multiple of 8, {data_bits + 1} to {most} with data_bits "
                f"{data_bits}, not {word_bits}"
            )
        self.data_bits, self.word_bits, self.lifting = data_bits, word_bits, lifting
        self.data_columns = base.data_columns
        # Rows 0 to 3 are bound to each other and always needed; others only for their own parity.
        rows = max(4, -(-(word_bits - sent) // lifting))
        self.columns = base.data_columns + rows
        used = base.row < rows
        self._row, self._column = base.row[used], base.column[used]
        self._shift = base.values[used, LIFTINGS[lifting]] % np.int32(lifting)

    @classmethod
    def of_rate(cls, rate: float, lifting: int = 384, graph: int = 1) -> Ldpc:
        """A code whose columns are full of data, and whose word is shortest at no more than
        `rate`.

        Raises:
            ValueError: if there is no such code.
        """
        if not 0 < rate < 1:
            raise ValueError(f"rate must be above 0 and below 1, not {rate}")
        data_bits = base_graph(graph).data_columns * lifting
        return cls(data_bits, 8 * int(np.ceil(data_bits / rate / 8)), lifting=lifting, graph=graph)

    @property
    def rate(self) -> float:
        """Data bits per bit sent."""
        return self.data_bits / self.word_bits

    @property
    def sent_data(self) -> int:
        """Bits of data in a word as sent."""
        return self.data_bits - _PUNCTURED * self.lifting

    @property
    def edges(self) -> tuple[_Integers, _Integers, _Integers]:
        """Row, column and shift of each edge in use, (edges,) int32 each, sorted by row."""
        return self._row, self._column, self._shift

    @cached_property
    def schedule(self) -> tuple[_Integers, _Integers, _Integers]:
        """The edges in the order in which they are decoded.

        Rows with one column that is not sent come first: such a row finds the bits of it at once,
        one with two learns nothing until then.

        Returns:
            starts, (rows + 1,): row r has the edges starts[r] to starts[r + 1]; the columns and
            shifts of the edges, (edges,); int32.
        """
        hidden = np.bincount(self._row, self._column < _PUNCTURED)
        rows = np.argsort(hidden, kind="stable")
        order = np.concatenate([np.flatnonzero(self._row == row) for row in rows])
        starts = np.concatenate([[0], np.cumsum(np.bincount(self._row)[rows])]).astype(np.int32)
        return starts, self._column[order], self._shift[order]

    def encode(self, data: npt.ArrayLike) -> _Bytes:
        """Words (words, word_bits / 8) uint8 of data (words, data_bits / 8) uint8."""
        message = np.ascontiguousarray(data, np.uint8)
        if message.ndim != 2 or message.shape[1] * 8 != self.data_bits:
            raise ValueError(f"data must be (words, {self.data_bits // 8}), not {message.shape}")
        words = np.empty((len(message), self.word_bits // 8), np.uint8)
        by_rows(
            encode_words, len(message), message, *self.edges, self.columns, self.lifting,
            self.data_columns, self.sent_data, words,
        )  # fmt: skip
        return words

    def decode(
        self, soft: npt.ArrayLike, rounds: int = ROUNDS, device: Device | None = None
    ) -> tuple[_Bytes, npt.NDArray[np.bool_], _Integers]:
        """Decodes words from soft values.

        Args:
            soft: (words, word_bits) int8, ln P(1) - ln P(0) in steps (`quantise`); 0 is an erasure.
            rounds: largest number of rounds, 1 or more.
            device: OpenCL device; None for the compiled form.

        Returns:
            The data, (words, data_bits / 8) uint8; ok, (words,) bool: whether all checks hold,
            which they rarely do in a wrong word; and the number of rounds, (words,) int32. Where
            not ok, the data are the last guess.
        """
        given = np.ascontiguousarray(soft)
        if given.ndim != 2 or given.shape[1] != self.word_bits or given.dtype != np.int8:
            raise ValueError(
                f"soft must be (words, {self.word_bits}) int8, not {given.shape} {given.dtype}"
            )
        if rounds < 1:
            raise ValueError(f"rounds must be 1 or more, not {rounds}")
        data = np.empty((len(given), self.data_bits // 8), np.uint8)
        ok, spent = np.empty(len(given), np.bool_), np.empty(len(given), np.int32)
        if device is None:
            longest = int(np.diff(self.schedule[0]).max())
            shape = self.columns, longest, self.lifting, self.data_columns
            by_rows(
                decode_words, len(given), given, *self.schedule, *shape, rounds, data, ok, spent
            )
        else:
            decode_on_device(device, self, given, rounds, data, ok, spent)
        return data, ok, spent


def quantise(soft: npt.ArrayLike, steps: float = STEPS) -> _Soft:
    """Soft values, ln P(1) - ln P(0), in steps, int8; NaN counts as 0, an erasure.

    At a point where one word of rate .88 in a hundred fails, values too small by a third make that
    15, values too large by a third two. At rates below a half, twice too large values fail.
    """
    given = np.ascontiguousarray(soft, np.float32)
    out = np.empty(given.shape, np.int8)
    quantise_values(given.reshape(-1), np.float32(steps), out.reshape(-1))
    return out


@dataclass(frozen=True, eq=False)
class Graph:
    """A base graph.

    The columns are data, then parity. Row r has a parity column with the value 0 that no later row
    has: data_columns + 1 + r for r < 3, data_columns + r for r > 3. Rows 0 to 3 have the column
    data_columns three times, twice with the same value.

    Attributes:
        data_columns: number of columns of data.
        rows: number of rows.
        row, column: row and column of each edge, (edges,) int32, sorted by row.
        values: V of each edge and set, (edges, 8) int32.
    """

    data_columns: int
    rows: int
    row: _Integers
    column: _Integers
    values: _Integers


@lru_cache
def base_graph(number: int) -> Graph:
    """Base graph 1 (46 x 68) or 2 (42 x 52).

    Raises:
        ValueError: if there is no such graph.
    """
    if number not in _DATA_COLUMNS:
        raise ValueError(f"graph must be 1 or 2, not {number}")
    text = (files("link.coding") / f"ldpc_graph_{number}.csv").read_text(encoding="utf-8")
    table = np.loadtxt(text.splitlines(), np.int32, delimiter=",", skiprows=1)
    row, column = table[:, 0].copy(), table[:, 1].copy()
    return Graph(_DATA_COLUMNS[number], int(row[-1]) + 1, row, column, table[:, 2:].copy())


@njit(cache=True, nogil=True)
def encode_words(  # type: ignore[no-untyped-def]
    w0, w1, data, row, column, shift, columns, lifting, first, sent, words
):
    """Fills words `w0` to `w1` of words, (n, word_bits / 8) uint8.

    Args:
        data: (n, data_bits / 8) uint8.
        row, column, shift: edges, int32, sorted by row.
        columns: number of columns.
        lifting: Z.
        first: the first parity column.
        sent: bits of data in a word.
    """
    parity = words.shape[1] * 8 - sent
    padded = np.zeros((first * lifting // 64 + 2) * 8, np.uint8)
    source = padded.view(np.uint64)
    out = np.zeros(words.shape[1] // 8 + 1, np.uint64)
    output = out.view(np.uint8)
    bits = np.zeros((columns, lifting // 32 + 2), np.uint64)
    total = np.zeros((lifting + 63) // 64, np.uint64)
    turned = np.zeros((lifting + 63) // 64, np.uint64)
    for w in range(w0, w1):
        for i in range(data.shape[1]):
            padded[i] = data[w, i]
        _encode(source, row, column, shift, lifting, first, bits, total, turned)
        for i in range(len(out)):
            out[i] = 0
        _copy_bits(source, 2 * lifting, out, _START, sent)
        for c in range(-(-parity // lifting)):
            size = min(lifting, parity - c * lifting)
            _copy_bits(bits[first + c], _START, out, sent + c * lifting, size)
        for i in range(words.shape[1]):
            words[w, i] = output[i]


@njit(cache=True, nogil=True)
def _encode(source, row, column, shift, lifting, first, bits, total, turned):  # type: ignore[no-untyped-def]
    """Fills the parity columns of bits, (columns, doubled) uint64, from the data columns.

    Args:
        first: the first parity column.
        total, turned: memory for one column, uint64.
    """
    for c in range(first):
        for i in range(bits.shape[1]):
            bits[c, i] = 0
        _copy_bits(source, c * lifting, bits[c], _START, lifting)
        _copy_bits(source, c * lifting, bits[c], lifting, lifting)
    # The sum of rows 0 to 3 has only one unknown: the first parity column, once.
    for i in range(len(total)):
        total[i] = 0
    turn = np.int64(0)
    for e in range(len(row)):
        if row[e] < 4:
            if column[e] < first:
                _add_rotated(bits[column[e]], shift[e], total)
            elif column[e] == first:
                turn ^= shift[e]  # two are equal and cancel
    _set_column(total, lifting, bits[first])
    for i in range(len(total)):
        turned[i] = 0
    _add_rotated(bits[first], (lifting - turn) % lifting, turned)
    _set_column(turned, lifting, bits[first])
    e = 0
    while e < len(row):
        r = row[e]
        solved = first + r + 1 if r < 3 else first + r
        for i in range(len(total)):
            total[i] = 0
        while e < len(row) and row[e] == r:
            if column[e] != solved:
                _add_rotated(bits[column[e]], shift[e], total)
            e += 1
        if r != 3:  # it holds already
            _set_column(total, lifting, bits[solved])


@njit(cache=True, nogil=True)
def _add_rotated(column, shift, total):  # type: ignore[no-untyped-def]
    """Adds (xor) bits `shift` and on of a column, 64 to a uint64, to total."""
    start, part = shift >> 6, _U64(shift & 63)
    for i in range(len(total)):
        low, high = column[start + i], column[start + i + 1]
        # In two steps: a shift by 64 is not defined.
        total[i] ^= (low >> part) | ((high << _U64(1)) << (_U64(63) - part))


@njit(cache=True, nogil=True)
def _copy_bits(source, start, target, at, count):  # type: ignore[no-untyped-def]
    """Adds (xor) `count` bits of source from bit `start` to target from bit `at`, uint64 both."""
    done = 0
    while done < count:
        bit = at + done
        size = min(count - done, 64 - (bit & 63))
        place, part = (start + done) >> 6, (start + done) & 63
        value = source[place] >> _U64(part)
        if part and part + size > 64:
            value |= source[place + 1] << _U64(64 - part)
        if size < 64:
            value &= (_U64(1) << _U64(size)) - _U64(1)
        target[bit >> 6] ^= value << _U64(bit & 63)
        done += size


@njit(cache=True, nogil=True)
def _set_column(bits, lifting, column):  # type: ignore[no-untyped-def]
    """Stores the first `lifting` bits twice in a column, uint64."""
    for i in range(len(column)):
        column[i] = 0
    _copy_bits(bits, _START, column, _START, lifting)
    _copy_bits(bits, _START, column, lifting, lifting)
