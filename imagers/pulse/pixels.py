"""Pixels of pulse modulation: light accumulates to a threshold (document 000, section 2).

Electrons of light and dark current arrive as a Poisson process of mean charge c(t). By time
rescaling the threshold Q is reached where c(t) crosses a Gamma(Q) number, so for light of any
course one draw gives a width (`PwmPixels`), and floor(Poisson(c)/Q) is the exact number of pulses
(`PfmPixels`). The reset noise (kTC) of an interval adds to its threshold.

| | value | dynamic range | relative deviation | |---|---|---|---| | PWM | width in ticks | longest
over shortest width | sqrt(1/Q + (reset/Q)^2), and the tick's | | PFM | pulses n | most pulses in an
exposure | sqrt((1 + reset^2/Q)/(Q n)), and 1/(sqrt(12) n) |
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.draws import gamma, normal
from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from imagers.common.frame_pixel import Conversion, noise_change, steady_effects, summary_of
from sensor.frame_pixels import Exposed, ImagerSummary

_NS: Final = {"shot noise": 80.0, "reset noise": 45.0, "dark current": 3.0}
"""Run-time costs, ns per pixel and frame, on one core at 2.5 GHz."""
_SOURCES: Final = {
    "shot noise": (Stream.IMAGER_SHOT, "Gamma law of widths; Poisson law of electrons"),
    "reset noise": (Stream.IMAGER_RESET, "sqrt(k T C)/q of every reset"),
    "dark current": (Stream.NONE, "adds to the photocurrent"),
}
Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PulsePixels:
    """What both kinds have; see `PixelModel`.

    Attributes:
        shape: (H, W).
        threshold: Q, e.
        exposure: exposure of a frame, s.
        shortest: least time from reset to pulse, s; a pixel that is full sooner waits.
        bits: number of bits of a value.
        reset: kTC noise, e RMS.
        dark: dark current, e/s.
        responsivity: photoelectrons of a lux second.
    """

    shape: tuple[int, int]
    threshold: float
    exposure: float
    shortest: float
    bits: int
    reset: float
    dark: float
    responsivity: float

    @property
    def full(self) -> int:
        """Largest value, DN."""
        return (1 << self.bits) - 1

    def charge(self, rows: Exposed, kept: frozenset[str]) -> Values:
        """Mean charge up to the end of each part of the exposure, (rows, W, parts) e."""
        light = rows.lux_seconds if rows.lux_seconds.ndim == 3 else rows.lux_seconds[..., None]
        charge = light * self.responsivity
        if "dark current" in kept:
            parts = light.shape[-1]
            share = np.arange(1, parts + 1) / parts
            charge = charge + self.dark * rows.seconds[:, None, None] * share
        return charge

    def summary(
        self, lux_seconds: tuple[float, float], seconds: tuple[float, float], frames: int
    ) -> ImagerSummary:
        """See `PixelModel`."""
        light = lux_seconds[0] * self.responsivity, lux_seconds[1] * self.responsivity
        return summary_of(light, seconds, frames, self.threshold)

    @cached_property
    def effects(self) -> dict[str, Effect]:
        """See `PixelModel`."""
        return steady_effects(_SOURCES, _NS, self._bound)

    def parts(self, electrons: float) -> dict[str, float]:
        """Variance of a value by effect at a mean charge of the exposure, DN^2, and "sum" with that
        of counting; "value" is the mean."""
        raise NotImplementedError

    def dimmest(self, low: float, high: float) -> float:
        """The charge between these at which leaving noise out changes most, e."""
        raise NotImplementedError

    def _bound(self, name: str) -> Callable[[Summary], Bound]:
        """Change of the noise, 1 - sqrt(1 - share of the variance); for the dark current that of
        the mean. An estimate, because values are whole numbers."""

        def bound(scene: Summary) -> Bound:
            low, high = float(scene.darkest), float(scene.brightest)
            gathered = self.dark * self.exposure
            worst = 0.0
            for light in (self.dimmest(low, high), high):
                part = self.parts(light + gathered)
                if name == "dark current":
                    worst = max(worst, gathered / max(light + gathered, 1e-9))
                else:
                    worst = max(worst, float(noise_change(part[name], part["sum"])))
            return Bound(worst, "estimate")

        return bound


@dataclass(frozen=True)
class PwmPixels(PulsePixels):
    """Pulse width: value w for a threshold reached within tick w, from 1; `full` for one that was
    not reached. Light of a course is linear in charge between the ends of its parts."""

    @property
    def tick(self) -> float:
        """Seconds of one DN."""
        return self.exposure / max(self.full - 1, 1)

    @property
    def longest(self) -> float:
        """Longest width that is light's, s: the exposure, or the one that dark current fills."""
        return min(self.exposure, self.threshold / self.dark) if self.dark else self.exposure

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """See `PixelModel`."""
        charge, at = self.charge(rows, kept), Conversion.of(rows, seed, kept)
        goal = np.full(at.shape, self.threshold)
        if "shot noise" in kept:
            goal = gamma(goal, at.numbers, rows.frame, seed, Stream.IMAGER_SHOT)
        goal = at.noisy(goal, self.reset, "reset noise", Stream.IMAGER_RESET)
        goal = np.maximum(goal, 0.0)[..., None]
        parts = charge.shape[-1]
        before = (charge < goal).sum(axis=-1, keepdims=True)
        fired = before[..., 0] < parts
        last = np.minimum(before, parts - 1)
        high = np.take_along_axis(charge, last, axis=-1)
        low = np.where(last > 0, np.take_along_axis(charge, np.maximum(last - 1, 0), axis=-1), 0.0)
        share = (goal - low) / np.maximum(high - low, 1e-300)
        width = ((last + np.minimum(share, 1.0)) / parts)[..., 0] * rows.seconds[:, None]
        ticks = np.ceil(np.maximum(width, self.shortest) / self.tick)
        return np.where(fired, np.clip(ticks, 1, self.full - 1), self.full).astype(np.uint16)

    def lux(self, values: npt.ArrayLike) -> Values:
        """Mean illuminance until the threshold, lux: Q over the middle of the tick, less the dark
        current; 0 where the threshold was not reached."""
        ticks = np.asarray(values, np.float64)
        current = self.threshold / ((ticks - 0.5) * self.tick) - self.dark
        return np.where(ticks >= self.full, 0.0, np.maximum(current, 0.0)) / self.responsivity

    def light_range(self, seconds: float) -> tuple[float, float]:
        """Least and most light of an exposure, lx s: threshold in the longest width, and in the
        shortest."""
        charge = self.threshold * seconds / self.responsivity
        return charge / self.longest, charge / max(self.shortest, self.tick)

    def parts(self, electrons: float) -> dict[str, float]:
        width = min(self.threshold / max(electrons, 1e-9) * self.exposure, self.exposure)
        ticks = max(width, self.shortest) / self.tick
        shot, reset = ticks**2 / self.threshold, (ticks * self.reset / self.threshold) ** 2
        return {
            "value": ticks + 0.5, "shot noise": shot, "reset noise": reset,
            "sum": shot + reset + 1 / 12,
        }  # fmt: skip

    def dimmest(self, low: float, high: float) -> float:
        return max(low, min(self.threshold, high))

    def mean_variance(self, lux_seconds: float, seconds: float) -> tuple[float, float]:
        """See `PixelModel`, for light between the two ends of `light_range`."""
        current = lux_seconds * self.responsivity / seconds + self.dark
        part = self.parts(current * self.exposure)
        return part["value"], part["sum"]

    def snr(self, lux_seconds: float, seconds: float) -> float:
        """Light over the deviation of its estimate: T / sigma_T, less the dark current's share."""
        light = lux_seconds * self.responsivity / seconds
        mean, variance = self.mean_variance(lux_seconds, seconds)
        return light / (light + self.dark) * (mean - 0.5) / math.sqrt(variance)


