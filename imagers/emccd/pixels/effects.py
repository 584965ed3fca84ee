"""The effects of an EMCCD's pixels: costs, and bounds of the error in mean or noise if each is left
out.

Each cost was measured once by leaving the effect out of a whole frame with 12 electrons per pixel
at a gain of 100, on one core at 2.5 GHz, where all effects together take 0.25 s a frame. The fixed
pattern is drawn once and then only applied; overflow is evaluated for each pixel, whether or not it
spills.

With x photoelectrons, smear share s, dark d and clock-induced c, m = x (1 + s) + d + c electrons
reach the register. In electrons at the pixel, the variance of a value is F^2 m + (read/g)^2 +
(step/g)^2 / 12; an effect that is left out removes its own term. Errors of the mean are relative to
the mean above the offset (at least 1 DN); a pattern counts with its RMS over pixels.

1 - sqrt(1 - a) is convex, so the sum of noise bounds is smaller than the change if several effects
are left out together, but never less than half of it. A plan therefore allows the sum only half the
tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Kind, Summary
from imagers.common.frame_pixel import noise_change
from sensor.frame_pixels import ImagerSummary

COSTS: Final = {
    "shot noise": 130.0,
    "PRNU": 5.0,
    "smear": 10.0,
    "dark current": 5.0,
    "dark shot noise": 65.0,
    "DSNU": 5.0,
    "image well overflow": 4.0,
    "clock-induced charge": 65.0,
    "multiplication noise": 330.0,
    "register overflow": 4.0,
    "read noise": 85.0,
}


Values = npt.NDArray[np.float64]


_GAINS: Final = 33
"""Gains examined between a summary's least and largest: at most a factor 1.25 apart."""
_BETWEEN: Final = 1.01
"""Room for a maximum between two of them: excess noise and read noise, which move against each
other, are smooth in the gain's logarithm."""


@dataclass(frozen=True)
class Terms:
    """Parameters of the pixels that the bounds read.

    Attributes:
        excess: F^2 of a mean gain.
        dark: e- / s at a temperature, K.
        smear: s, of all rows' shifts.
        read: e- RMS at the output.
        readout: s in storage.
        step: e- of a DN at the output. Wells in e-.
        shape: (rows, columns).
    """

    excess: Callable[[float], float]
    dark: Callable[[float], float]
    dsnu: float
    prnu: float
    clock_induced: float
    smear: float
    read: float
    readout: float
    step: float
    image_well: float
    register_well: float
    shape: tuple[int, int]


@dataclass(frozen=True)
class _Scene:
    """A summary in electrons at the pixel, at one gain.

    Attributes:
        high: most x.
        least, most: least and largest noise of everything together.
        f2: F^2.
        floor: noise of one DN.
        read: noise power of the amplifier, quiet: with the converter's.
    """

    high: Values
    smear: Values
    dark: float
    least: Values
    most: Values
    gain: float
    f2: float
    floor: float
    read: float
    quiet: float


def _scene(terms: Terms, given: ImagerSummary, gain: float) -> _Scene:
    low, high = (np.asarray(v, np.float64) for v in (given.darkest, given.brightest))
    shortest, longest = given.exposure
    share = terms.smear / shortest if shortest > 0 else 0.0
    dark = terms.dark(given.kelvin) * (longest + terms.readout)
    step = terms.step / gain
    read = (terms.read / gain) ** 2
    return _Scene(
        high=high,
        smear=high * share,
        dark=dark,
        least=low + terms.clock_induced,
        most=high * (1.0 + share) + dark + terms.clock_induced,
        gain=gain,
        f2=terms.excess(gain),
        floor=step,
        read=read,
        quiet=read + step**2 / 12,
    )


def _mean(scene: _Scene, electrons: Any) -> Values:
    """Electrons as a share of the least mean."""
    return np.asarray(electrons, np.float64) / np.maximum(scene.least, scene.floor)


def _tail(mean: Any, variance: Any, well: float) -> Values:
    """Mean charge above a full well, for a gamma distribution of this mean and variance."""
    from scipy.special import gammaincc

    mean = np.maximum(np.asarray(mean, np.float64), 1e-30)
    shape = mean * mean / np.maximum(variance, 1e-30)
    scale = mean / shape
    z = well / scale
    return np.maximum(mean * gammaincc(shape + 1, z) - well * gammaincc(shape, z), 0.0)


