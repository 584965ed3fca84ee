"""Whether this machine has GL, streams with known spikes, and views of any kind."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from display import GL_INSTALL, probe_gl
from display.observe.views import Views

Words = npt.NDArray[np.uint32]


@pytest.fixture(scope="session")
def gl() -> str:
    """The GL renderer's name; without one the test is skipped, here and nowhere else."""
    there, said = probe_gl()
    if not there:
        pytest.skip(f"needs GL through EGL ({GL_INSTALL}): {said}")
    return said


@pytest.fixture(scope="session")
def stream() -> Callable[..., Words]:
    """Words of `cycles` cycles in which each pixel spikes at its rate, evenly."""

    def make(cycles: int, rate: npt.NDArray[np.float64], seed: int = 1) -> Words:
        phase = np.random.default_rng(seed).random(rate.shape)
        words = np.zeros((-(-cycles // 32), *rate.shape), np.uint32)
        for n in range(cycles):
            fired = np.floor(phase + rate * (n + 1)) > np.floor(phase + rate * n)
            words[n // 32] |= fired.astype(np.uint32) << np.uint32(n % 32)
        return words

    return make


@pytest.fixture(scope="session")
def views() -> Callable[..., Views]:
    """Views with random weights; `still` of the images keep still, the others move."""

    def make(
        images: int, spans: int, still: int, seed: int = 1, rows: bool = True, cross: bool = True
    ) -> Views:
        random = np.random.default_rng(seed)

        def some(size: float, moving: bool = False) -> npt.NDArray[np.float64]:
            values = random.normal(size=(images, spans)) * size
            if moving:
                values[:still] = 0
            return values

        weight = random.random((images, spans)) / 20
        return Views(
            weight, some(0.01 * rows), some(5.0 * cross, True), some(9.0, True),
            some(0.3 * (rows and cross), True), some(0.3 * rows, True),
        )  # fmt: skip

    return make
