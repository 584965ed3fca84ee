"""Density along sight lines while a tunnel starts: the waves as planes, and what lies between them.

Lengths in metres; x downstream, y from the axis. A sight line's density is its integral, kg/m2.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from cosim import Plane
from scenarios.scenes.drawing.shapes import noise
from scenarios.scenes.flow.steadyflow import Sphere, Wedge

__all__ = ["SWELLS", "WIDTH", "fine", "flows", "grain", "mix", "swirl"]

WIDTH = 0.12
"""Sight line through the flow: the nozzle's exit, m. A wedge spans it."""
ROUGH = 0.02
"""Density of eddies, relative, peak to peak (assumed)."""
SWELLS = tuple(1.0 + 0.02 * m + 0.0114 * m * m for m in range(14))
"""Standoffs, over the steady one, for which a sphere's flow is kept; in between, linear."""


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True)
def mix(out, steady, swirl, grain, x, y, ripple, pixel, xs, xc, xp, gas, ring):  # type: ignore[no-untyped-def]
    """Density along sight lines, kg/m2: the steady flow upstream of the starting shock at xs, cold
    gas to the contact at xc, hot gas to the primary shock at xp, gas at rest beyond. Jumps cover
    the pixel they cross. grain: eddies in axes that go with the contact, mirrored at their ends."""
    width, stream, cold, hot, rest, cold_m2, hot_m2 = gas
    ring_x, ring_r, ring_gain, ring_long = ring
    last = grain.shape[1] - 1
    aheads, passes, eddies = np.empty(x.size), np.empty(x.size), np.empty(x.size)
    for j in range(x.size):  # what is the same in every row
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
    """1 - V^2 along sight lines, metres, of incompressible flow past the model: how subsonic gas
    gives way to it. Density then follows from Bernoulli, linear in M^2. The wedge's is that of an
    endless one, V = (r/l)^(a/(pi - a)), up to l, twice its length; the sphere's that of a source in
    a stream, a half body as thick as it (Milne-Thomson, Theoretical Hydrodynamics).
    """
    h = body.height
    if isinstance(body, Wedge):
        part = np.minimum(np.hypot(x, y) / (2.0 * body.length), 1.0)
        return WIDTH * (1.0 - part ** (2.0 * body.angle / (math.pi - body.angle)))
    k, x = 0.25 * h * h, x - 0.5 * h
    a = np.sqrt(np.maximum(x * x + y * y, 0.25 * h * h))
    return -4.0 * k * x / (a * a) - 0.5 * math.pi * k * k / a**3


def grain(x: Any, y: Any, size: float) -> Plane:
    """Relative density of eddies, (H, 2 W), peak to peak ROUGH."""
    u = np.arange(2 * x.size)[None, :] * (x[1] - x[0]) / size
    v = y[:, None] / size
    both = noise(u, v, 41) + 0.5 * noise(2.1 * u, 2.1 * v, 42)
    return (ROUGH * (both / 1.5 - 0.5)).astype(np.float32)


def fine(function: Any, x: Any, y: Any, pixel: float, n: int = 4) -> Any:
    """Mean over each pixel of n x n points."""
    offsets = ((np.arange(n) + 0.5) / n - 0.5) * pixel
    return sum(function(x + dx, y + dy) for dx in offsets for dy in offsets) / (n * n)


def flows(body: Wedge | Sphere, x: Any, y: Any, way: float) -> list[Plane]:
    """Steady density less the free stream's along sight lines, over the free stream's, metres: for
    a sphere at each of SWELLS, of which only what the starting shock has passed is needed. x (1, w)
    and y (h, 1) from the foremost point; way: the `Shockwave.swell` length."""
    pixel = float(x[0, 1] - x[0, 0])
    if isinstance(body, Wedge):
        whole = fine(lambda a, b: body.path(a, b, WIDTH), x, y, pixel)
        return [whole.astype(np.float32)]
    half = y[(y.shape[0]) // 2 :]
    found: list[Plane] = []
    for m, swell in enumerate(SWELLS):
        passed = np.inf
        if m:  # where the starting shock stands at the swell before, which is interpolated to this
            excess = (SWELLS[m - 1] - 1.0) * body.standoff / way
            passed = -body.standoff - way * math.log(max(math.expm1(excess), 1e-4)) + 8 * pixel
        columns = int(np.count_nonzero(x[0] <= passed))
        plane = np.zeros((y.shape[0], x.shape[1]), np.float32)
        part = body.path(x[:, :columns], half, WIDTH, swell)
        plane[y.shape[0] // 2 :, :columns] = part
        plane[: half.shape[0], :columns] = part[::-1]
        if columns < x.shape[1]:
            plane[:, columns:] = found[0][:, columns:]
        found.append(plane)
    return found
