"""High dynamic range on a panel: tone mapping as a stage between values and planes, and what an eye
sees of a scene's range.

A panel has a peak: the luminance of a pixel that fires in every cycle. A scene whose white stands
for more needs a law that maps light x, white = 1, to a share v of the peak:

| law | v |
|---|---|
| clip | min(x w / p, 1), with the luminance w of white and p of the peak |
| log | log(1 + m x) / log(1 + m), m = 10^decades |
| reinhard | s (1 + s / m^2) / (1 + s), s = m x |

The last is equation 4 of Reinhard, Stark, Shirley and Ferwerda (ACM Trans. Graph. 21:267, 2002),
with white as the smallest light that is shown at the peak. The last two show light above white as
white. An eye that has adapted to the luminance a sees a disc whose luminance is above that around
it by the threshold of Ferwerda, Pattanaik, Shirley and Greenberg (SIGGRAPH 96, p. 249), the lower
of that of cones and of rods: fits to measured thresholds of large spots. It is taken to adapt to
the mean of the panel; glare, and adaptation from place to place, are not modelled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from cosim.config.amounts import number

Values = npt.NDArray[np.float64]
LAWS: Final = ("none", "clip", "log", "reinhard")
Law = Literal["none", "clip", "log", "reinhard"]


@dataclass(frozen=True)
class Tone:
    """A law of tone mapping on a panel.

    Attributes:
        law: one of `LAWS` but "none".
        luminance: luminance of the scene's white with the law "clip", cd/m2.
        peak: luminance of a pixel that fires in every cycle, cd/m2.
        decades: decades of light below white that the laws "log" and "reinhard" compress.
    """

    law: Law
    luminance: float
    peak: float
    decades: float

    def share(self, light: npt.ArrayLike) -> Values:
        """Share of the peak, 0 to 1, (...), of light, white = 1."""
        x, m = np.asarray(light, np.float64), 10.0**self.decades
        if self.law == "clip":
            return np.clip(x * (self.luminance / self.peak), 0.0, 1.0)
        x = np.clip(x, 0.0, 1.0)
        if self.law == "log":
            return np.asarray(np.log1p(m * x) / math.log1p(m))
        s = m * x
        return np.asarray(s * (1 + s / m**2) / (1 + s))

    def light(self, share: float) -> float:
        """The least light, white = 1, that is shown at a share of the peak, 0 to 1."""
        m = 10.0**self.decades
        if self.law == "clip":
            return share * self.peak / self.luminance
        if self.law == "log":
            return math.expm1(share * math.log1p(m)) / m
        # s^2 / m^2 + s (1 - v) = v, in the form that keeps small shares exact.
        linear = 1 - share
        return 2 * share / (linear + math.sqrt(linear**2 + 4 * share / m**2)) / m

    @property
    def white(self) -> float:
        """Share of the peak at which white is shown."""
        return float(self.share(1.0))

    @property
    def brightest(self) -> float:
        """The least light, white = 1, that is shown at the peak; at most white."""
        return min(self.light(1.0), 1.0) if self.law == "clip" else 1.0

    def told(self, white_rate: float) -> str:
        """What the law does to white, in words. white_rate: spikes a cycle of the camera's
        white."""
        packets = white_rate / self.white
        return (
            f"tone mapping by the law {self.law}: at white a spike of the panel stands for "
            f"{number(packets)} of the camera's, and is shown at {number(self.white * self.peak)} "
            f"of {number(self.peak)} cd/m2"
        )


def visible_difference(adapted: float) -> float:
    """Threshold of an eye, cd/m2, that has adapted to a luminance, cd/m2 (Ferwerda et al. 1996,
    section 4.1)."""
    at = math.log10(max(adapted, 1e-12))
    if at <= -2.6:
        cones = -0.72
    elif at < 1.9:
        cones = (0.249 * at + 0.65) ** 2.7 - 0.72
    else:
        cones = at - 1.255
    if at <= -3.94:
        rods = -2.86
    elif at < -1.44:
        rods = (0.405 * at + 1.6) ** 2.18 - 2.86
    else:
        rods = at - 0.395
    return 10.0 ** min(cones, rods)


@dataclass(frozen=True)
class SeenRange:
    """What an eye sees of discs of known light on a panel, in decades of their light.

    Attributes:
        scene: range of the discs.
        clipped: range at the bright end that is shown at the peak.
        eye: range at the dim end that the law shows below the threshold of the eye.
        camera: range above that end of which the planes show too little: the camera has not seen
            it, or not in time.
        threshold: threshold of the eye, cd/m2.
        adapted: luminance to which it has adapted, cd/m2.
    """

    scene: float
    clipped: float
    eye: float
    camera: float
    threshold: float
    adapted: float

    @property
    def seen(self) -> float:
        """Range that the eye sees."""
        return max(self.scene - self.clipped - self.eye - self.camera, 0.0)

    @property
    def told(self) -> str:
        """The range in words."""
        return (
            f"an eye that has adapted to {number(self.adapted)} cd/m2 sees {self.seen:.2f} of the "
            f"scene's {self.scene:.2f} decades: {self.clipped:.2f} are shown at the peak, "
            f"{self.eye:.2f} below its threshold of {number(self.threshold)} cd/m2, and "
            f"{self.camera:.2f} are missing in the planes"
        )


def closed_form(tone: Tone, most: float, least: float, adapted: float) -> tuple[float, float]:
    """Decades at the bright end of a scene that a panel shows at its peak, and at the dim end that
    it shows below the threshold of an eye, by the law alone.

    Args:
        tone: law of the panel.
        most, least: brightest and dimmest light of the scene, white = 1.
        adapted: luminance to which the eye has adapted, cd/m2.
    """
    share = visible_difference(adapted) / tone.peak
    end = tone.light(share) if share < 1 else most
    dim = math.log10(min(max(end, least), most) / least)
    return max(math.log10(most / tone.brightest), 0.0), dim


def seen_range(
    tone: Tone, light: Values, shown: Values, around: float, adapted: float
) -> SeenRange:  # fmt: skip
    """The range that an eye sees of discs on a panel.

    The end of the range lies where a disc would have the threshold of the eye over what is around
    it. Between two discs it is interpolated in the light that the law shows as their luminance.

    Args:
        tone: law of the panel.
        light: (n,) light of the discs, white = 1, the brightest first.
        shown: (n,) luminance of each on the panel, cd/m2.
        around: luminance between them, cd/m2.
        adapted: mean luminance of the panel, cd/m2.
    """
    scene, threshold = math.log10(light[0] / light[-1]), visible_difference(adapted)
    top, dim = closed_form(tone, float(light[0]), float(light[-1]), adapted)
    over = shown - around
    below = np.flatnonzero(over < threshold)
    hidden = 0.0
    if below.size and below[0] == 0:
        hidden = scene
    elif below.size:
        n = int(below[0])
        wanted, before, after = (
            tone.light(min(max(float(each), 0.0) / tone.peak, 1.0))
            for each in (threshold, over[n - 1], over[n])
        )
        part = 0.0  # of a disc that is not shown at all nothing is known but that
        if after > 0:
            part = math.log(before / wanted) / math.log(before / after)
        edge = math.log10(light[n - 1]) - part * math.log10(light[n - 1] / light[n])
        hidden = edge - math.log10(light[-1])
    eye = min(hidden, dim)
    return SeenRange(scene, top, eye, hidden - eye, threshold, adapted)
