"""Low-density parity-check words, encoded, compiled, 64 bits at a time.

Codes are `link.coding.ldpc`.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from cosim.compute.cores import all_cores

_BATCH = 8
"""Words that share memory."""
_U64 = np.uint64


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
    _copy_bits(bits, 0, column, 0, lifting)
    _copy_bits(bits, 0, column, lifting, lifting)


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
        _copy_bits(source, c * lifting, bits[c], 0, lifting)
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
def _encode_batch(data, row, column, shift, lifting, first, sent, words):  # type: ignore[no-untyped-def]
    parity = words.shape[1] * 8 - sent
    padded = np.zeros((first * lifting // 64 + 2) * 8, np.uint8)
    source = padded.view(np.uint64)
    out = np.zeros(words.shape[1] // 8 + 1, np.uint64)
    output = out.view(np.uint8)
    bits = np.zeros((column.max() + 1, lifting // 32 + 2), np.uint64)
    total = np.zeros((lifting + 63) // 64, np.uint64)
    turned = np.zeros((lifting + 63) // 64, np.uint64)
    for w in range(len(data)):
        for i in range(data.shape[1]):
            padded[i] = data[w, i]
        _encode(source, row, column, shift, lifting, first, bits, total, turned)
        for i in range(len(out)):
            out[i] = 0
        _copy_bits(source, 2 * lifting, out, 0, sent)
        for c in range(-(-parity // lifting)):
            size = min(lifting, parity - c * lifting)
            _copy_bits(bits[first + c], 0, out, sent + c * lifting, size)
        for i in range(words.shape[1]):
            words[w, i] = output[i]


@all_cores
@njit(cache=True, parallel=True, nogil=True)
def encode_words(data, row, column, shift, lifting, first, sent, words):  # type: ignore[no-untyped-def]
    """Fills words, (n, word_bits / 8) uint8.

    Args:
        data: (n, data_bits / 8) uint8.
        row, column, shift: edges, int32, sorted by row.
        lifting: Z.
        first: the first parity column.
        sent: bits of data in a word.
    """
    for batch in prange(-(-len(data) // _BATCH)):
        part = slice(batch * _BATCH, (batch + 1) * _BATCH)
        _encode_batch(data[part], row, column, shift, lifting, first, sent, words[part])
