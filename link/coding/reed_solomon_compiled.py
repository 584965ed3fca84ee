"""Reed-Solomon words, one after another, compiled. The field is `link.coding.field`.

A word is a polynomial whose first byte is the coefficient of x^254. `table`, (256, parity): row f
is f times the generator's coefficients below the leading one, highest first. `first`: exponent of
the generator's first root; the others follow.

Arrays are copied element by element: numba compiles a slice assignment with all its error messages,
which takes seconds. A counter starts as np.int64(0), since the functions called with it would be
compiled for the constant as well.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from link.coding.field import EXP, LOG, PRODUCT

_N = 255


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
