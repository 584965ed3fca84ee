"""Closed form of an EBAPS pixel without fixed pattern: mean and variance of each effect.

All are linear in photoelectrons and in time. The share of one effect in the sum is therefore
largest at a corner of a box of light and exposure, so the maximum over the corners is a proved
bound.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from imagers.ebaps.pixels.silicon import Silicon
from imagers.ebaps.pixels.spectral import Spectral
from imagers.ebaps.pixels.tube import Tube

__all__ = ["EMISSION", "QUANTUM", "Budget", "Part"]

QUANTUM = 1 / 12
"""Variance of rounding to whole DN, DN^2."""
EMISSION = "photocathode emission"


@dataclass(frozen=True)
class Part:
    """Mean (electrons) and variance (electrons^2) of an effect, in the silicon. Any shape."""

    mean: Any
    variance: Any


@dataclass(frozen=True)
class Budget:
    """Mean signals and noise of an EBAPS pixel in an exposure.

    Attributes:
        light: photoelectrons of light in an exposure, in flat light.
        seconds: exposure.
        spectral: electrons of the light over those of a lamp of 2856 K.
    """

    tube: Tube
    silicon: Silicon
    volts: float
    kelvin: float
    light: Any
    seconds: Any
    spectral: Spectral = field(default_factory=Spectral)

    @property
    def gain(self) -> float:
        """Mean electrons in the silicon per absorbed photoelectron."""
        return self.tube.gain(self.volts)

    @property
    def photoelectrons(self) -> Any:
        """Mean photoelectrons, dark emission of the photocathode included."""
        t = self.tube
        emission = t.emission_lux * t.electrons_per_lux * self.silicon.area
        return self.light + emission * self.seconds

    @property
    def leaked(self) -> Any:
        """Electrons of light that passes the photocathode and is absorbed in the silicon."""
        ratio = self.silicon.direct * self.silicon.leakage / self.tube.electrons_per_lux
        return self.light * (ratio * (self.spectral.silicon / self.spectral.photocathode))

    @property
    def dark(self) -> Any:
        """Electrons of dark current."""
        return self.silicon.dark_rate(self.kelvin) * self.seconds

    def tube_mean(self, photoelectrons: Any) -> Any:
        """Mean electrons in the silicon from the tube, ion bursts included."""
        t = self.tube
        return photoelectrons * (1 - t.loss) * self.gain * (1 + t.ions * t.burst)

    def _tube_variance(self, photoelectrons: Any, ions: float) -> Any:
        """Each electron that lands gives 1 + X electrons before the gain. X is a sum of a Poisson
        number (mean q) of geometric bursts (mean b), so E[(1 + X)^2] = (1 + q b)^2 + q (2 b^2 + b).
        The variance of the gain is added for each of them."""
        t, g = self.tube, self.gain
        landed, more = photoelectrons * (1 - t.loss), 1 + ions * t.burst
        square = more**2 + ions * t.burst * (2 * t.burst + 1)
        return landed * (g * g * square + g * t.gain_variance * more)

    def parts(self) -> dict[str, Part]:
        """Mean and variance that vanish if an effect is left out, by the name of the effect."""
        t, g, n = self.tube, self.gain, self.photoelectrons
        landed, more = n * (1 - t.loss), 1 + t.ions * t.burst
        emitted = n - self.light
        whole = self._tube_variance(n, t.ions)
        # What two effects share is in both: leaving out either takes it away.
        out = {
            "shot noise": Part(0.0, (g * more) ** 2 * landed * (1 - t.loss)),
            "electron loss": Part(0.0, (g * more) ** 2 * landed * t.loss),
            "gain spread": Part(0.0, landed * g * t.gain_variance * more),
            "ion events": Part(landed * g * (more - 1), whole - self._tube_variance(n, 0.0)),
            EMISSION: Part(self.tube_mean(emitted), self._tube_variance(emitted, t.ions)),
        }
        out["direct light"] = Part(self.leaked, self.leaked)
        out["dark current"] = Part(self.dark, self.dark)
        out["silicon shot noise"] = Part(0.0, self.dark + self.leaked)
        out["read noise"] = Part(0.0, self.silicon.read_noise**2)
        return out

    @property
    def response(self) -> Any:
        """Mean electrons of light and photocathode, which PRNU and stripes multiply."""
        return self.tube_mean(self.photoelectrons) + self.leaked

    @property
    def mean(self) -> Any:
        """DN above black."""
        return (self.response + self.dark) * self.silicon.dn_per_electron

    @property
    def tube_variance(self) -> Any:
        """Variance of the electrons from the tube, electrons^2."""
        return self._tube_variance(self.photoelectrons, self.tube.ions)

    @property
    def variance(self) -> Any:
        """Temporal variance, DN^2, quantization included."""
        electrons = self.tube_variance + self.dark + self.leaked + self.silicon.read_noise**2
        return electrons * self.silicon.dn_per_electron**2 + QUANTUM
