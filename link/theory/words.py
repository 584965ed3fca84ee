"""Word error rates of the link's codes, and the share of words that a mode loses.

Those of a Reed-Solomon code of bytes hold under independent errors and under bursts.

There is no closed form of those of the low-density parity-check codes. Their share of failed words
is taken for the probability that the information of a word's bits, which is normally distributed,
falls short of what the code needs: Q((I - needed) / spread). Both figures of each rate were
measured with `link.coding.ldpc` on signs in white noise (tests/link/theory/test_words.py), on words
of _BITS data bits. Failures of shorter words spread wider, as the root of their length. What
channels of equal information differ in is neglected, as in the mutual information models of link
simulation (Brueninghaus and others, PIMRC 2005).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from link.coding import WORD_BYTES
from link.mode import EVERY_RATE, Mode

Array = npt.NDArray[np.float64]
_BITS: Final = 8448
"""Data bits of the measured words."""
_MEASURED: Final = {
    0.4: (0.4518, 0.0065),
    0.5: (0.5467, 0.0075),
    0.55: (0.5952, 0.0072),
    0.6: (0.6469, 0.0071),
    0.65: (0.6945, 0.0072),
    0.7: (0.7429, 0.0077),
    0.75: (0.7846, 0.0069),
    0.8: (0.8290, 0.0063),
    0.84: (0.8621, 0.0059),
    0.88: (0.9001, 0.0052),
    0.91: (0.9287, 0.0043),
    0.935: (0.9525, 0.0035),
    0.955: (0.9719, 0.0023),
    0.97: (0.9873, 0.0014),
}
"""Rate -> information of a bit at which half of the words fail, and spread of it."""
_NODES, _WEIGHTS = np.polynomial.hermite.hermgauss(100)


def word_loss(mode: Mode, errors: float) -> float:
    """Share of lost words, for independent bits of this error rate.

    With a low-density parity-check code it is an estimate: the bits are taken for signs in white
    noise, whose information follows from their errors. With a rate for each block it is the loss
    at the lowest one.
    """
    errors = min(errors, 0.5)
    if mode.parity is None:
        rate = min(EVERY_RATE) if mode.rate is None else mode.rate
        return ldpc_word_error(rate, sign_information(errors))
    of_a_byte = round(8 * mode.code.symbols / mode.code.bits)
    return float(rs_word_error(WORD_BYTES, WORD_BYTES - mode.parity, byte_error(errors, of_a_byte)))


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


def ldpc_word_error(rate: float, information: npt.ArrayLike, data_bits: int = _BITS) -> float:
    """Share of words that fail.

    Args:
        rate: rate of the code, one of `link.mode.EVERY_RATE`.
        information: information of a bit with its soft value.
        data_bits: data bits of a word.
    """
    from scipy.special import ndtr

    needed, spread = _MEASURED[rate]
    spread *= (_BITS / data_bits) ** 0.5
    return float(ndtr((needed - np.asarray(information, np.float64)) / spread))


def sign_information(errors: float) -> float:
    """Information of a sign in white noise, bits, if its hard decisions err so often: 1 - E[log2(1
    + exp(-L))], L normal with mean 2/s^2 and variance 4/s^2, errors = Q(1/s)."""
    from scipy.special import ndtri

    if errors <= 0:
        return 1.0
    if errors >= 0.5:
        return 0.0
    ratio = -float(ndtri(errors))  # 1/s
    soft = 2 * ratio**2 + 2 * ratio * np.sqrt(2) * _NODES
    return float(1 - _WEIGHTS @ np.logaddexp(0, -soft) / np.log(2) / np.sqrt(np.pi))
