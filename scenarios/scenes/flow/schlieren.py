"""The view through a schlieren bench: from density along sight lines to brightness.

A ray is turned by the gradient of the optical path across it, K d/dx of the integral of density
along it, with the Gladstone-Dale relation n - 1 = K rho (Merzkirch, Flow Visualization, 2nd ed.,
chapter 3). A knife edge in the focus of the second mirror cuts the light source's image in half;
a turned ray moves its image, so that brightness changes in proportion to the angle until all or
nothing passes (Settles, Schlieren and Shadowgraph Techniques, 2001, chapter 3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Plane
from scenarios.scenes.drawing.shapes import noise

__all__ = ["GLADSTONE_DALE", "Bench"]

GLADSTONE_DALE = 2.26e-4
"""K of air for visible light, m3/kg (Merzkirch: 2.264e-4 at 568 nm)."""
RANGE = 3.5e-4
"""Deflection that moves the source's image by half its height, so that all light passes or none,
radians: 0.35 mm at a mirror of 1 m focal length (assumed)."""
OPEN = 0.5
"""Part of the light that passes undeflected: the knife cuts half."""
LEAK = 0.04
"""Part of the light that passes though the image of the source is cut wholly: diffraction at the
knife edge, and scatter (assumed)."""
STRAY = 0.012
"""Light that reaches the picture of an opaque body (assumed)."""
ROUND = 0.955
"""Radius of the round window over the picture's half diagonal (assumed)."""
STREAKS = 0.03
"""Unevenness of lamp and window glass, peak to peak (assumed)."""


@njit(cache=True)
def _slope(path, dark, across, along, out):  # type: ignore[no-untyped-def]
    """across x the change from the pixel before to the next in a row, along x that in a column,
    each the mean over three of them weighted 1, 2, 1 (Sobel's kernel: a blur of about a pixel)."""
    height, width = path.shape
    for i in range(height):
        up, down = max(i - 1, 0), min(i + 1, height - 1)
        for j in range(width):
            here = path[i, j]
            left, right = max(j - 1, 0), min(j + 1, width - 1)
            a = here if dark[i, left] else path[i, left]
            b = here if dark[i, right] else path[i, right]
            c = here if dark[up, j] else path[up, j]
            d = here if dark[down, j] else path[down, j]
            rise, fall = 2.0 * (b - a), 2.0 * (d - c)
            if not (dark[up, left] or dark[up, right] or dark[down, left] or dark[down, right]):
                p, q = path[up, left], path[up, right]
                r, s = path[down, left], path[down, right]
                rise += q - p + s - r
                fall += r - p + s - q
            else:  # beside the body, what its corner hides counts as the row's or column's own
                rise, fall = 2.0 * rise, 2.0 * fall
            out[i, j] = 0.25 * (across * rise + along * fall)


@dataclass(frozen=True, eq=False)
class Bench:
    """A schlieren bench.

    Attributes:
        shape: (height, width) of the picture.
        pixel: its side in the test section, metres.
        knife: angle between the visible gradient and the flow, radians: 0 for a knife edge across
            the flow, pi/2 for one along it.
        body: part of each pixel that the model covers, (H, W).
        lamp: unevenness of the lamp, (H, W).
        dark: pixels outside the window, (H, W).
    """

    shape: tuple[int, int]
    pixel: float
    knife: float
    body: Plane
    lamp: Plane
    dark: npt.NDArray[np.bool_]

    @classmethod
    def build(cls, shape: tuple[int, int], pixel: float, knife: float, body: Plane) -> Bench:
        """Prepares what does not change: the lamp's unevenness and the window's round edge."""
        h, w = shape
        y = (np.arange(h)[:, None] + 0.5 - 0.5 * h) * pixel
        x = (np.arange(w)[None, :] + 0.5 - 0.5 * w) * pixel
        half = 0.5 * math.hypot(h, w) * pixel
        far = np.hypot(x, y)
        lamp = 1.0 - 0.10 * (far / half) ** 2
        lamp = lamp + STREAKS * (noise(x / (0.3 * half), y / (0.12 * half), 31) - 0.5)
        lamp *= np.clip(0.5 - (far - ROUND * half) / (1.5 * pixel), 0.0, 1.0)
        return cls(shape, pixel, knife, body, lamp.astype(np.float32), body > 0.5)

    def deflection(self, path: Plane) -> Plane:
        """Angle across the knife edge by which rays are turned, radians: the mean gradient over two
        pixels; where the body hides a neighbour, over the one that is left. path: (H, W) float32
        density integrated along sight lines, kg/m2."""
        out = np.empty(self.shape, np.float32)
        unit = GLADSTONE_DALE / (2.0 * self.pixel)
        _slope(path, self.dark, unit * math.cos(self.knife), unit * math.sin(self.knife), out)
        return out

    def picture(self, path: Plane) -> Plane:
        """(H, W) float32, 0 to 1: 1 is the bench's lamp without a knife edge. Density that rises
        downstream (knife 0) is dark."""
        passed = np.clip(OPEN - self.deflection(path) * np.float32(0.5 / RANGE), LEAK, 1.0)
        passed *= self.lamp
        passed += self.body * (np.float32(STRAY) - passed)
        return np.clip(passed, 0.0, 1.0, out=passed)
