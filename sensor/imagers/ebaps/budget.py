"""Closed form of a middling pixel of an EBAPS: what each effect adds to mean and variance.

All are linear in photoelectrons and in time, so the share that one has of the whole is greatest at
a corner of any box of light and exposure: that is what makes bounds proofs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sensor.imagers.ebaps.silicon import Silicon
from sensor.imagers.ebaps.tube import Tube

__all__ = ["EMISSION", "QUANTUM", "Budget", "Part"]

QUANTUM = 1 / 12
"""Variance of rounding to whole DN, DN^2."""
EMISSION = "photocathode emission"


@dataclass(frozen=True)
class Part:
    """Electrons in the silicon, and their square; numbers or arrays."""

    mean: Any
    variance: Any


@dataclass(frozen=True)
class Budget:
    """Mean signals and noise of an EBAPS pixel in an exposure.

    Attributes:
        light: photoelectrons of light in an exposure, in flat light.
        seconds: exposure.
    """

    tube: Tube
    silicon: Silicon
    volts: float
    kelvin: float
    light: Any
    seconds: Any

    @property
    def gain(self) -> float:
        """Of an electron that is absorbed."""
        return self.tube.gain(self.volts)

    @property
    def photoelectrons(self) -> Any:
        """With the photocathode's dark emission."""
        t = self.tube
        emission = t.emission_lux * t.electrons_per_lux * self.silicon.area
        return self.light + emission * self.seconds

    @property
    def leaked(self) -> Any:
        """Electrons of light that reaches the silicon by itself."""
        ratio = self.silicon.direct * self.silicon.leakage / self.tube.electrons_per_lux
        return self.light * ratio

    @property
    def dark(self) -> Any:
        """Electrons of dark current."""
        return self.silicon.dark_rate(self.kelvin) * self.seconds

    def tube_mean(self, photoelectrons: Any) -> Any:
        """Electrons in the silicon, bursts of ions with them."""
        t = self.tube
        return photoelectrons * (1 - t.loss) * self.gain * (1 + t.ions * t.burst)

    def _tube_variance(self, photoelectrons: Any, ions: float) -> Any:
        """Each electron that lands brings 1 + X: X sums a Poisson number (mean q) of geometric
        bursts (mean b), so E[(1 + X)^2] = (1 + q b)^2 + q (2 b^2 + b); and each of these has the
        gain's own spread."""
        t, g = self.tube, self.gain
        landed, more = photoelectrons * (1 - t.loss), 1 + ions * t.burst
        square = more**2 + ions * t.burst * (2 * t.burst + 1)
        return landed * (g * g * square + g * t.gain_variance * more)

    def parts(self) -> dict[str, Part]:
        """By the effects' names: what leaving each out takes away."""
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
        """Mean electrons of light and photocathode: what PRNU and stripes scale."""
        return self.tube_mean(self.photoelectrons) + self.leaked

    @property
    def mean(self) -> Any:
        """DN above black."""
        return (self.response + self.dark) * self.silicon.dn_per_electron

    @property
    def tube_variance(self) -> Any:
        """Electrons^2 of what passes the tube."""
        return self._tube_variance(self.photoelectrons, self.tube.ions)

    @property
    def variance(self) -> Any:
        """Temporal, DN^2, with rounding."""
        electrons = self.tube_variance + self.dark + self.leaked + self.silicon.read_noise**2
        return electrons * self.silicon.dn_per_electron**2 + QUANTUM
