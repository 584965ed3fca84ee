"""Vibration: the image moves as a damped resonance that noise drives, one shift to each symbol.

x'' + 2 z w x' + w^2 x = noise, along each axis on its own: a stationary Gaussian process. From one
symbol to the next it is exact: the state (x, x' / w) turns by exp(A T) and gains a normal draw with
the covariance that keeps the state's own, diag(s^2, s^2) (e.g. Gillespie, Am. J. Phys. 64:225,
1996, for the method).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream

__all__ = ["DAMPING", "normal_draws", "resonance_step", "vibration"]

Values = npt.NDArray[np.float64]
DAMPING: Final = 0.1
"""Of critical."""


def normal_draws(
    seed: int, stream: Stream, axis: int | npt.NDArray[np.intp], count: int, first: int = 0
) -> Values:
    """(count, 2) standard normal, of counter (axis, 0, n, 0), n from `first` on; (count, axes, 2)
    of several axes."""
    from scipy.special import ndtri

    n = np.arange(first, first + count, dtype=np.uint64)
    axes = np.asarray(axis, np.uint64)
    words = philox4x32((axes, 0, n if axes.ndim == 0 else n[:, None], 0), (seed, int(stream)))
    uniform = (np.stack([words[0], words[1]], axis=-1) + 0.5) / 2.0**32
    return np.asarray(ndtri(uniform), np.float64)


def resonance_step(frequency: float, seconds: float) -> tuple[Values, Values]:
    """(2, 2) turn of the state (x, x' / w) in so long, and the (2, 2) lower root of the covariance
    that is added, of unit variance. frequency: of the undamped resonance, Hz."""
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
    """(symbols, 2) shifts (dx, dy) of the image, camera pixels. deviation: standard, along each
    axis. seconds: of a symbol. seed: below 2^32."""
    out = np.zeros((symbols, 2))
    if deviation <= 0:
        return out
    turn, root = resonance_step(frequency, seconds)
    for axis in range(2):
        draws = normal_draws(seed, Stream.VIBRATION, axis, symbols)
        x, y = draws[0] if symbols else (0.0, 0.0)  # from the stationary law
        pushed = draws @ root.T
        for n in range(symbols):
            if n:
                x, y = (
                    turn[0, 0] * x + turn[0, 1] * y + pushed[n, 0],
                    turn[1, 0] * x + turn[1, 1] * y + pushed[n, 1],
                )
            out[n, axis] = x
    return deviation * out
