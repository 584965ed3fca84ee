"""Shot noise of light: each spike's threshold is a Gamma(Q) draw (see pixel/interval.py)."""

from __future__ import annotations

import math
from importlib.resources import files

import numpy as np
import numpy.typing as npt

from cosim.compute.philox import philox4x32, philox_cl
from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from sensor.latched.effects.costs import noise_cost
from sensor.latched.effects.windows import lost, made, noisy
from sensor.latched.pixel.fixed_point import Charge
from sensor.latched.pixel.interval import threshold

__all__ = ["SHOT_NOISE", "first_thresholds", "thresholds"]


def thresholds(
    table: Charge,
    k: npt.NDArray[np.uint64],
    pixels: npt.NDArray[np.uint32],
    seed: int,
) -> Charge:
    """Threshold of spike k of each pixel, Q24.40: the plain form.

    Word k mod 4 of counter (pixel, high and low word of k div 4, 0), key (seed, SHOT_NOISE).
    """
    block = k >> np.uint64(2)
    high, low = block >> np.uint64(32), block & np.uint64(0xFFFFFFFF)
    words = philox4x32((pixels, high, low, 0), (seed, SHOT_NOISE.stream))
    return threshold(table, np.choose((k & np.uint64(3)).astype(np.intp), words))


def first_thresholds(table: Charge, pixels: npt.NDArray[np.uint32], seed: int) -> Charge:
    """Threshold of spike 0 of each pixel."""
    return thresholds(table, np.zeros(pixels.shape, np.uint64), pixels, seed)


def _bound(scene: Summary) -> Bound:
    # A window's rate has the noise of its intervals, 1/sqrt(Q) each: 1/sqrt(electrons) in all. The
    # noise also makes spikes share a cycle, which the latch counts as one.
    value = noisy(scene, 1 / math.sqrt(scene.threshold))
    return made(scene, value + scene.relative(lost(scene) * scene.threshold), False)


def _fragment() -> str:
    return philox_cl() + (files("sensor.latched.effects") / "shot_noise.cl").read_text()


SHOT_NOISE = Effect(
    name="shot noise",
    source="Huang 2022 section 5.1: intervals are Gamma(Q, rate)",
    stream=Stream.SHOT_NOISE,
    define="SHOT_NOISE",
    fragment=_fragment,
    bound=_bound,
    cost=noise_cost,
    scope="tile",
    group="noise",
)
