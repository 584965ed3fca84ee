"""Monte Carlo trials of the closed forms: errors counted in independent trials.

Every function takes a seed and a stream number (below 2^64), which key numpy's Philox generator,
and a number of trials. The trials are independent, so a binomial interval holds: if a channel has
memory, each trial is a separate pixel or codeword.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt
from numba import njit

from link.coding.reed_solomon import WORD_BYTES, ReedSolomon
from link.theory.charge import PixelChannel

Array = npt.NDArray[np.float64]
_CHUNK = 1 << 18
"""Trials computed at once: some megabytes."""


def _generator(seed: int, stream: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=[seed, stream]))


def _chunks(trials: int, size: int = _CHUNK) -> Iterator[int]:
    while trials > 0:
        yield min(trials, size)
        trials -= size


def poisson_trials(
    q: int, mean_on: float, mean_off: float, bits: int, seed: int, stream: int
) -> int:
    """Wrong bits of `bits` random ones, each in a tick of its own: `poisson_threshold`."""
    rng, errors = _generator(seed, stream), 0
    for n in _chunks(bits):
        sent = rng.random(n) < 0.5
        errors += int((sent != (rng.poisson(np.where(sent, mean_on, mean_off)) >= q)).sum())
    return errors


def _ook(
    amplitude: float, bits: int, seed: int, stream: int,
    intensity: Callable[[np.random.Generator, int], Array],
) -> int:  # fmt: skip
    """Wrong bits of a slicer that knows the intensity."""
    rng, errors = _generator(seed, stream), 0
    for n in _chunks(bits):
        sent = rng.random(n) < 0.5
        level = amplitude * intensity(rng, n)
        errors += int((sent != (sent * level + rng.standard_normal(n) > level / 2)).sum())
    return errors


def awgn_trials(amplitude: float, bits: int, seed: int, stream: int) -> int:
    """Wrong bits of `awgn_ook`."""
    return _ook(amplitude, bits, seed, stream, lambda rng, n: np.ones(n))


def log_normal_trials(amplitude: float, sigma: float, bits: int, seed: int, stream: int) -> int:
    """Wrong bits of `log_normal_ook`, with a new intensity for each bit."""
    return _ook(
        amplitude, bits, seed, stream,
        lambda rng, n: np.exp(sigma * rng.standard_normal(n) - sigma**2 / 2),
    )  # fmt: skip


def gamma_gamma_trials(
    amplitude: float, alpha: float, beta: float, bits: int, seed: int, stream: int
) -> int:
    """Wrong bits of `gamma_gamma_ook`, with a new intensity for each bit."""
    return _ook(
        amplitude, bits, seed, stream,
        lambda rng, n: rng.gamma(alpha, 1 / alpha, n) * rng.gamma(beta, 1 / beta, n),
    )  # fmt: skip


@njit(cache=True, nogil=True)
def _last_wrong(sent, draws, start, laws, first, q, rule):  # type: ignore[no-untyped-def]
    """Number of pixels whose last tick is read wrongly.

    Args:
        sent: (ticks + 1, pixels) bits, the first one before the first tick.
        draws: (ticks, pixels) uniform numbers in 0 .. 1.
        start: (pixels,) charge before.
        laws: (2, 2, n) distribution functions of a tick's count minus `first`, by the bit before
            and the bit.
        first: (2, 2) smallest count of each law.
        q: threshold, electrons.
        rule: 0 hard, 1 residual, 2 subtract.
    """
    ticks, pixels = draws.shape
    wrong = 0
    for p in range(pixels):
        v = start[p]
        spike = False
        for k in range(ticks):
            a, b = sent[k, p], sent[k + 1, p]
            law = laws[a, b]
            low, high = 0, law.size - 1
            u = draws[k, p]
            while low < high:
                middle = (low + high) // 2
                if law[middle] > u:
                    high = middle
                else:
                    low = middle + 1
            v += first[a, b] + low
            spike = v >= q
            if spike:
                v = 0 if rule == 0 else v % q if rule == 1 else v - q
        wrong += spike != (sent[ticks, p] == 1)
    return wrong


def charge_trials(channel: PixelChannel, bits: int, seed: int, stream: int, warm: int = 24) -> int:
    """Wrong bits of `charge_errors`, each on a separate pixel.

    The initial charge is uniform over 0 .. q - 1.

    Args:
        channel: the pixel.
        bits: number of trials.
        seed, stream: key of the random numbers.
        warm: random bits before the one that counts; `subtract` needs some hundreds to settle.
    """
    from scipy.stats import poisson

    reset, q, mu_on, mu_off, overlap = channel
    rule = {"hard": 0, "residual": 1, "subtract": 2}[reset]
    rng, errors = _generator(seed, stream), 0
    bit = np.array([mu_off, mu_on])
    means = (1 - overlap) * bit[None, :] + overlap * bit[:, None]
    reach = 8 * np.sqrt(means) + 20
    first = np.maximum(np.floor(means - reach), 0).astype(np.int64)
    span = int(np.ceil(2 * reach.max())) + 2
    laws = poisson.cdf(first[..., None] + np.arange(span), means[..., None])
    for n in _chunks(bits, max(_CHUNK // (warm + 1), 1)):
        sent = rng.integers(0, 2, (warm + 2, n), dtype=np.uint8)
        draws, start = rng.random((warm + 1, n)), rng.integers(0, q, n)
        errors += int(_last_wrong(sent, draws, start, laws, first, q, rule))
    return errors


def rs_word_trials(n: int, k: int, p: float, words: int, seed: int, stream: int) -> int:
    """Random codewords that the decoder does not recover: `rs_word_error`.

    Each byte is wrong independently. Words decoded to another codeword count as well: both happen
    beyond (n - k) // 2 wrong bytes, and never below.

    Args:
        n: 255.
        k: bytes of data.
        p: probability that a byte is wrong.
        words: number of codewords.
        seed, stream: key of the random numbers.
    """
    if n != WORD_BYTES:
        raise ValueError(f"n must be {WORD_BYTES}, not {n}")
    rng, errors, code = _generator(seed, stream), 0, ReedSolomon(n - k)
    for m in _chunks(words, _CHUNK // n):
        data = rng.integers(0, 256, (m, k), dtype=np.uint8)
        wrong = rng.integers(1, 256, (m, n), dtype=np.uint8) * (rng.random((m, n)) < p)
        back, ok, _ = code.decode(code.encode(data) ^ wrong.astype(np.uint8))
        errors += int((~ok | (back != data).any(1)).sum())
    return errors


def burst_word_trials(
    n: int, k: int, start: float, length: int, depth: int, words: int, seed: int, stream: int
) -> int:
    """Codewords with more than (n - k) // 2 wrong bytes under bursts: `burst_word_error`.

    The bytes of `depth` codewords are interleaved. Only every length-th codeword of a block counts
    (without interleaver every second one): no burst reaches two of them, so they are independent.
    The blocks are drawn independently.

    Args:
        n, k: bytes and data bytes of a codeword.
        start: probability that a burst begins at a byte.
        length: bytes of a burst.
        depth: codewords of the interleaver; 1 for none.
        words: number of codewords that count.
        seed, stream: key of the random numbers.
    """
    rng, errors, t = _generator(seed, stream), 0, (n - k) // 2
    apart = 2 if depth == 1 else length
    block = depth if depth > 1 else 128
    while words > 0:
        begins = rng.random(n * block + length - 1) < start
        sums = np.concatenate([[0], np.cumsum(begins)])
        wrong = sums[length:] > sums[:-length]
        order = wrong.reshape(n, block).T if depth > 1 else wrong.reshape(block, n)
        # A burst at the block's end continues in the words at its beginning, one row later.
        last = block - length + 1 if depth > 1 else block
        bad = order[: max(last, 1) : apart].sum(1)[:words] > t
        errors += int(bad.sum())
        words -= bad.size
    return errors
