"""A number that a real chip is taken to have, with where it is from.

Nothing is published of the faults of SpikeOne or SpikeTwo. The sizes of `sensor.preset = "silicon"`
are those of the one public calibration of a spike sensor (the simulator SCSim), of a public
recording, of a patent and of the principle's paper; what none of them gives is a round number usual
for CMOS. So all are assumed for the chips here, and each effect's key says on what ground.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

USUAL: Final = "no source for a spike chip: a round number usual for CMOS image sensors"


@dataclass(frozen=True)
class Sized:
    """A size.

    Attributes:
        value: value in the unit of the key.
        provenance: whether it was published for this chip.
        source: source of the value.
    """

    value: float
    provenance: Literal["published", "assumed"]
    source: str
