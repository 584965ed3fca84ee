"""The schlieren image of a tunnel during its start: density along sight lines, of the waves as
planes and the gas between, and the model of a schlieren bench, from this density to brightness.

Lengths are in metres; x points downstream, y from the axis. "Density along a sight line" is the
integral of the density, kg/m2.

The gradient of the optical path deflects a ray: K d/dx of the integral of density along the ray,
with the Gladstone-Dale relation n - 1 = K rho (Merzkirch, Flow Visualization, 2nd ed., chapter 3).
A knife edge in the focus of the second mirror blocks half of the image of the light source. A
deflection shifts this image, so the brightness is proportional to the angle until all or no light
passes (Settles, Schlieren and Shadowgraph Techniques, 2001, chapter 3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import Plane
from scenarios.scenes.drawing.shading import noise
from scenarios.scenes.flow.steadyflow import Sphere, Wedge

WIDTH = 0.12
"""Length of a sight line through the flow, m: the width of the nozzle exit and the span of a
wedge."""
ROUGH = 0.02
"""Relative density of eddies, peak to peak (assumed)."""
SWELLS = tuple(1.0 + 0.02 * m + 0.0114 * m * m for m in range(14))
"""Standoffs over the steady standoff for which the flow of a sphere is computed."""
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


# A compiled kernel has separate arguments: unpacking a record of arrays would cost time in each
# call.
@njit(cache=True, nogil=True)
def mix(out, steady, swirl, grain, x, y, ripple, pixel, xs, xc, xp, gas, ring):  # type: ignore[no-untyped-def]
    """Fills `out` with the density along sight lines, kg/m2: the steady flow up to the starting
    shock at xs, cold gas up to the contact at xc, hot gas up to the primary shock at xp, gas at
    rest beyond. A discontinuity is antialiased over the pixel that it crosses. The axes of `grain`
    move with the contact; it is mirrored at its ends."""
    width, stream, cold, hot, rest, cold_m2, hot_m2 = gas
    ring_x, ring_r, ring_gain, ring_long = ring
    last = grain.shape[1] - 1
    aheads, passes, eddies = np.empty(x.size), np.empty(x.size), np.empty(x.size)
    for j in range(x.size):  # values that do not depend on the row
        aheads[j] = min(max(0.5 - (x[j] - xs) / pixel, 0.0), 1.0)
        passes[j] = min(max(0.5 - (x[j] - xp) / pixel, 0.0), 1.0)
        at = ((xc - x[j]) / pixel) % (2 * last)
        eddies[j] = min(at, 2 * last - at)
    for i in range(y.size):
        contact = xc + ripple[i]
        for j in range(x.size):
            ahead, passed = aheads[j], passes[j]
            value = 0.0
            if ahead < 1.0:
                wake = 0.0
                if passed > 0.0:
                    near = min(max(0.5 - (x[j] - contact) / pixel, 0.0), 1.0)
                    rho = near * cold + (1.0 - near) * hot
                    m2 = near * cold_m2 + (1.0 - near) * hot_m2
                    k = min(int(eddies[j]), last - 1)
                    part = eddies[j] - k
                    eddy = near * (grain[i, k] + part * (grain[i, k + 1] - grain[i, k]))
                    wake = rho * (width * (1.0 + eddy) + 0.5 * m2 * swirl[i, j])
                    if ring_gain > 0.0:
                        inside = ring_r - math.hypot(x[j] - ring_x, y[i])
                        if inside > -pixel:
                            edge = min(0.5 + inside / pixel, 1.0)
                            fall = math.exp(-max(inside, 0.0) / ring_long)
                            wake += max(edge, 0.0) * ring_gain * fall
                value = passed * wake + (1.0 - passed) * rest * width
            out[i, j] = ahead * stream * (width + steady[i, j]) + (1.0 - ahead) * value


def swirl(body: Wedge | Sphere, x: Any, y: Any) -> Any:
    """Integral of 1 - V^2 along sight lines, m, of incompressible flow past the model, for the
    subsonic gas. The density follows from Bernoulli's equation, linear in M^2.

    A wedge has the flow of an infinite wedge, V = (r/l)^(a/(pi - a)), up to l, twice its length. A
    sphere has the flow of a source in a stream, a half body of its thickness (Milne-Thomson,
    Theoretical Hydrodynamics).
    """
    h = body.height
    if isinstance(body, Wedge):
        part = np.minimum(np.hypot(x, y) / (2.0 * body.length), 1.0)
        return WIDTH * (1.0 - part ** (2.0 * body.angle / (math.pi - body.angle)))
    k, x = 0.25 * h * h, x - 0.5 * h
    a = np.sqrt(np.maximum(x * x + y * y, 0.25 * h * h))
    return -4.0 * k * x / (a * a) - 0.5 * math.pi * k * k / a**3


def grain(x: Any, y: Any, size: float) -> Plane:
    """Relative density of eddies of `size`, m, (H, 2 W), peak to peak ROUGH."""
    u = np.arange(2 * x.size)[None, :] * (x[1] - x[0]) / size
    v = y[:, None] / size
    both = noise(u, v, 41) + 0.5 * noise(2.1 * u, 2.1 * v, 42)
    return (ROUGH * (both / 1.5 - 0.5)).astype(np.float32)


def fine(function: Any, x: Any, y: Any, pixel: float, n: int = 4) -> Any:
    """Mean of `function` over n x n points in each pixel."""
    offsets = ((np.arange(n) + 0.5) / n - 0.5) * pixel
    return sum(function(x + dx, y + dy) for dx in offsets for dy in offsets) / (n * n)


def flows(body: Wedge | Sphere, x: Any, y: Any, way: float) -> list[Plane]:
    """Integral of the relative excess density of the steady flow along sight lines, m; for a sphere
    at each of SWELLS, where only the part behind the starting shock is needed.

    Args:
        body: the model.
        x, y: coordinates from its foremost point, (1, W) and (H, 1), m.
        way: the length s of `Shockwave.swell`, m.

    Returns:
        Planes (H, W) float32.
    """
    pixel = float(x[0, 1] - x[0, 0])
    if isinstance(body, Wedge):
        whole = fine(lambda a, b: body.path(a, b, WIDTH), x, y, pixel)
        return [whole.astype(np.float32)]
    half = y[(y.shape[0]) // 2 :]
    planes: list[Plane] = []
    for m, swell in enumerate(SWELLS):
        passed = np.inf
        if m:  # the position of the starting shock at the previous standoff
            excess = (SWELLS[m - 1] - 1.0) * body.standoff / way
            passed = -body.standoff - way * math.log(max(math.expm1(excess), 1e-4)) + 8 * pixel
        columns = int(np.count_nonzero(x[0] <= passed))
        plane = np.zeros((y.shape[0], x.shape[1]), np.float32)
        part = body.path(x[:, :columns], half, WIDTH, swell)
        plane[y.shape[0] // 2 :, :columns] = part
        plane[: half.shape[0], :columns] = part[::-1]
        if columns < x.shape[1]:
            plane[:, columns:] = planes[0][:, columns:]
        planes.append(plane)
    return planes


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
