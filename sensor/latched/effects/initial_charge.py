"""Random initial charge: a run starts in the middle of every pixel's first interval.

Without it all pixels of one brightness fire together for ever. The charge is uniform over the
threshold of the interval that the run starts in, which is drawn weighted by its length (see
`ExactModel.initial`): together the stationary law of a pixel under constant light.
"""

from __future__ import annotations

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Summary
from sensor.latched.effects.effect import PixelEffect, Setting

__all__ = ["INITIAL_CHARGE"]


class _InitialCharge(PixelEffect):
    name = "random initial charge"
    source = "stationary phase of a renewal process (Cox, Renewal Theory, 1962, section 5.2)"
    inherent = True
    stream = Stream.INITIAL_CHARGE  # drawn on the host, before the first cycle

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # The rate counts stored charge as a fraction of a spike, so its change over a window is
        # the light of the window wherever the charge began.
        return Bound(0.0, "proof")


INITIAL_CHARGE = _InitialCharge()
