"""Random streams and damaged files."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import strategies as st

from cosim import Clock, Viform

CLOCK = Clock(40_000)


@pytest.fixture(scope="session")
def random_stream() -> Callable[..., Viform]:
    """A stream of random spikes; all arguments are optional."""

    def make(
        cycles: int = 75,
        shape: tuple[int, int] = (3, 8),
        seed: int = 1,
        clock: Clock = CLOCK,
        start: int = 0,
    ) -> Viform:
        planes = np.random.default_rng(seed).random((cycles, *shape)) < 0.4
        return Viform(Viform.from_planes(planes, clock).words, cycles, clock, start)

    return make


@pytest.fixture(scope="session")
def damage() -> Callable[[st.DataObject, bytes], bytes]:
    """Damages bytes at a place that hypothesis draws: one bit, a few bytes, or the rest of them."""

    def apply(data: st.DataObject, content: bytes) -> bytes:
        place = data.draw(st.integers(0, len(content) - 1), "place")
        how = data.draw(st.sampled_from(["flip", "put", "cut", "insert"]), "how")
        if how == "flip":
            put = bytes([content[place] ^ (1 << data.draw(st.integers(0, 7), "bit"))])
        elif how == "cut":
            return content[:place]
        else:
            put = data.draw(st.binary(min_size=1, max_size=8), "bytes")
        rest = content[place:] if how == "insert" else content[place + len(put) :]
        return content[:place] + put + rest

    return apply
