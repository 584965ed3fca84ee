"""Random initial charge: a run starts in the middle of every pixel's first interval.

Without it all pixels of one brightness fire together for ever. The charge is uniform over the
threshold of the interval that the run starts in, which is drawn weighted by its length (see
`ExactModel.initial`): together the stationary law of a pixel under constant light.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.compute.philox import philox4x32
from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from sensor.latched.pixel.fixed_point import Charge

__all__ = ["INITIAL_CHARGE", "initial_deficit"]


def initial_deficit(first: Charge, pixels: npt.NDArray[np.uint32], seed: int) -> Charge:
    """Deficit (threshold - charge - 1, Q24.40) of each pixel before its first cycle.

    first: thresholds of spike 0, (n,) int64. The charge is threshold x word / 2^32, rounded down,
    in integers: it is below the threshold, so the deficit is never negative.
    """
    word = philox4x32((pixels, 0, 0, 0), (seed, INITIAL_CHARGE.stream))[0].astype(np.int64)
    high, low = first >> 32, first & 0xFFFFFFFF
    charge = high * word + ((low * word) >> 32)
    return first - charge - 1


def _bound(scene: Summary) -> Bound:
    # The rate counts stored charge as a fraction of a spike, so its change over a window is the
    # light of the window wherever the charge began.
    return Bound(0.0, "proof")


INITIAL_CHARGE = Effect(
    name="random initial charge",
    source="stationary phase of a renewal process (Cox, Renewal Theory, 1962, section 5.2)",
    stream=Stream.INITIAL_CHARGE,
    define="",  # acts before the first cycle, on the host
    fragment=str,
    bound=_bound,
)
