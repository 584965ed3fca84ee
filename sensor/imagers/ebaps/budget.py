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
    """light: photoelectrons of light in an exposure, in flat light. seconds: exposure."""

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

    def tube_part(self, photoelectrons: Any) -> dict[str, Part]:
        """What so many photoelectrons bring, effect by effect; "gain" is the mean itself."""
        t, g = self.tube, self.gain
        kept = 1 - t.loss
        landed = photoelectrons * kept
        burst = landed * t.ions * t.burst
        each = g * t.gain_variance
        return {
            "gain": Part(landed * g, 0.0),
            "shot noise": Part(0.0, g * g * photoelectrons * kept**2),
            "electron loss": Part(0.0, g * g * landed * t.loss),
            "gain spread": Part(0.0, each * (landed + burst)),
            # Geometric bursts of mean b: E[k^2] = 2 b^2 + b.
            "ion events": Part(burst * g, g * g * burst * (2 * t.burst + 1) + each * burst),
        }

    def parts(self) -> dict[str, Part]:
        """By the effects' names: what leaving each out takes away. "gain" is what all share."""
        out = self.tube_part(self.photoelectrons)
        emitted = self.tube_part(self.photoelectrons - self.light).values()
        out[EMISSION] = Part(sum(p.mean for p in emitted), _once(self, emitted))
        out["direct light"] = Part(self.leaked, self.leaked)
        out["dark current"] = Part(self.dark, self.dark)
        out["silicon shot noise"] = Part(0.0, self.dark + self.leaked)
        out["read noise"] = Part(0.0, self.silicon.read_noise**2)
        return out

    @property
    def response(self) -> Any:
        """Mean electrons of light and photocathode: what PRNU and stripes scale."""
        tube = self.tube_part(self.photoelectrons).values()
        return sum(p.mean for p in tube) + self.leaked

    @property
    def mean(self) -> Any:
        """DN above black."""
        return (self.response + self.dark) * self.silicon.dn_per_electron

    @property
    def tube_variance(self) -> Any:
        """Electrons^2 that pass the tube; the share of spread in it counts once."""
        return _once(self, self.tube_part(self.photoelectrons).values())

    @property
    def variance(self) -> Any:
        """Temporal, DN^2, with rounding."""
        electrons = self.tube_variance + self.dark + self.leaked + self.silicon.read_noise**2
        return electrons * self.silicon.dn_per_electron**2 + QUANTUM


def _once(budget: Budget, parts: Any) -> Any:
    """Variance of a tube's parts. The spread of the gain of bursts is in "gain spread" and in "ion
    events", since leaving out either takes it away: it counts once."""
    t = budget.tube
    total = sum(p.variance for p in parts)
    bursts = sum(p.mean for p in parts) * t.ions * t.burst / (1 + t.ions * t.burst)
    return total - t.gain_variance * bursts
