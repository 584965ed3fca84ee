"""Visibility of a chart, by the contrast-to-noise ratio of a bar against Rose's threshold, and
the exposure that an image needs.

An ideal observer who knows a bar's place averages over it: its contrast to noise is

    CNR = |mean_a - mean_b| sqrt(A) / sigma,    sigma^2 = (var_a + var_b)/2

with means and variances of a pixel in the bright and the dark part, and A the number of pixels of
the bar. Rose (J. Opt. Soc. Am. 38:196, 1948) found that a bar below about 5 is not seen. The bars
are those of the USAF 1951 chart: three bars, five times as long as wide, with spaces of their own
width, so a group is a square of five widths. A group that does not fit on the sensor does not
count.

sigma is the noise of one corrected frame: temporal noise, the noise of the dark mean (the variance
    of one frame over the number of frames), and PRNU at the mean. Row stripes are left out, since
    the bright and dark parts of upright bars share their rows. Electrons that land beside a bar
    reduce the contrast at its edges, the halo that of the whole bar. Clipping is left out, so the
    figure holds while the exposure loop keeps its target.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final

from cosim.light.lens import Lens
from imagers.ebaps.pixels.array import EbapsPixels

ROSE: Final = 5.0
"""Contrast to noise below which nothing is seen: Rose, 1948."""
ASPECT: Final = 5
"""Length of a bar over its width: MIL-STD-150A."""


@dataclass(frozen=True)
class Chart:
    """A bar chart: illuminance (lx), two reflectances, the lens, and the width of a bar in pixels.

    The lens is not printed: f/1.4 and T = 0.9 are assumed.
    """

    lux: float
    bright: float = 0.8
    dark: float = 0.2
    width: float = 6.0
    lens: Lens = field(default_factory=lambda: Lens(1.4))

    @property
    def plane(self) -> tuple[float, float]:
        """Lux on the sensor in the bright and the dark part."""
        light = self.lux * self.lens.gain
        return light * self.bright, light * self.dark

    @property
    def area(self) -> float:
        """Number of pixels of a bar."""
        return ASPECT * self.width**2

    @property
    def group(self) -> float:
        """Side of three bars and two spaces, pixels."""
        return 5 * self.width


def _left(pixels: EbapsPixels, chart: Chart) -> float:
    """Share of the contrast that remains in the mean over a bar. Electrons that cross an edge count
    twice: the bar loses them and the space gains them."""
    across = float(sum(k * share for k, share in enumerate(pixels.kernel)))
    edges = 1.0
    for length in (chart.width, ASPECT * chart.width):
        edges *= max(0.0, 1 - 2 * across / length)
    return edges * (1 - pixels.tube.halo)


def contrast_to_noise(pixels: EbapsPixels, chart: Chart, seconds: float, darks: int = 4) -> float:
    """CNR of one bar in one frame of this exposure, after subtraction of the mean of `darks` dark
    frames of the same exposure. With darks = 0 nothing is subtracted, and the offset pattern counts
    as noise."""
    budgets = [pixels.budget(lux * seconds, seconds) for lux in chart.plane]
    none = pixels.budget(0.0, seconds)
    scale = pixels.silicon.dn_per_electron
    noise = sum(float(b.variance) for b in budgets) / 2
    noise += sum((pixels.silicon.prnu * float(b.response) * scale) ** 2 for b in budgets) / 2
    if darks:
        noise += float(none.variance) / darks
    else:
        dark = pixels.silicon.dsnu * float(none.dark)
        noise += (pixels.silicon.offset_spread**2 + dark**2) * scale**2
    step = float(budgets[0].response - budgets[1].response) * scale
    return abs(step) * _left(pixels, chart) * math.sqrt(chart.area / noise)


def recognisable(pixels: EbapsPixels, chart: Chart, seconds: float, darks: int = 4) -> bool:
    """Whether a bar of the chart stands out by Rose's threshold, and its group fits."""
    fits = chart.group <= min(pixels.shape)
    return fits and contrast_to_noise(pixels, chart, seconds, darks) >= ROSE


def smallest_bar(pixels: EbapsPixels, chart: Chart, seconds: float, darks: int = 4) -> float | None:
    """Width in pixels of the smallest visible bar; None if even the largest group that fits on the
    sensor is not visible."""
    low, high = 1.0, min(pixels.shape) / 5
    if not recognisable(pixels, replace(chart, width=high), seconds, darks):
        return None
    if recognisable(pixels, replace(chart, width=low), seconds, darks):
        return low
    while high - low > 1e-6 * high:
        middle = (low + high) / 2
        if recognisable(pixels, replace(chart, width=middle), seconds, darks):
            high = middle
        else:
            low = middle
    return high


def wanted_exposure(pixels: EbapsPixels, lux: float, target: float, zero: float = 0.0) -> float:
    """Exposure, s, at which a pixel without fixed pattern has a mean of `target` DN; lux: on the
    photocathode.

    zero: DN without exposure. It is 0 for a frame from which dark frames of the same exposure were
        subtracted (which also removes the dark current), or the pedestal if one is added.
    """
    # No seconds: the photocathode's own emission is in the darks as well.
    one = pixels.budget(lux, 0.0)
    rate = float(one.response) * pixels.silicon.dn_per_electron
    return (target - zero) / rate if rate > 0 else float("inf")
