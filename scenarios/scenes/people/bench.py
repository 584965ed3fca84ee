"""The still part of the workshop: pegboard, tools, bench, stands, wedge and rule. All assumed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from scenarios.scenes.charts.star import paint_lines
from scenarios.scenes.drawing.bodies import polyline
from scenarios.scenes.drawing.canvas import Item, blob, body, ellipse, polygon, shadow
from scenarios.scenes.drawing.shapes import (
    GRAIN,
    Cam,
    Surface,
    Win,
    cover,
    grid,
    lay,
    noise,
    visible,
)

__all__ = ["BOARD", "bench", "cradle_frame", "fan_back", "fan_front"]

BOARD: dict[str, tuple[float, float]] = {
    "fan": (-0.205, -0.075),
    "disc": (0.185, -0.110),
    "cradle": (0.205, 0.135),
    "wedge": (-0.215, 0.312),
}
"""Centres, metres; the cradle's is the middle of its upper bar."""
GUARD = 0.136
"""Radius of the fan's guard."""
EDGE = 0.165
"""Where the bench's far edge meets the wall."""
STEEL = Surface(0.42, shine=0.35, gloss=18.0)
DARK = Surface(0.07, shine=0.10, gloss=14.0)
WOOD = Surface(0.40, GRAIN, period=0.016, contrast=0.36)


def _light(x: Any, y: Any) -> Any:
    """The lamp's light on the wall: a pool from the upper left that falls off."""
    far = ((x + 0.22) / 0.62) ** 2 + ((y + 0.26) / 0.52) ** 2
    return 0.30 + 0.78 / (1.0 + far)


def paint_board(image: Any, win: Win, cam: Cam) -> None:
    """The painted pegboard, everywhere: holes 25 mm apart, a lit rim below each."""
    pixel = cam[0]
    x, y = np.broadcast_arrays(*grid(win, cam))
    step, hole = 0.025, 0.0030
    soft = math.hypot(pixel, 0.0008)
    u, v = x - step * np.round(x / step), y - step * np.round(y / step)
    fine = visible(0.5 * step, pixel)
    inside = cover((np.hypot(u, v) - hole) / soft)
    rim = cover((np.hypot(u, v - 0.0012) - hole) / soft) - inside
    grit = noise(x / 0.0025, y / 0.0025, 40) - 0.5
    stain = noise(x / 0.11, y / 0.09, 41) + 0.5 * noise(x / 0.03, y / 0.04, 42) - 0.75
    tone = 0.42 * (1.0 + 0.07 * visible(0.0025, pixel) * grit + 0.12 * stain)
    tone = tone * (1.0 - fine * (0.86 * inside - 0.22 * np.maximum(rim, 0.0)))
    lay(image, win, np.ones((1, 1)), tone * _light(x, y))


def _slab(
    x0: float, y0: float, x1: float, y1: float, flare: float = 0.0
) -> list[tuple[float, float]]:
    """Corners of an upright rectangle, its foot wider by `flare` to each side."""
    return [(x0, y0), (x1, y0), (x1 + flare, y1), (x0 - flare, y1)]


def bench() -> list[Item]:
    """Wall, tools, bench, and the stands on it, back to front."""
    items = [Item((-1e4, -1e4, 1e4, 1e4), paint_board, ())]
    items += _tools()
    items += [
        # Shadows that fan and disc throw on the wall.
        shadow([(-0.145, -0.02, -0.145, -0.02, 0.135, 0.135)], 0.035, 0.22),
        shadow([(0.240, -0.060, 0.240, -0.060, 0.112, 0.112)], 0.022, 0.48),
        shadow([(-100.0, EDGE - 0.004, 100.0, EDGE - 0.004, 0.012, 0.012)], 0.022, 0.45),
    ]
    items += _top()
    x, y = BOARD["disc"]
    items += [
        # The disc's motor and stand.
        blob(x + 0.045, 0.208, 0.085, 0.012, -0.55),
        body([(x, y, x, 0.185, 0.013, 0.015)], DARK._replace(albedo=0.12)),
        polygon(_slab(x - 0.055, 0.183, x + 0.055, 0.208, 0.013), 0.13, radius=0.004, down=-2.0),
        ellipse(x, y, 0.034, 0.034, 0.10, lit=0.6, shine=0.1),
    ]  # fmt: skip
    items += _wedge() + _rule()
    return items