def emccd_effects(terms: Terms) -> dict[str, Effect]:
    """All effects by name. Bounds are the largest over the gains of the summary. They are proved
    ("proof") as long as no well overflows; the bound of overflow itself, and all bounds if wells
    overflow, are estimates.
    """
    brightest = 1.0 + 5.0 * terms.prnu

    def calm(scene: _Scene) -> bool:
        """Whether ten standard deviations stay below both wells."""
        top = brightest * scene.most + 10 * np.sqrt(scene.f2 * scene.most + scene.quiet)
        fits = (top < terms.image_well) & (top * scene.gain < terms.register_well)
        return bool(np.all(fits))

    def effect(
        name: str, source: str, stream: Stream, value: Callable[[_Scene], Any], sure: bool = True
    ) -> Effect:
        def bound(summary: Summary) -> Bound:
            given = cast(ImagerSummary, summary)
            low, high = given.gain
            gains = [low] if high == low else np.geomspace(low, high, _GAINS).tolist()
            scenes = [_scene(terms, given, gain) for gain in gains]
            kind: Kind = "proof" if sure and all(calm(s) for s in scenes) else "estimate"
            worst = np.max(np.stack([np.asarray(value(s), np.float64) for s in scenes]), axis=0)
            return Bound(worst * (_BETWEEN if len(gains) > 1 else 1.0), kind)

        return Effect(name, source, stream, bound, lambda _: COSTS[name], group=name)

    def added(electrons: Callable[[_Scene], Any]) -> Callable[[_Scene], Values]:
        """Electrons that are removed: their mean, and their share of the variance."""

        def value(scene: _Scene) -> Values:
            extra = np.asarray(electrons(scene), np.float64)
            noise = noise_change(scene.f2 * extra, scene.f2 * (scene.least + extra) + scene.quiet)
            return np.maximum(_mean(scene, extra), noise)

        return value

    def shot(scene: _Scene) -> Values:
        x = scene.high + scene.smear
        return noise_change(x, scene.f2 * (x + terms.clock_induced) + scene.quiet)

    def dark_shot(scene: _Scene) -> Values:
        d = scene.dark
        return noise_change(d, scene.f2 * (scene.least + d) + scene.quiet)

    def multiplication(scene: _Scene) -> Values:
        return noise_change((scene.f2 - 1) * scene.most, scene.f2 * scene.most + scene.quiet)

    def read(scene: _Scene) -> Values:
        return noise_change(scene.read, scene.f2 * scene.least + scene.quiet)

    def prnu(scene: _Scene) -> Values:
        # Relative to a pixel's own light; smear of the column's other rows has their pattern.
        return terms.prnu * (1.0 + _mean(scene, scene.smear))

    def dsnu(scene: _Scene) -> Values:
        return _mean(scene, scene.dark * terms.dsnu)

    # A place takes what all others spill, but no more than a well.
    def image_over(scene: _Scene) -> Values:
        mean = brightest * scene.most
        over = terms.shape[0] * _tail(mean, scene.most, terms.image_well)
        return _mean(scene, np.minimum(over, terms.image_well))

    def register_over(scene: _Scene) -> Values:
        g = scene.gain
        mean, variance = brightest * g * scene.most, g * g * scene.f2 * scene.most
        over = terms.shape[0] * terms.shape[1] * _tail(mean, variance, terms.register_well)
        return _mean(scene, np.minimum(over, terms.register_well) / g)

    sheet = "E2V CCD97 data sheet"
    rows = (
        effect("shot noise", "Poisson", Stream.IMAGER_SHOT, shot),
        effect("PRNU", "EMVA 1288 release 4.0", Stream.IMAGER_PATTERN, prnu),
        effect(
            "smear", "rows x row shift / exposure", Stream.NONE, added(lambda s: s.smear)
        ),
        effect("dark current", sheet, Stream.NONE, added(lambda s: s.dark)),
        effect("dark shot noise", "Poisson", Stream.IMAGER_DARK, dark_shot),
        effect("DSNU", sheet, Stream.IMAGER_PATTERN, dsnu),
        effect("image well overflow", sheet, Stream.NONE, image_over, sure=False),
        effect(
            "clock-induced charge", "reported .002 to .01 e- a pixel and frame",
            Stream.IMAGER_CLOCKS, added(lambda _: terms.clock_induced),
        ),
        effect(
            "multiplication noise", "Robbins and Hadwen 2003", Stream.IMAGER_GAIN, multiplication
        ),
        effect(
            "register overflow", "document 003, figure 4c", Stream.NONE, register_over, sure=False
        ),
        effect("read noise", sheet, Stream.IMAGER_READ, read),
    )  # fmt: skip
    return {e.name: e for e in rows}
