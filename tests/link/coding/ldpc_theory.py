"""What theory says of a code in white noise: its threshold, and the bound of words so long."""

from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtri

from tests.link.coding.ldpc_channel import capacity

_NODE, _WEIGHT = np.polynomial.hermite.hermgauss(100)


@cache
def _table():
    """Spread of normal soft values of mean spread^2 / 2, and their information."""
    spread = np.concatenate([np.linspace(0.01, 12, 2000), [30.0]])
    information = np.array([capacity(2 / s) for s in spread])
    return np.concatenate([[0], spread]), np.maximum.accumulate(np.concatenate([[0], information]))


def _information(spread):
    return np.interp(spread, *_table())


def _spread(information):
    return np.interp(information, *_table()[::-1])


def converges(code, sigma, rounds=1000):
    """Whether the words of a graph without end are decoded in noise of standard deviation sigma,
    by exact belief propagation: extrinsic information along each edge of the base graph (Liva and
    Chiani, "Protograph LDPC codes design based on EXIT analysis", GLOBECOM 2007)."""
    row, column, _ = code.edges
    parity = (code.word_bits - code.sent_data) / code.lifting
    sent = np.clip(parity - np.arange(code.columns - code.data_columns), 0, 1)
    own = np.concatenate([[0, 0], np.ones(code.data_columns - 2), sent]) * capacity(sigma)
    known = _spread(own) ** 2
    to_bits = np.zeros(len(row))
    for _ in range(rounds):
        heard = _spread(to_bits) ** 2
        total = known + np.bincount(column, heard, code.columns)
        if _information(np.sqrt(total[column])).min() > 1 - 1e-6:
            return True
        doubt = _spread(1 - _information(np.sqrt(total[column] - heard))) ** 2
        from_checks = 1 - _information(np.sqrt(np.bincount(row, doubt)[row] - doubt))
        if np.abs(from_checks - to_bits).max() < 1e-9:
            return False
        to_bits = from_checks
    return False


def threshold(code):
    """Largest standard deviation of the noise in which `converges` holds."""
    low, high = 0.2, 3.0
    for _ in range(14):
        middle = (low + high) / 2
        low, high = (middle, high) if converges(code, middle) else (low, middle)
    return low


def best_noise(code, share):
    """Standard deviation of the noise in which the best code of this length and rate loses this
    share of words: the normal approximation (Polyanskiy, Poor and Verdu, IEEE Trans. IT 56:2307,
    2010, equation 296)."""

    def lacking(sigma):
        soft = 2 / sigma**2 + 2 / sigma * np.sqrt(2) * _NODE
        carried = 1 - np.logaddexp(0, -soft) / np.log(2)
        weight = _WEIGHT / np.sqrt(np.pi)
        mean = weight @ carried
        spread = np.sqrt((weight @ carried**2 - mean**2) / code.word_bits)
        length = np.log2(code.word_bits) / (2 * code.word_bits)
        return mean + ndtri(share) * spread + length - code.rate

    return brentq(lacking, 0.2, 3)
