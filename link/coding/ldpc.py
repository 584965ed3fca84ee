"""Low-density parity-check codes of 3GPP TS 38.212 (5G NR), with soft decisions.

Bits are sent as the standard's redundancy version 0 has them (clause 5.4.2.1), once: data from bit
2 Z on, Z the lifting size, then parity. The first 2 Z bits of data are never sent, and the decoder
finds them from the parity. Where the data are fewer than the columns of the graph hold, the rest is
zero and not sent. Higher rates send less parity. Bit b of data and of words is bit b % 8 of byte
b // 8.

The decoder is layered min-sum in eight bits. It ends as soon as all checks hold. Its three forms
give the same bits: numpy (`link.coding.ldpc_numpy`), compiled, OpenCL.
"""

from __future__ import annotations

from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from link.coding.ldpc_compiled import decode_words, quantise_values
from link.coding.ldpc_encoding import encode_words
from link.coding.ldpc_graph import LIFTINGS, base_graph
from link.coding.ldpc_opencl import decode_on_device

STEPS: Final = 4.0
"""Steps of a quantised soft value in a unit of natural logarithm."""
ROUNDS: Final = 30
"""Rounds over all checks after which a word is given up."""
_PUNCTURED: Final = 2
"""Columns of data that are not sent."""
_Bytes = npt.NDArray[np.uint8]
_Soft = npt.NDArray[np.int8]
_Integers = npt.NDArray[np.int32]


def quantise(soft: npt.ArrayLike, steps: float = STEPS) -> _Soft:
    """Soft values, ln P(1) - ln P(0), in steps, int8; NaN counts as 0, an erasure.

    At a point where one word of rate .88 in a hundred fails, values too small by a third make that
    15, values too large by a third two. At rates below a half, twice too large values fail.
    """
    given = np.ascontiguousarray(soft, np.float32)
    out = np.empty(given.shape, np.int8)
    quantise_values(given.reshape(-1), np.float32(steps), out.reshape(-1))
    return out


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
        encode_words(message, *self.edges, self.lifting, self.data_columns, self.sent_data, words)
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
            shape = self.lifting, self.data_columns
            decode_words(given, *self.schedule, *shape, rounds, data, ok, spent)
        else:
            decode_on_device(device, self, given, rounds, data, ok, spent)
        return data, ok, spent
