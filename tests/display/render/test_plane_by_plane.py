"""The yardstick of the benchmark shows what it is said to show."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from cosim import Clock
from display import PlaneByPlane, SpikePanel
from display.render.golden import GoldenRenderer
from display.render.plane_by_plane import KEEP

pytestmark = pytest.mark.usefixtures("gl")
SHAPE = (5, 12)


@pytest.mark.parametrize("drive", ["impulse", "hold", "causal"])
def test_one_plane_a_draw_is_the_exponential_mean_of_the_golden_light(
    drive: str, stream: Callable[..., npt.NDArray[np.uint32]]
) -> None:
    words = stream(96, np.random.default_rng(3).random(SHAPE))
    golden = GoldenRenderer(SpikePanel(SHAPE, Clock.from_hz(40e3), 0.5, drive), 1, 0)  # type: ignore[arg-type]
    golden.step(words, 96, None)
    want = np.zeros(SHAPE)
    for light in golden.light:
        want = light + KEEP * (want - light)
    planes = np.stack([(words[n // 32] >> np.uint32(n % 32)) & np.uint32(1) for n in range(96)])
    plain = PlaneByPlane(drive, SHAPE)  # type: ignore[arg-type]
    seen = plain.show(planes.astype(np.uint8))
    plain.close()
    assert want.max() > 1e-3 and np.abs(seen - want).max() < 1e-6


def test_the_pursuing_one_moves() -> None:
    planes = np.zeros((4, *SHAPE), np.uint8)
    for n in range(4):
        planes[n, :, 3 + n] = 1  # goes with the eye: a line stays a line
    plain = PlaneByPlane("pursuit", SHAPE)
    seen = plain.show(planes, 1.0)
    plain.close()
    assert (seen[:, 3] == seen.max()).all() and np.delete(seen, 3, axis=1).max() < 1e-6
