"""The faults that a real chip is taken to have, each number with where it is from.

Nothing of it is published for SpikeOne or SpikeTwo. The sizes are those of the one public
calibration of a spike sensor (the simulator SCSim), of a public recording, of a patent and of the
principle's paper; what none of them gives is a round number usual for CMOS. So all are assumed for
the chips here, and each says on what ground.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

__all__ = ["SILICON", "Silicon", "Sized"]


@dataclass(frozen=True)
class Sized:
    """A number, whether it was published for this chip, and where it is from."""

    value: float
    provenance: Literal["published", "assumed"]
    source: str


@dataclass(frozen=True)
class Silicon:
    """row_skew: share of a cycle. comparator_delay, dead_time: seconds. threshold_noise: share of
    the threshold, of each spike. crosstalk: share of its light that a pixel loses. prnu,
    threshold_fpn: relative spreads. dark_current: electrons a second at 25 degC; dsnu: its relative
    spread. hot_pixels, dead_pixels: shares. hot_current: electrons a second."""

    row_skew: Sized
    comparator_delay: Sized
    dead_time: Sized
    threshold_noise: Sized
    crosstalk: Sized
    prnu: Sized
    threshold_fpn: Sized
    dark_current: Sized
    dsnu: Sized
    hot_pixels: Sized
    hot_current: Sized
    dead_pixels: Sized

    def rows(self) -> list[tuple[str, Sized]]:
        """Every number with its name."""
        return [(f.name, getattr(self, f.name)) for f in fields(self)]


_USUAL = "no source for a spike chip: a round number usual for CMOS image sensors"

SILICON = Silicon(
    row_skew=Sized(1.0, "assumed", "EP4340384: rows are sampled one after another in the cycle"),
    comparator_delay=Sized(20e-9, "assumed", _USUAL),
    dead_time=Sized(50e-9, "assumed", "SCSim's reset delay, 0.2 % of a 25 us cycle"),
    threshold_noise=Sized(
        0.0058, "assumed", "SCSim's calibration; fits the interval variances of a recording"
    ),
    crosstalk=Sized(0.01, "assumed", _USUAL),
    prnu=Sized(0.058, "assumed", "SCSim's calibration"),
    threshold_fpn=Sized(0.045, "assumed", "SCSim's calibration (its offset pattern)"),
    dark_current=Sized(100.0, "assumed", "Huang 2022 section 4.4: under 100 e/s in modern CMOS"),
    dsnu=Sized(0.3, "assumed", _USUAL),
    hot_pixels=Sized(1e-4, "assumed", _USUAL),
    hot_current=Sized(1e5, "assumed", _USUAL),
    dead_pixels=Sized(1e-5, "assumed", _USUAL),
)
"""What both chips are given by `sensor.preset = "silicon"`."""
