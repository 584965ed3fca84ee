"""Images from a spike stream at any instant."""

from sensor.reconstruct.intervals import (
    interval_rate,
    isi,
    tau_image,
    tau_levels,
    tfi,
)
from sensor.reconstruct.playback import tfp, tfp_span

METHODS = ("tfp", "tfi", "tau")
"""Names of the methods on the command line."""

__all__ = [
    "METHODS",
    "interval_rate",
    "isi",
    "tau_image",
    "tau_levels",
    "tfi",
    "tfp",
    "tfp_span",
]
