"""Residual carried: what a spike leaves beyond its threshold starts the next interval."""

import numpy as np

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary

__all__ = ["RESIDUAL"]


def _bound(scene: Summary) -> Bound:
    # A reset to zero forgets up to one cycle's light at each spike, a share of
    # (light of a cycle) / (light of an interval) of the rate, and never more than all of it.
    return Bound(np.minimum(1.0, scene.brightest / scene.threshold), "proof")


RESIDUAL = Effect(
    name="residual carried",
    source="Huang 2022 section 3.2; interval variances of a public recording fit this rule alone",
    stream=Stream.NONE,
    define="",  # the kernel's own rule: it has no fragment to leave out
    fragment=str,
    bound=_bound,
)