def _top() -> list[Item]:
    """The bench's planks."""
    items = []
    rows = ((EDGE, 0.232, 0.34), (0.232, 0.312, 0.30), (0.312, 0.412, 0.35), (0.412, 1e4, 0.29))
    for m, (y0, y1, tone) in enumerate(rows):
        grain = WOOD._replace(x=0.37 * m, y=0.11 * m, period=0.012 + 0.004 * m)
        items.append(polygon(_slab(-1e4, y0, 1e4, y1), tone, grain=grain))
        items.append(shadow([(-100, y0, 100, y0, 0.0010, 0.0010)], 0.0012, 0.75 if m else 0.3))
        items.append(shadow([(-100, y0 + 0.003, 100, y0 + 0.003, 0.002, 0.002)], 0.003, -0.12))
    items.append(blob(0.42, 0.42, 0.30, 0.16, -0.45))
    items.append(blob(-0.20, 0.27, 0.30, 0.07, 0.28))
    return items


def _tools() -> list[Item]:
    """Spanner, screwdriver and hammer on the pegboard."""
    spanner = [
        (-0.325, -0.325, -0.175, -0.325, 0.0085, 0.0085),
        (-0.338, -0.338, -0.318, -0.328, 0.0095, 0.012),
        (-0.338, -0.312, -0.318, -0.322, 0.0095, 0.012),
        (-0.165, -0.325, -0.165, -0.325, 0.019, 0.019),
    ]
    handle = [
        (-0.100, -0.322, -0.045, -0.322, 0.0135, 0.0125),
        (-0.045, -0.322, -0.028, -0.322, 0.0090, 0.0130),
    ]
    blade = [
        (-0.030, -0.322, 0.075, -0.322, 0.0036, 0.0036),
        (0.070, -0.322, 0.086, -0.322, 0.0036, 0.0052),
    ]
    haft = [(0.150, -0.318, 0.355, -0.312, 0.0105, 0.0130)]
    head = [
        (0.148, -0.352, 0.148, -0.285, 0.0150, 0.0130),
        (0.150, -0.356, 0.160, -0.374, 0.0110, 0.0050),
    ]
    items: list[Item] = []
    for rows, blend in ((spanner, 0.012), (handle + blade, 0.002), (haft + head, 0.004)):
        moved = [(r[0] + 0.010, r[1] + 0.012, r[2] + 0.010, r[3] + 0.012, *r[4:]) for r in rows]
        items.append(shadow(moved, 0.007, 0.50, blend))
    items += [
        body(spanner, STEEL, 0.012),
        ellipse(-0.165, -0.325, 0.0095, 0.0095, 0.16),
        ellipse(-0.165, -0.325, 0.0105, 0.0105, 0.30, ring=0.0012, lit=1.0),
        body(blade, STEEL, 0.003),
        body(handle, Surface(0.16, shine=0.30, gloss=25.0), 0.004),
        *(
            shadow([(-0.096, y, -0.050, y, 0.0008, 0.0008)], 0.001, 0.5)
            for y in (-0.328, -0.322, -0.316)
        ),
        body(haft, Surface(0.46, GRAIN, period=0.006, contrast=0.22, shine=0.06)),
        body(head, STEEL._replace(albedo=0.22), 0.006),
    ]
    return items


def fan_back() -> list[Item]:
    """The fan's stand, motor and rear guard."""
    x, y = BOARD["fan"]
    wires: list[tuple[float, ...]] = []
    for m in range(20):
        cos, sin = math.cos(math.tau * m / 20), math.sin(math.tau * m / 20)
        ends = [(x + r * cos, y + r * sin) for r in (0.03, GUARD)]
        wires += polyline(ends, 0.0009, 0.0009, 0.0009)
    rear = DARK._replace(albedo=0.10)
    return [
        blob(x + 0.040, 0.228, 0.105, 0.014, -0.60),
        ellipse(x, 0.212, 0.082, 0.023, 0.16, lit=0.75, shine=0.12),
        ellipse(x, 0.206, 0.050, 0.012, 0.15, lit=0.55, shine=0.10),
        body([(x, y + 0.10, x, 0.200, 0.012, 0.017)], DARK._replace(albedo=0.15, shine=0.2)),
        ellipse(x + 0.020, 0.212, 0.0065, 0.0022, 0.75),
        blob(x, y, 0.075, 0.075, -0.35),
        body(wires, rear),
        *(ellipse(x, y, r, r, 0.12, ring=0.0009, lit=1.0) for r in (0.06, 0.09, 0.115)),
        ellipse(x, y, 0.040, 0.040, 0.07, lit=0.7),
    ]


