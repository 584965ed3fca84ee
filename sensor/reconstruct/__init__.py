"""Images from a spike stream at any instant."""

from sensor.reconstruct.catalogue import METHODS, reconstruct
from sensor.reconstruct.intervals import (
    interval_rate,
    isi,
    tau_image,
    tau_levels,
    tfi,
)
from sensor.reconstruct.playback import tfp

__all__ = [
    "METHODS",
    "interval_rate",
    "isi",
    "reconstruct",
    "tau_image",
    "tau_levels",
    "tfi",
    "tfp",
]
