"""Reed-Solomon codes of 255 bytes after CCSDS 131.0-B, with errors and erasures.

The generator has the roots alpha^(11 j), j from 128 - parity / 2 (112 for the standard's parity of
32). The field of 256 elements has the polynomial x^8 + x^7 + x^2 + x + 1 (0x187), alpha = 2.
Elements are written as powers of alpha^11, which the standard's generator is built from; it is
primitive, because 11 and 255 have no common factor. Bytes are in the conventional basis, not in
Berlekamp's dual basis.

A word is a polynomial whose first byte is the coefficient of x^254. In the compiled functions,
`table` is (256, parity): row f is f times the generator's coefficients below the leading one,
highest first. `first` is the exponent of the generator's first root; the others follow.

The code is compiled here, not taken from a library. galois 0.4.11 takes 4 s to import, 13 s to
build, and 11 s for its first encode and decode in each process (nothing of it is cached), and
decodes 0.65 Mbit/s with 8 errors in a word (37 for clean words). reedsolo 1.7.0 ships as pure
Python: 0.24 Mbit/s to encode and 0.08 to decode the same. This one, on the same core with parity
32, starts in 1 s once compiled (8 s the first time), encodes 850 Mbit/s, and decodes 900 for clean
words, 150 with 8 errors in a word, 85 with 16. The tests compare it with galois.

Arrays are copied element by element: numba compiles a slice assignment with all its error messages,
which takes seconds. A counter starts as np.int64(0), since the functions called with it would be
compiled for the constant as well.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

_Bytes = npt.NDArray[np.uint8]
_POLYNOMIAL: Final = 0x187
_STEP: Final = 11
LOG: Final = np.zeros(256, np.int32)
"""(256,) int32: logarithms to the base alpha^11; the entry of 0 is undefined."""
WORD_BYTES: Final = 255
"""Bytes of a codeword."""
_N = WORD_BYTES


def _powers() -> npt.NDArray[np.uint8]:
    alpha = [1]
    for _ in range(254):
        twice = alpha[-1] << 1
        alpha.append(twice ^ _POLYNOMIAL if twice > 255 else twice)
    # Two periods, so that the sum of two logarithms is a valid index.
    return np.array([alpha[_STEP * i % 255] for i in range(510)], np.uint8)


EXP: Final = _powers()
"""(510,) uint8: powers of alpha^11."""

LOG[EXP[:255]] = np.arange(255)

PRODUCT: Final = np.where(
    (np.arange(256)[:, None] > 0) & (np.arange(256) > 0), EXP[LOG[:, None] + LOG], 0
).astype(np.uint8)
"""(256, 256) uint8: products."""


@njit(cache=True, nogil=True)
def _remainder(word, table, out):  # type: ignore[no-untyped-def]
    """Writes the remainder of the division by the generator to the last `parity` bytes of out,
    (255,)."""
    parity = table.shape[1]
    for i in range(_N):
        out[i] = word[i]
    for i in range(_N - parity):
        factor = out[i]
        if factor:
            for j in range(parity):
                out[i + 1 + j] ^= table[factor, j]


@njit(cache=True, nogil=True)
def encode_words(data, table, words):  # type: ignore[no-untyped-def]
    """Fills words, (n, 255) uint8, with data, (n, 255 - parity) uint8, and parity."""
    parity = table.shape[1]
    work = np.zeros(_N, np.uint8)
    padded = np.zeros(_N, np.uint8)
    for w in range(len(data)):
        for i in range(_N - parity):
            padded[i] = data[w, i]
        _remainder(padded, table, work)
        for i in range(_N):
            words[w, i] = padded[i] if i < _N - parity else work[i]


@njit(cache=True, nogil=True)
def _syndromes(rest, first, syndromes):  # type: ignore[no-untyped-def]
    """Evaluates the remainder, (parity,) highest first, at the generator's roots."""
    parity = len(rest)
    for j in range(parity):
        row = PRODUCT[EXP[(first + j) % _N]]
        value = np.uint8(0)
        for i in range(parity):
            value = row[value] ^ rest[i]
        syndromes[j] = value


