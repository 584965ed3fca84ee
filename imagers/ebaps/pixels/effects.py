"""The effects of an EBAPS, with costs, and bounds of the error in mean and noise if each is left
out.

`Budget` is the closed form of a pixel without fixed pattern: mean and variance of each effect. All
are linear in photoelectrons and in time. The share of one effect in the sum is therefore
largest at a corner of a box of light and exposure, so the maximum over the corners is a proved
bound.

A bound is the larger of two: the change of the mean over the mean above black (at least 1 DN), and
the change of the noise over the noise (at least 1/sqrt(12) DN). Patterns count with their RMS over
pixels. Means and variances are linear in light and time, so a share is largest at a corner of the
box in the summary. If values clip, or the tail of a pattern matters, the bound is an estimate.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, Final, cast

import numpy as np

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Kind, Summary
from imagers.common.frame_pixel import noise_change, steady_effects
from imagers.ebaps.pixels.silicon import Silicon
from imagers.ebaps.pixels.tube import Spectral, Tube
from sensor.frame_pixels import ImagerSummary

COSTS: Final[dict[str, float]] = {
    "shot noise": 105.0,
    "photocathode emission": 2.0,
    "electron loss": 10.0,
    "gain spread": 100.0,
    "landing spread": 5.0,
    "halo": 30.0,
    "ion events": 90.0,
    "direct light": 4.0,
    "dark current": 2.0,
    "silicon shot noise": 175.0,
    "DSNU": 4.0,
    "offset FPN": 2.0,
    "PRNU": 2.0,
    "stripes": 2.0,
    "read noise": 100.0,
}
QUANTUM = 1 / 12
"""Variance of rounding to whole DN, DN^2."""
EMISSION = "photocathode emission"
_BELOW, _ABOVE = 6.0, 12.0
"""Standard deviations that must stay clear of either end of the scale. Nothing but read noise and
offsets goes below black; ion events make the upper tail a long one."""


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


def _noise(share: Any) -> Any:
    """Relative change of the noise if this share of its variance is removed or added.

    1 - sqrt(1 - a), but at least .53 a: then a sum of such bounds is a bound of the sum as long as
    it stays below 0.1, since 1 - sqrt(1 - A) <= .53 A for A <= .2.
    """
    return np.maximum(noise_change(share), 0.53 * np.asarray(share, np.float64))


def ebaps_effects(base: Budget, full_scale: int, center: float) -> dict[str, Effect]:
    """All effects of a device, by name.

    Args:
        base: its closed form without light.
        full_scale: largest value, DN.
        center: share of the electrons that land on the pixel that they started from.
    """
    tube, silicon = base.tube, base.silicon
    k = silicon.dn_per_electron

    def corners(scene: Summary) -> list[Budget]:
        given = cast(ImagerSummary, scene)
        lights = [np.asarray(x, np.float64) for x in (given.darkest, given.brightest)]
        return [replace(base, light=p, seconds=t) for p, t in product(lights, given.exposure)]

    def free_of_clipping(scene: Summary) -> bool:
        high = max(float(np.max(b.mean + _ABOVE * np.sqrt(b.variance))) for b in corners(scene))
        low = _BELOW * k * math.hypot(silicon.read_noise, silicon.offset_spread)
        top = min(full_scale, silicon.black + k * silicon.well)
        return silicon.black > low and silicon.black + high < top

    def shares(b: Budget, mean: Any, variance: Any) -> Any:
        """Mean and variance that are removed, as shares of the pixel's mean and variance."""
        shift = np.abs(mean) * k / np.maximum(b.mean, 1.0)
        return np.maximum(shift, _noise(variance * k * k / b.variance))

    def part(name: str) -> Callable[[Summary], Bound]:
        def bound(scene: Summary) -> Bound:
            values = [shares(b, p.mean, p.variance) for b in corners(scene)
                      for p in (b.parts()[name],)]  # fmt: skip
            kind: Kind = "proof" if free_of_clipping(scene) else "estimate"
            return Bound(np.maximum.reduce(values), kind)

        return bound

    def pattern(size: Callable[[Budget], tuple[Any, Any]]) -> Callable[[Summary], Bound]:
        def bound(scene: Summary) -> Bound:
            values = [shares(b, *size(b)) for b in corners(scene)]
            return Bound(np.maximum.reduce(values), "estimate")

        return bound

    def response(spread: float) -> Callable[[Budget], tuple[Any, Any]]:
        # A factor 1 + p of the electrons changes their variance by 2 p of it.
        return lambda b: (spread * b.response, 2 * spread * (b.tube_variance + b.leaked))

    def moved(share: float) -> Callable[[Summary], Bound]:
        """Electrons that land on another pixel. The net change of a pixel is at most this share of
        the difference between the brightest and the darkest."""

        def bound(scene: Summary) -> Bound:
            contrast = np.asarray(scene.brightest, float) - np.asarray(scene.darkest, float)
            more = replace(base, light=share * contrast, seconds=0.0)
            values = [
                shares(b, more.tube_mean(more.light), more.tube_variance) for b in corners(scene)
            ]
            kind: Kind = "proof" if free_of_clipping(scene) else "estimate"
            return Bound(np.maximum.reduce(values), kind)

        return bound

    rows: tuple[tuple[str, str, Stream, Callable[[Summary], Bound]], ...] = (
        ("shot noise", "Poisson photoelectrons", Stream.IMAGER_SHOT, part("shot noise")),
        (EMISSION, "EBI 2.5e-7 lx, assumed", Stream.IMAGER_SHOT, part(EMISSION)),
        ("electron loss", "F^2 = 1/(1 - eta_b)", Stream.IMAGER_LOSS, part("electron loss")),
        ("gain spread", "Fano and collection", Stream.IMAGER_GAIN, part("gain spread")),
        ("landing spread", "r = 2 d sqrt(E_t/V)", Stream.IMAGER_SPREAD, moved(1 - center)),
        ("halo", "back scattering within 2 d", Stream.IMAGER_SPREAD, moved(tube.halo)),
        ("ion events", "about 1 in 600 electrons", Stream.IMAGER_IONS, part("ion events")),
        ("direct light", "leakage, assumed", Stream.NONE, part("direct light")),
        ("dark current", "I0 2^((T - T0)/T_d)", Stream.NONE, part("dark current")),
        ("silicon shot noise", "Poisson", Stream.IMAGER_DARK, part("silicon shot noise")),
        ("DSNU", "EMVA 1288", Stream.IMAGER_PATTERN,
         pattern(lambda b: (silicon.dsnu * b.dark, silicon.dsnu * b.dark))),
        ("offset FPN", "EMVA 1288", Stream.IMAGER_PATTERN,
         pattern(lambda b: (silicon.offset_spread, 0.0))),
        ("PRNU", "EMVA 1288", Stream.IMAGER_PATTERN, pattern(response(silicon.prnu))),
        ("stripes", "stripes that dark frames leave: document 002, figure 11",
         Stream.IMAGER_PATTERN, pattern(response(silicon.stripes))),
        ("read noise", "analog chain", Stream.IMAGER_READ, part("read noise")),
    )  # fmt: skip

    bounds = {name: bound for name, _, _, bound in rows}
    return steady_effects(
        {name: (stream, source) for name, source, stream, _ in rows}, COSTS, bounds.__getitem__
    )
