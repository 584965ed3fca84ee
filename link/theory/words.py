"""Word error rates of a Reed-Solomon code of bytes, under independent errors and under bursts."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def byte_error(ber: npt.ArrayLike, bits: int = 8) -> Array:
    """Error rate of a byte of independent bits, 1 - (1 - ber)^bits, accurate if small."""
    return np.asarray(-np.expm1(bits * np.log1p(-np.asarray(ber, np.float64))))


def rs_word_error(n: int, k: int, p: npt.ArrayLike) -> Array:
    """Share of codewords with more than t = (n - k) // 2 wrong symbols.

    Symbols are wrong independently: sum over j > t of C(n, j) p^j (1-p)^(n-j), from the incomplete
    beta function, which neither cancels nor underflows at 1e-16.

    Args:
        n, k: symbols and data symbols of a codeword.
        p: probability that a symbol is wrong.
    """
    from scipy.special import betainc

    if not 0 < k <= n:
        raise ValueError(f"k must be 1 to n, not {k} of {n}")
    t = (n - k) // 2
    return np.asarray(betainc(t + 1, n - t, np.asarray(p, np.float64)))


def burst_byte_error(start: npt.ArrayLike, length: int) -> Array:
    """Share of wrong bytes, 1 - (1 - start)^length.

    A burst of `length` bytes begins at each byte independently with probability `start`.
    """
    return byte_error(start, length)


def burst_word_error(n: int, k: int, start: float, length: int, depth: int = 1) -> float:
    """Share of codewords with more than (n - k) // 2 wrong bytes under bursts.

    If depth >= length, no burst reaches a word twice and its bytes fail independently, so
    `rs_word_error` holds. At depth 1 a Markov chain of (bytes left in the burst, wrong bytes so
    far) gives the exact share. There is no closed form between the two: ValueError.

    Args:
        n, k: bytes and data bytes of a codeword.
        start: probability that a burst begins at a byte.
        length: bytes of a burst.
        depth: codewords of an interleaver (byte i of word w is sent at w + i depth).
    """
    if length < 1 or not 0 <= start <= 1:
        raise ValueError(f"length must be at least 1 and start 0 to 1, not {length}, {start}")
    if depth >= length:
        return float(rs_word_error(n, k, burst_byte_error(start, length)))
    if depth != 1:
        raise ValueError(f"depth must be 1 or at least the length of {length}, not {depth}")
    t = (n - k) // 2
    # law[r, c]: r bytes left in the burst, c wrong bytes so far; t + 1 stands for all above t.
    law = np.zeros((length + 1, t + 2))
    ages = start * (1 - start) ** np.arange(length)  # bytes since the last start
    law[length - np.arange(length), 0] = ages
    law[0, 0] += (1 - start) ** length
    for _ in range(n):
        # A start sets the remainder to `length`; otherwise it decreases by one byte.
        going = np.zeros_like(law)
        going[: length - 1] = (1 - start) * law[1:length]
        going[0] += (1 - start) * law[0]
        going[length - 1] += (1 - start) * law[length]
        going[length] = start * law.sum(0)
        law = _count(going)
    return float(law[:, t + 1].sum())


def _count(law: Array) -> Array:
    """Counts one more wrong byte in every state with a burst."""
    out = law.copy()
    out[1:, 1:] = law[1:, :-1]
    out[1:, -1] += law[1:, -1]
    out[1:, 0] = 0.0
    return out