@njit(cache=True, nogil=True)
def _locator(syndromes, erased, count, locator, other, spare):  # type: ignore[no-untyped-def]
    """Fills the error locator and returns its length, errors and erasures.

    Berlekamp-Massey algorithm, started from the erasures' locator (Blahut 2003, section 7.4).
    erased: exponents of the erased places.
    """
    parity = len(syndromes)
    for i in range(parity + 1):
        locator[i] = 1 if i == 0 else 0
    for n in range(count):
        row = PRODUCT[EXP[erased[n]]]
        for i in range(n + 1, 0, -1):
            locator[i] ^= row[locator[i - 1]]
    for i in range(parity + 1):
        other[i] = locator[i]
    length = count
    for r in range(count + 1, parity + 1):
        discrepancy = np.uint8(0)
        for i in range(min(length, r - 1) + 1):
            discrepancy ^= PRODUCT[locator[i], syndromes[r - 1 - i]]
        for i in range(r, 0, -1):  # neither degree is above r yet
            other[i] = other[i - 1]
        other[0] = 0
        if discrepancy == 0:
            continue
        row = PRODUCT[discrepancy]
        if 2 * length <= r + count - 1:
            for i in range(parity + 1):
                spare[i] = locator[i]
            inverse = PRODUCT[EXP[_N - LOG[discrepancy]]]
            for i in range(r + 1):
                locator[i] ^= row[other[i]]
                other[i] = inverse[spare[i]]
            length = r + count - length
        else:
            for i in range(r + 1):
                locator[i] ^= row[other[i]]
    return length


@njit(cache=True, nogil=True)
def _search(locator, length, steps, terms, places):  # type: ignore[no-untyped-def]
    """Chien search: fills the exponents of the places whose inverse is a root, and returns their
    number.

    Returns -1 if there are not `length` of them.
    """
    for i in range(length + 1):
        terms[i] = locator[i]
        steps[i] = EXP[(_N - i) % _N]
    roots = 0
    for place in range(_N):
        value = terms[0]
        for i in range(1, length + 1):
            value ^= terms[i]
            terms[i] = PRODUCT[steps[i], terms[i]]
        if value == 0:
            if roots == length:
                return -1
            places[roots] = place
            roots += 1
    return roots if roots == length else -1


@njit(cache=True, nogil=True)
def _correct(word, syndromes, locator, places, roots, first, evaluator):  # type: ignore[no-untyped-def]
    """Adds Forney's error values to the word and returns the number of changed bytes.

    Returns -1 if the locator has a double root.
    """
    for i in range(roots):
        value = np.uint8(0)
        for j in range(i + 1):
            value ^= PRODUCT[syndromes[j], locator[i - j]]
        evaluator[i] = value
    changed = 0
    for n in range(roots):
        place = places[n]
        inverse = PRODUCT[EXP[(_N - place) % _N]]
        square = PRODUCT[EXP[(2 * (_N - place)) % _N]]
        top = np.uint8(0)
        for i in range(roots - 1, -1, -1):
            top = inverse[top] ^ evaluator[i]
        below = np.uint8(0)  # the derivative: odd coefficients, in the square
        for i in range(roots - 1 if roots % 2 == 0 else roots, 0, -2):
            below = square[below] ^ locator[i]
        if below == 0:
            return -1
        if top:
            exponent = LOG[top] + _N - LOG[below] + place * (_N + 1 - first)
            word[_N - 1 - place] ^= EXP[exponent % _N]
            changed += 1
    return changed


@njit(cache=True, nogil=True)
def repair_words(words, erasures, table, first, ok, corrected):  # type: ignore[no-untyped-def]
    """Corrects words, (n, 255) uint8, in place where ok.

    Args:
        erasures: (n, 255) bool.
        table, first: the generator.
        ok: (n,) bool, filled.
        corrected: (n,) int64, filled with the number of changed bytes.
    """
    parity = table.shape[1]
    work, fixed = np.empty(_N, np.uint8), np.empty(_N, np.uint8)
    syndromes = np.empty(parity, np.uint8)
    locator, other = np.empty(parity + 1, np.uint8), np.empty(parity + 1, np.uint8)
    spare, steps = np.empty(parity + 1, np.uint8), np.empty(parity + 1, np.uint8)
    evaluator = np.empty(parity + 1, np.uint8)
    erased, places = np.empty(_N, np.int64), np.empty(_N, np.int64)
    for w in range(len(words)):
        corrected[w] = 0
        _remainder(words[w], table, work)
        clean = True
        for i in range(_N - parity, _N):
            clean = clean and work[i] == 0
        ok[w] = clean
        if clean:
            continue
        count = np.int64(0)
        for i in range(_N):
            if erasures[w, i]:
                erased[count] = _N - 1 - i
                count += 1
        if count > parity:
            continue
        _syndromes(work[_N - parity :], first, syndromes)
        length = _locator(syndromes, erased, count, locator, other, spare)
        if 2 * length - count > parity:  # 2 e + x, with e = length - x
            continue
        roots = _search(locator, length, steps, spare, places)
        if roots < 0:
            continue
        for i in range(_N):
            fixed[i] = words[w, i]
        changed = _correct(fixed, syndromes, locator, places, roots, first, evaluator)
        if changed < 0:
            continue
        _remainder(fixed, table, work)
        clean = True
        for i in range(_N - parity, _N):
            clean = clean and work[i] == 0
        if clean:
            for i in range(_N):
                words[w, i] = fixed[i]
            ok[w] = True
            corrected[w] = changed


