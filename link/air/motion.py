"""Vibration: a damped resonance driven by noise shifts the image, one shift for each symbol.

x'' + 2 z w x' + w^2 x = noise, independently along each axis: a stationary Gaussian process. The
step from one symbol to the next is exact: the state (x, x' / w) is multiplied by exp(A T), and a
normal draw is added whose covariance preserves that of the state, diag(s^2, s^2) (for the method
see Gillespie, Am. J. Phys. 64:225, 1996).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream

Values = npt.NDArray[np.float64]
DAMPING: Final = 0.1
"""Ratio to critical damping."""


def normal_draws(
    seed: int, stream: Stream, axis: int | npt.NDArray[np.intp], count: int, first: int = 0
) -> Values:
    """(count, 2) standard normal numbers of counter (axis, 0, n, 0), n from `first` on.

    For several axes the shape is (count, axes, 2).
    """
    from scipy.special import ndtri

    n = np.arange(first, first + count, dtype=np.uint64)
    axes = np.asarray(axis, np.uint64)
    words = philox4x32((axes, 0, n if axes.ndim == 0 else n[:, None], 0), (seed, int(stream)))
    uniform = (np.stack([words[0], words[1]], axis=-1) + 0.5) / 2.0**32
    return np.asarray(ndtri(uniform), np.float64)


def resonance_step(frequency: float, seconds: float) -> tuple[Values, Values]:
    """Step of the state (x, x' / w) over `seconds`.

    Args:
        frequency: undamped resonance, Hz.
        seconds: duration of the step.

    Returns:
        (2, 2) propagator of the state, and the (2, 2) lower Cholesky factor of the added
        covariance, for unit variance.
    """
    w = 2 * math.pi * frequency
    root = math.sqrt(1 - DAMPING**2)
    phase, gone = w * root * seconds, math.exp(-DAMPING * w * seconds)
    c, s = math.cos(phase), math.sin(phase) / root
    turn = gone * np.array([[c + DAMPING * s, s], [-s, c - DAMPING * s]])
    rest = np.eye(2) - turn @ turn.T
    a = math.sqrt(max(rest[0, 0], 0.0))
    b = rest[1, 0] / a if a > 0 else 0.0
    return turn, np.array([[a, 0.0], [b, math.sqrt(max(rest[1, 1] - b * b, 0.0))]])


def vibration(
    deviation: float, frequency: float, seconds: float, symbols: int, seed: int
) -> Values:
    """Shifts (dx, dy) of the image, (symbols, 2), camera pixels.

    Args:
        deviation: standard deviation along each axis, camera pixels.
        frequency: resonance, Hz.
        seconds: duration of a symbol.
        symbols: number of symbols.
        seed: seed below 2^32.
    """
    out = np.zeros((symbols, 2))
    if deviation <= 0:
        return out
    turn, root = resonance_step(frequency, seconds)
    for axis in range(2):
        draws = normal_draws(seed, Stream.VIBRATION, axis, symbols)
        x, y = draws[0] if symbols else (0.0, 0.0)  # the stationary law
        pushed = draws @ root.T
        for n in range(symbols):
            if n:
                x, y = (
                    turn[0, 0] * x + turn[0, 1] * y + pushed[n, 0],
                    turn[1, 0] * x + turn[1, 1] * y + pushed[n, 1],
                )
            out[n, axis] = x
    return deviation * out