def fan_front() -> list[Item]:
    """The front guard and the hub's cap, which hide little of the blades."""
    x, y = BOARD["fan"]
    wires: list[tuple[float, ...]] = []
    for m in range(24):
        a = math.tau * m / 24
        points = []
        for k in range(5):
            r, b = 0.026 + (GUARD - 0.026) * k / 4, a + 0.5 * (k / 4) ** 1.5
            points.append((x + r * math.cos(b), y + r * math.sin(b)))
        wires += polyline(points, 0.0008, 0.0008, 0.0008)
    wire = Surface(0.62, shine=0.5, gloss=10.0)
    return [
        body(wires, wire, 0.0005),
        *(
            ellipse(x, y, r, r, 0.60, ring=0.0008, lit=1.0, shine=0.4)
            for r in (0.055, 0.082, 0.109)
        ),
        ellipse(x, y, GUARD, GUARD, 0.55, ring=0.0045, lit=1.0, shine=0.35),
        blob(x + 0.004, y + 0.006, 0.022, 0.022, -0.45),
        ellipse(x, y, 0.027, 0.027, 0.50, lit=0.9, shine=0.25),
        ellipse(x, y, 0.018, 0.018, 0.30, ring=0.0010, lit=1.0),
        ellipse(x, y, 0.0125, 0.0125, 0.12, lit=0.4, shine=0.15),
    ]


def cradle_frame() -> list[Item]:
    """The cradle's base, posts and upper bar."""
    x, y = BOARD["cradle"]
    left, right = x - 0.135, x + 0.135
    rod = STEEL._replace(albedo=0.55, shine=0.45)
    base = _slab(left - 0.015, 0.338, right + 0.015, 0.362, 0.009)
    return [
        blob(x + 0.02, 0.372, 0.160, 0.012, -0.62),
        polygon(base, 0.20, radius=0.004, down=-3.0,
                grain=Surface(1.0, GRAIN, period=0.006, contrast=0.35)),
        body([(left - 0.016, 0.338, right + 0.016, 0.338, 0.0022, 0.0022)], Surface(0.42)),
        blob(x, 0.342, 0.075, 0.006, -0.40),
        body([(left, y, left, 0.344, 0.0042, 0.0042), (right, y, right, 0.344, 0.0042, 0.0042),
              (left, y, right, y, 0.0042, 0.0042)], rod, 0.004),
    ]  # fmt: skip


def _wedge() -> list[Item]:
    """A card with eight grey steps in equal parts of white."""
    x, y = BOARD["wedge"]
    wide, high, n = 0.032, 0.040, 8
    w, h = 0.5 * n * wide + 0.006, 0.5 * high + 0.006
    items = [
        blob(x + 0.006, y + h, w * 0.62, 0.010, -0.55),
        polygon(_slab(x - w, y - h, x + w, y + h), 0.04, radius=0.002),
    ]
    for m in range(n):
        a = x + (m - 0.5 * n) * wide
        step = _slab(a, y - h + 0.006, a + wide, y + h - 0.006)
        items.append(polygon(step, (m + 1) / n))
    return items


def _rule() -> list[Item]:
    """A steel rule along the bench's front: marks each 2 mm and each 10 mm."""
    x0, x1, y0, y1 = -0.360, -0.020, 0.366, 0.388
    corners = _slab(x0 - 0.006, y0, x1 + 0.006, y1)
    items = [
        shadow([(x0, y1, x1 + 0.004, y1 + 0.002, 0.003, 0.003)], 0.004, 0.5),
        polygon(corners, 0.60, radius=0.001, across=0.35),
    ]
    fine = (x0, y0 + 0.001, x1, y0 + 0.006)
    items.append(Item(fine, paint_lines, (fine, 0.002, True)))
    marks: list[tuple[float, ...]] = []
    for m in range(35):
        x, low = x0 + 0.01 * m, y0 + (0.013 if m % 5 == 0 else 0.009)
        marks.append((x, y0 + 0.001, x, low, 0.0006, 0.0006))
    items.append(body(marks, Surface(0.05, round=0.0)))
    return items
