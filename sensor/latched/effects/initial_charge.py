"""Random initial charge: a run starts within the first interval of every pixel.

Without it all pixels of equal brightness would fire in phase. The interval in which the run starts
is drawn weighted by its length, and the charge is uniform below its threshold (see
`ExactModel.initial`). This is the stationary distribution of a pixel under constant light.
"""

from __future__ import annotations

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Summary
from sensor.latched.effects.effect import PixelEffect, Setting


class _InitialCharge(PixelEffect):
    name = "random initial charge"
    source = "stationary phase of a renewal process (Cox, Renewal Theory, 1962, section 5.2)"
    inherent = True
    stream = Stream.INITIAL_CHARGE  # drawn on the host, before the first cycle

    def bound(self, setting: Setting, scene: Summary) -> Bound:
        # The rate counts stored charge as a fraction of a spike, so over a window it equals the
        # light of the window, whatever the initial charge.
        return Bound(0.0, "proof")


INITIAL_CHARGE = _InitialCharge()
