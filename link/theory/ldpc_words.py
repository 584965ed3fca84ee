"""Word error rates of the link's low-density parity-check codes, against the information of a bit.

There is no closed form of them. Here the share of failed words is taken for the probability that
the information of a word's bits, which is normally distributed, falls short of what the code needs:
Q((I - needed) / spread). Both figures of each rate were measured with `link.coding.ldpc` on signs
in white noise (tests/link/theory/test_ldpc_words.py), on words of _BITS data bits. Failures of
shorter words spread wider, as the root of their length. What channels of equal information differ
in is neglected, as in the mutual information models of link simulation (Brueninghaus and others,
PIMRC 2005).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

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
