"""Counter-based random numbers: Philox4x32-10.

Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11. A value depends
only on its key and counter, and not on tiles, device or order. The key is (seed, stream). The
counter is (pixel, tick high, tick low, draw); for a draw per spike, the tick is the index of the
spike.
"""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import wide_cl
from cosim.compute.streams import Stream

_M0, _M1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_W0, _W1 = 0x9E3779B9, 0xBB67AE85
_LOW, _32 = np.uint64(0xFFFFFFFF), np.uint64(32)

_LARGE = 1 << 10
"""Number of counters from which the compiled form is taken, whose library takes long to load."""

U32 = npt.NDArray[np.uint32]


def philox4x32(
    counter: tuple[Any, Any, Any, Any], key: tuple[int, int]
) -> tuple[U32, U32, U32, U32]:
    """Four uint32 words for each counter; counters broadcast against each other.

    Args:
        counter: four arrays or integers below 2^32.
        key: two integers below 2^32.

    Returns:
        Four arrays of the broadcast shape.
    """
    c0, c1, c2, c3 = np.broadcast_arrays(*(np.asarray(c, np.uint64) for c in counter))
    k0, k1 = key
    if c0.size >= _LARGE:
        from cosim.compute.philox_compiled import fill_words

        counters = np.array([c0, c1, c2, c3]).reshape(4, -1)
        out = np.empty(counters.shape, np.uint32)
        fill_words(counters, np.uint64(k0), np.uint64(k1), out)
        w0, w1, w2, w3 = out.reshape(4, *c0.shape)
        return w0, w1, w2, w3
    for _ in range(10):
        p0, p1 = _M0 * c0, _M1 * c2
        c0, c1, c2, c3 = (
            (p1 >> _32) ^ c1 ^ np.uint64(k0),
            p1 & _LOW,
            (p0 >> _32) ^ c3 ^ np.uint64(k1),
            p0 & _LOW,
        )
        k0, k1 = (k0 + _W0) & 0xFFFFFFFF, (k1 + _W1) & 0xFFFFFFFF
    return (
        c0.astype(np.uint32),
        c1.astype(np.uint32),
        c2.astype(np.uint32),
        c3.astype(np.uint32),
    )


def seed_of(seed: int, number: int) -> int:
    """Seed of the temporal noise of a call: that of the camera in call 0, and a word of Philox for
    the others."""
    if number == 0:
        return seed
    low, high = number & 0xFFFFFFFF, number >> 32
    return int(philox4x32((low, high, 0, 0), (seed, Stream.CALL))[0])


def philox_cl() -> str:
    """OpenCL source of `philox16`, sixteen counters at a time."""
    return wide_cl() + (files("cosim.compute") / "philox.cl").read_text(encoding="utf-8")
