"""Word errors of a Reed-Solomon code of bytes, under scattered errors and under bursts."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["burst_byte_error", "burst_word_error", "byte_error", "rs_word_error"]

Array = npt.NDArray[np.float64]


def byte_error(ber: npt.ArrayLike, bits: int = 8) -> Array:
    """Error rate of a byte of independent bits, 1 - (1 - ber)^bits, small ones kept."""
    return np.asarray(-np.expm1(bits * np.log1p(-np.asarray(ber, np.float64))))


def rs_word_error(n: int, k: int, p: npt.ArrayLike) -> Array:
    """Share of codewords of n symbols, k of them data, with more than t = (n - k) // 2 wrong ones,
    each wrong with p on its own: sum over j > t of C(n, j) p^j (1-p)^(n-j), through the incomplete
    beta function, whose tail neither cancels nor stops at 1e-16."""
    from scipy.special import betainc

    if not 0 < k <= n:
        raise ValueError(f"k must be 1 to n, not {k} of {n}")
    t = (n - k) // 2
    return np.asarray(betainc(t + 1, n - t, np.asarray(p, np.float64)))


def burst_byte_error(start: npt.ArrayLike, length: int) -> Array:
    """Share of wrong bytes where a burst of `length` bytes begins at each byte with probability
    `start` on its own: 1 - (1 - start)^length."""
    return byte_error(start, length)


def burst_word_error(n: int, k: int, start: float, length: int, depth: int = 1) -> float:
    """Share of codewords with more than (n - k) // 2 wrong bytes under such bursts.

    depth: codewords that an interleaver spreads over each other (byte i of word w is sent at
    w + i depth). From depth >= length on, no burst meets a word twice and its bytes fail on their
    own, so `rs_word_error` holds; at depth 1 a chain of (bytes that the burst still takes, wrong
    bytes so far) gives the exact share. Between the two there is no form here: ValueError.
    """
    if length < 1 or not 0 <= start <= 1:
        raise ValueError(f"length must be at least 1 and start 0 to 1, not {length}, {start}")
    if depth >= length:
        return float(rs_word_error(n, k, burst_byte_error(start, length)))
    if depth != 1:
        raise ValueError(f"depth must be 1 or at least the length of {length}, not {depth}")
    t = (n - k) // 2
    # law[r, c]: the burst takes r more bytes, c wrong so far, t + 1 standing for all above t.
    law = np.zeros((length + 1, t + 2))
    ages = start * (1 - start) ** np.arange(length)  # bytes since the last start
    law[length - np.arange(length), 0] = ages
    law[0, 0] += (1 - start) ** length
    for _ in range(n):
        # A start sets the rest to `length`, else one byte of the rest passes.
        going = np.zeros_like(law)
        going[: length - 1] = (1 - start) * law[1:length]
        going[0] += (1 - start) * law[0]
        going[length - 1] += (1 - start) * law[length]
        going[length] = start * law.sum(0)
        law = _count(going)
    return float(law[:, t + 1].sum())


def _count(law: Array) -> Array:
    """One more wrong byte wherever a burst has it."""
    out = law.copy()
    out[1:, 1:] = law[1:, :-1]
    out[1:, -1] += law[1:, -1]
    out[1:, 0] = 0.0
    return out
