"""Density along sight lines during the start of a tunnel: the waves as planes, and the gas between.

Lengths are in metres; x points downstream, y from the axis. "Density along a sight line" is the
integral of the density, kg/m2.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
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
