"""The model of a schlieren bench, from density along sight lines to brightness.

The gradient of the optical path deflects a ray: K d/dx of the integral of density along the ray,
with the Gladstone-Dale relation n - 1 = K rho (Merzkirch, Flow Visualization, 2nd ed., chapter 3).
A knife edge in the focus of the second mirror blocks half of the image of the light source. A
deflection shifts this image, so the brightness is proportional to the angle until all or no light
passes (Settles, Schlieren and Shadowgraph Techniques, 2001, chapter 3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Plane
from scenarios.scenes.drawing.shading import noise

GLADSTONE_DALE = 2.26e-4
"""K of air for visible light, m3/kg (Merzkirch: 2.264e-4 at 568 nm)."""
RANGE = 3.5e-4
"""Deflection that shifts the image of the source by half its height, so that all or no light
passes, rad: 0.35 mm at a mirror of 1 m focal length (assumed)."""
OPEN = 0.5
"""Share of the light that passes without deflection: the knife edge blocks half."""
LEAK = 0.04
"""Share of the light that passes when the knife edge blocks the whole image: diffraction at the
edge, and scatter (assumed)."""
STRAY = 0.012
"""Stray light in the image of an opaque body, lamp = 1 (assumed)."""
ROUND = 0.955
"""Radius of the round window over half the diagonal of the picture (assumed)."""
STREAKS = 0.03
"""Non-uniformity of lamp and window glass, peak to peak (assumed)."""


@njit(cache=True, nogil=True)
def _slope(path, dark, across, along, out):  # type: ignore[no-untyped-def]
    """Fills `out` with the weighted sum of the derivatives along the row (weight `across`) and
    along the column (weight `along`), by the Sobel kernel, which blurs by about a pixel. Pixels of
    the body (`dark`) do not contribute."""
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
            else:  # next to the body, the central row and column count for the hidden ones
                rise, fall = 2.0 * rise, 2.0 * fall
            out[i, j] = 0.25 * (across * rise + along * fall)


@dataclass(frozen=True, eq=False)
class Bench:
    """A schlieren bench.

    Attributes:
        shape: (height, width) of the picture.
        pixel: side of a pixel in the test section, m.
        knife: angle between the visible gradient and the flow, rad: 0 for a knife edge across the
            flow, pi/2 for one along it.
        body: share of each pixel that the model covers, (H, W).
        lamp: brightness of lamp and window, (H, W).
        dark: pixels that the model covers, (H, W) bool.
    """

    shape: tuple[int, int]
    pixel: float
    knife: float
    body: Plane
    lamp: Plane
    dark: npt.NDArray[np.bool_]

    @classmethod
    def build(cls, shape: tuple[int, int], pixel: float, knife: float, body: Plane) -> Bench:
        """Computes the brightness of the lamp, with the round edge of the window."""
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
        """Deflection of rays across the knife edge, rad, (H, W): the mean gradient over two pixels,
        or over one pixel next to the body. `path`: density integrated along sight lines, kg/m2, (H,
        W) float32."""
        out = np.empty(self.shape, np.float32)
        unit = GLADSTONE_DALE / (2.0 * self.pixel)
        _slope(path, self.dark, unit * math.cos(self.knife), unit * math.sin(self.knife), out)
        return out

    def picture(self, path: Plane) -> Plane:
        """Brightness, (H, W) float32 in [0, 1]; 1 is the lamp without a knife edge. A density that
        rises downstream (knife 0) is dark."""
        passed = np.clip(OPEN - self.deflection(path) * np.float32(0.5 / RANGE), LEAK, 1.0)
        passed *= self.lamp
        passed += self.body * (np.float32(STRAY) - passed)
        return np.clip(passed, 0.0, 1.0, out=passed)