@lru_cache
def _table(parity: int) -> _Bytes:
    """Multiples of the generator's coefficients below the leading one, (256, parity)."""
    generator = np.array([1], np.uint8)
    for j in range(parity):
        longer = np.append(generator, np.uint8(0))
        longer[1:] ^= PRODUCT[EXP[(128 - parity // 2 + j) % 255]][generator]
        generator = longer
    return np.ascontiguousarray(PRODUCT[:, generator[1:]])


class ReedSolomon:
    """A code with `parity` bytes of 255, even, 2 to 254.

    It corrects e wrong bytes and x erased ones if 2 e + x <= parity. Beyond that it reports a
    failure or finds another codeword: about one in t! random words is taken for a codeword, t =
    (parity - x) / 2 (McEliece & Swanson 1986), so the result of many erasures needs a check of its
    own.

    Attributes:
        parity, data_bytes: bytes of a codeword.
    """

    def __init__(self, parity: int) -> None:
        if parity % 2 or not 2 <= parity <= 254:
            raise ValueError(f"parity must be even, 2 to 254, not {parity}")
        self.parity, self.data_bytes = parity, WORD_BYTES - parity
        self._table, self._first = _table(parity), 128 - parity // 2

    def encode(self, data: npt.ArrayLike) -> _Bytes:
        """Codewords (words, 255) uint8, data then parity, of data (words, 255 - parity)."""
        message = np.ascontiguousarray(data, np.uint8)
        if message.ndim != 2 or message.shape[1] != self.data_bytes:
            raise ValueError(f"data must be (words, {self.data_bytes}), not {message.shape}")
        words = np.empty((len(message), WORD_BYTES), np.uint8)
        encode_words(message, self._table, words)
        return words

    def repair(
        self, words: npt.ArrayLike, erasures: npt.NDArray[np.bool_] | None = None
    ) -> tuple[_Bytes, npt.NDArray[np.bool_], npt.NDArray[np.int64]]:
        """Corrects codewords.

        Args:
            words: (words, 255) uint8.
            erasures: (words, 255) bool, bytes known to be unreliable; None for none.

        Returns:
            The corrected words, unchanged where there is no codeword; ok, (words,) bool; and the
            number of corrected bytes, (words,) int64.
        """
        fixed = np.array(words, np.uint8, order="C")
        if fixed.ndim != 2 or fixed.shape[1] != WORD_BYTES:
            raise ValueError(f"words must be (words, {WORD_BYTES}), not {fixed.shape}")
        if erasures is None:
            erasures = np.zeros(fixed.shape, np.bool_)
        erased = np.ascontiguousarray(erasures, np.bool_)
        if erased.shape != fixed.shape:
            raise ValueError(f"erasures must be {fixed.shape}, not {erased.shape}")
        ok, corrected = np.empty(len(fixed), np.bool_), np.empty(len(fixed), np.int64)
        repair_words(fixed, erased, self._table, self._first, ok, corrected)
        return fixed, ok, corrected

    def decode(
        self, words: npt.ArrayLike, erasures: npt.NDArray[np.bool_] | None = None
    ) -> tuple[_Bytes, npt.NDArray[np.bool_], npt.NDArray[np.int64]]:
        """Corrects codewords as `repair` does and returns their data, (words, 255 - parity)."""
        fixed, ok, corrected = self.repair(words, erasures)
        return fixed[:, : self.data_bytes], ok, corrected