@dataclass(frozen=True)
class PfmPixels(PulsePixels):
    """Pulse frequency: value n for n pulses since the reset at the exposure's begin."""

    @property
    def most(self) -> int:
        """Largest number of pulses: of the counter, or in which the circuit follows."""
        return min(self.full, math.floor(self.exposure / self.shortest * (1 + 1e-12)))

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """See `PixelModel`."""
        course, at = self.charge(rows, kept), Conversion.of(rows, seed, kept)
        charge = np.minimum(course[..., -1], 2.0 * self.threshold * (self.most + 1))
        charge = at.counts(charge, "shot noise", Stream.IMAGER_SHOT)
        if "reset noise" in kept:
            # The thresholds of n intervals add up to n Q with a deviation of sqrt(n) reset.
            resets = np.sqrt(charge / self.threshold)
            drawn = normal(at.numbers, rows.frame, seed, Stream.IMAGER_RESET)
            charge = charge - self.reset * resets * drawn
        return np.clip(np.floor(charge / self.threshold), 0, self.most).astype(np.uint16)

    def lux(self, values: npt.ArrayLike) -> Values:
        """Mean illuminance of the exposure, lux: n + 1/2 thresholds, less the dark current; 0 for
        no pulse."""
        pulses = np.asarray(values, np.float64)
        current = (pulses + 0.5) * self.threshold / self.exposure - self.dark
        return np.where(pulses > 0, np.maximum(current, 0.0), 0.0) / self.responsivity

    def light_range(self, seconds: float) -> tuple[float, float]:
        """Least and most light of an exposure, lx s: one pulse, and the most pulses."""
        pulse = self.threshold / self.responsivity * seconds / self.exposure
        return pulse, pulse * self.most

    def parts(self, electrons: float) -> dict[str, float]:
        pulses = electrons / self.threshold
        shot, reset = pulses / self.threshold, pulses * (self.reset / self.threshold) ** 2
        return {
            "value": pulses - 0.5, "shot noise": shot, "reset noise": reset,
            "sum": shot + reset + 1 / 12,
        }  # fmt: skip

    def dimmest(self, low: float, high: float) -> float:
        return low

    def mean_variance(self, lux_seconds: float, seconds: float) -> tuple[float, float]:
        """See `PixelModel`."""
        part = self.parts(lux_seconds * self.responsivity + self.dark * seconds)
        return part["value"], part["sum"]

    def snr(self, lux_seconds: float, seconds: float) -> float:
        """Light over the deviation of its estimate."""
        _, variance = self.mean_variance(lux_seconds, seconds)
        return lux_seconds * self.responsivity / self.threshold / math.sqrt(variance)
