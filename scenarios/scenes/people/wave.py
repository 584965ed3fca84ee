"""A person who waves in front of a wall, in closed form: the scene of figures 3 to 5 in Huang 2022.

The paper records a waving person for 800 cycles at 20 kHz (40 ms) and shows blur after 10 ms and
strong blur after 40 ms (section 6). Here the arm is a chain of shoulder, elbow, wrist and fingers;
each angle is a sine of the same rate, so the true light is known at any instant.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from scenarios.scenes.drawing.bodies import polyline
from scenarios.scenes.drawing.canvas import (
    Canvas,
    Drawn,
    Item,
    Layer,
    View,
    blob,
    body,
    check_instant,
    check_number,
    check_shape,
    shadow,
)
from scenarios.scenes.drawing.shading import Array, Surface, lattice, noise, visible
from scenarios.scenes.drawing.shapes import Cam, Win, cover, grid, lay
from scenarios.scenes.people.portrait import CENTRE, SHIRT, SKIN_TONE, person, person_shadow

TAU = 2 * math.pi

# Segment lengths as parts of the stature (Drillis and Contini 1966, in Winter, Biomechanics and
# Motor Control of Human Movement, 4th ed., fig. 4.1), stature 1.75 m.
STATURE = 1.75
UPPER_ARM, FOREARM, HAND = 0.186 * STATURE, 0.146 * STATURE, 0.108 * STATURE
FORESHORTENED = 0.84
"""Visible share of the upper arm's length, which points partly towards the camera (assumed)."""
SHOULDER = (CENTRE + 0.164, 0.046)

# Mean angles from the vertical, amplitudes relative to the forearm's, and phase lags behind it, rad
# (assumed): the shoulder leads, and hand and fingers follow.
UPPER_MEAN, FOREARM_MEAN, HAND_MEAN = 2.22, 0.10, -0.04
UPPER_SWING, HAND_SWING, FINGER_SWING = 0.10, 0.42, 0.14
UPPER_LAG, HAND_LAG, FINGER_LAG = -0.35, 0.75, 1.25

# Fingers: (position across the palm, mean angle to the palm, length, radius at the knuckle), with
# the palm towards the camera; lengths over the hand's length (assumed).
FINGERS = (
    (-0.185, -0.20, 0.40, 0.052),
    (-0.062, -0.05, 0.45, 0.055),
    (0.062, 0.08, 0.42, 0.053),
    (0.178, 0.24, 0.34, 0.046),
)
SHADOW_AT = (0.085, 0.075)
"""Offset of the shadow on the wall, m to the right and down."""


# The wall, m: brick and joint (DIN 105 NF format 240 x 71 with 12 mm joints), the blur of a
# background out of focus, and tones (assumed).
BRICK, COURSE, JOINT, DEFOCUS = 0.252, 0.083, 0.0055, 0.0022
BRICK_TONE, BRICK_SPREAD, JOINT_TONE = 0.27, 0.12, 0.33


def _pane(x: Array, y: Array) -> Any:
    """Light of a low sun through a window with bars on the wall, 0 to 1."""
    u, v = x - 0.30 + 0.22 * y, y + 0.10 - 0.10 * x
    across = sum(cover((np.abs(u - m * 0.27) - 0.122) / 0.024) for m in (-0.5, 0.5))
    down = sum(cover((np.abs(v - n * 0.31) - 0.142) / 0.024) for n in (-1, 0, 1))
    return across * down


def paint_wall(image: Any, win: Win, cam: Cam) -> None:
    """Paints a brick wall in running bond."""
    pixel = cam[0]
    x, y = np.broadcast_arrays(*grid(win, cam))
    soft = math.hypot(pixel, DEFOCUS)
    bricks, rough = visible(COURSE, pixel), visible(0.004, pixel)
    # The courses deviate by some millimetres.
    v = (y + 0.006 * (noise(x / 0.3, y / 0.2, 20) - 0.5)) / COURSE
    row = np.floor(v)
    u = (x + 0.006 * (noise(x / 0.07, y / 0.08, 21) - 0.5)) / BRICK + 0.5 * (row % 2)
    column = np.floor(u)
    du = (0.5 - np.abs(u - column - 0.5)) * BRICK - JOINT
    dv = (0.5 - np.abs(v - row - 0.5)) * COURSE - JOINT
    d = np.minimum(du, dv) + 0.003 * (noise(x / 0.012, y / 0.012, 22) - 0.5)
    inside = cover(-d / soft)
    single = lattice(column.astype(np.int64), row.astype(np.int64), 23) - 0.5
    grit = noise(x / 0.004, y / 0.004, 24) - 0.5
    stain = noise(x / 0.05, y / 0.03, 25) - 0.5
    tone = BRICK_TONE + BRICK_SPREAD * bricks * single
    tone *= 1.0 + 0.16 * rough * grit + 0.30 * bricks * stain
    # The rounded rim of a brick is bright along the top and dark along the bottom.
    rim = np.exp(-((d / 0.005) ** 2)) * inside * (dv <= du)
    tone *= 1.0 + np.where(v - row < 0.5, 0.22, -0.30) * rim * bricks
    joint = JOINT_TONE * (1.0 + 0.16 * rough * grit)
    tone = joint + inside * (tone - joint)
    far = np.hypot(x + 0.5, y + 0.7)
    light = np.maximum(0.86 - 0.48 * far + 0.10 * far * far, 0.10) + 0.78 * _pane(x, y)
    lay(image, win, np.ones((1, 1)), tone * light)


@dataclass(frozen=True)
class Wave(Drawn):
    """A waving person. With the defaults, the fingertips move at up to 6 m/s.

    Attributes:
        shape: (height, width), pixels, each 8 to 2000.
        rate: waves per second, 0 to 6 Hz; 3 Hz is a fast wave (assumed).
        swing: amplitude of the forearm, 0 to 0.9 rad.
        phase: phase at t = 0, rad; with the default, the arm is fastest in the middle of the first
            40 ms.
        field: length of the picture's shorter side, 0.2 to 5 m.

    Raises:
        ValueError: a value is out of range.
    """

    shape: tuple[int, int]
    rate: float = 3.0
    swing: float = 0.50
    phase: float = -0.12 * math.pi
    field: float = 1.1

    def __post_init__(self) -> None:
        check_shape(self.shape)
        check_number("rate", self.rate, 0.0, 6.0, "Hz")
        check_number("swing", self.swing, 0.0, 0.9, "rad")
        check_number("phase", self.phase, -TAU, TAU, "rad")
        check_number("field", self.field, 0.2, 5.0, "m")

    @property
    def _view(self) -> View:
        return View(self.shape, self.field)

    def canvas(self) -> Canvas:
        return _canvas(self)

    def speed(self) -> float:
        """Upper bound of the speed of any edge, pixels/s: the sum of the peak angular speeds of the
        chain, each times the greatest distance from its joint."""
        return self._speed() / self._view.pixel

    def _speed(self) -> float:
        """The same, m/s."""
        w = TAU * self.rate
        upper, fore = UPPER_SWING * self.swing, self.swing
        hand, finger = HAND_SWING * self.swing, FINGER_SWING * self.swing
        girth = 0.07  # greatest distance of the skin from a limb's axis or end, m
        return w * (
            upper * (FORESHORTENED * UPPER_ARM + girth)
            + fore * (FOREARM + girth)
            + (fore + hand) * (HAND + girth)
            + finger * 0.55 * HAND
        )

    def angles(self, t: float) -> tuple[float, float, float, float]:
        """Angles of upper arm, forearm, hand and fingers at t, rad from the vertical, clockwise.

        Forearm: FOREARM_MEAN + swing sin(p), p = 2 pi rate t + phase. Whole turns are removed
        before the multiplication by 2 pi, so that the precision of long times is kept.
        """
        p = TAU * math.fmod(self.rate * check_instant(t), 1.0) + self.phase
        fore = FOREARM_MEAN + self.swing * math.sin(p)
        hand = fore + HAND_MEAN + HAND_SWING * self.swing * math.sin(p - HAND_LAG)
        return (
            UPPER_MEAN + UPPER_SWING * self.swing * math.sin(p - UPPER_LAG),
            fore,
            hand,
            hand + FINGER_SWING * self.swing * math.sin(p - FINGER_LAG),
        )

    def joints(self, t: float) -> tuple[tuple[float, float], ...]:
        """Shoulder, elbow, wrist and centre of the palm at t, (row, column); pixel (i, j) spans i
        to i + 1 and j to j + 1."""
        view = self._view
        return tuple(view.at(*p) for p in _chain(self, t))

    def points(self) -> list[tuple[int, int, str]]:
        """Characteristic pixels (row, column, label), like the ten of figure 5 in Huang 2022."""
        view = self._view
        middle = -self.phase / (TAU * self.rate) if self.rate else 0.0
        (x, y), hand = _chain(self, middle)[3], self.angles(middle)[2]
        dx, dy = _lean(hand, 0.35 * HAND)
        at = {
            "sunlit wall": (0.44, -0.40),
            "wall": (-0.44, -0.40),
            "shaded wall": (-0.46, 0.42),
            "forehead": (CENTRE - 0.015, -0.285),
            "hair": (CENTRE + 0.01, -0.350),
            "eye": (CENTRE - 0.031, -0.246),
            "shirt": (CENTRE - 0.06, 0.20),
            "sleeve": (0.115, 0.165),
            "wrist": _chain(self, 0.0)[2],
            "where the palm passes": (x, y),
            "where the fingers pass": (x + dx, y + dy),
        }
        return [(*view.point(x, y), label) for label, (x, y) in at.items()]


@lru_cache(maxsize=2)
def _canvas(wave: Wave) -> Canvas:
    """The layers of the scene, cached here so that `Wave` remains a plain value."""
    everywhere = (-1e6, -1e6, 1e6, 1e6)
    wall = (Item(everywhere, paint_wall, ()), *person_shadow(*SHADOW_AT, 0.030, 0.42))
    speed = wave._speed()
    length = FORESHORTENED * UPPER_ARM + FOREARM + HAND + 0.10
    (x, y), (dx, dy) = SHOULDER, SHADOW_AT
    reach = (x - length, y - length, x + length + dx, y + length + dy)
    return Canvas(
        wave._view,
        (
            Layer(wall),
            Layer(items=lambda t: _arm_shadow(wave, t), speed=speed, reach=reach),
            Layer(tuple(person())),
            Layer(items=lambda t: _arm(wave, t), speed=speed, reach=reach),
        ),
    )


def _lean(angle: float, length: float) -> tuple[float, float]:
    """Vector of a limb at `angle`, rad from the vertical, clockwise."""
    return length * math.sin(angle), -length * math.cos(angle)


def _chain(wave: Wave, t: float) -> tuple[tuple[float, float], ...]:
    """Shoulder, elbow, wrist and centre of the palm, m."""
    upper, fore, hand, _ = wave.angles(t)
    at = [SHOULDER]
    for angle, length in (
        (upper, FORESHORTENED * UPPER_ARM), (fore, FOREARM), (hand, 0.30 * HAND),
    ):  # fmt: skip
        dx, dy = _lean(angle, length)
        at.append((at[-1][0] + dx, at[-1][1] + dy))
    return tuple(at)


def _palm(wrist: tuple[float, float], hand: float) -> Callable[[float, float], tuple[float, float]]:
    """The map from points of a hand at the angle `hand`, rad, to metres. Points are (across, up)
    from the wrist, over the hand's length."""
    (dx, dy), (ex, ey) = _lean(hand, HAND), _lean(hand + 0.5 * math.pi, HAND)
    return lambda across, up: (wrist[0] + up * dx + across * ex, wrist[1] + up * dy + across * ey)


def _rows(wave: Wave, t: float) -> tuple[list[Any], list[Any], list[Any]]:
    """Rows of cones of sleeve, forearm, and hand with fingers."""
    _, fore, hand, bend = wave.angles(t)
    shoulder, elbow, wrist, _ = _chain(wave, t)

    def along(a: float) -> tuple[float, float]:
        dx, dy = _lean(fore, a * FOREARM)
        return elbow[0] + dx, elbow[1] + dy

    palm = _palm(wrist, hand)
    sleeve = [
        (*shoulder, *elbow, 0.056, 0.050),
        (*elbow, *along(0.17), 0.051, 0.047),
    ]
    forearm = [
        (*along(0.1), *along(0.42), 0.043, 0.041),
        (*along(0.42), *along(0.96), 0.041, 0.0265),
    ]
    fingers = [
        (*along(0.90), *palm(0.0, 0.08), 0.0265, 0.026),
        (*palm(-0.06, 0.12), *palm(-0.155, 0.44), 0.028, 0.0165),
        (*palm(0.00, 0.12), *palm(-0.03, 0.44), 0.026, 0.0175),
        (*palm(0.03, 0.12), *palm(0.08, 0.43), 0.026, 0.0170),
        (*palm(0.07, 0.12), *palm(0.16, 0.39), 0.026, 0.0155),
    ]
    for across, splay, long, r in FINGERS:
        x, y = palm(across, 0.50 - 0.55 * across * across - 0.12 * max(across, 0.0))
        angle = hand + splay
        for part, shrink, turn in ((0.46, 0.93, 0.0), (0.30, 0.88, 0.6), (0.24, 0.80, 1.0)):
            dx, dy = _lean(angle + turn * (bend - hand), part * long * HAND)
            fingers.append((x, y, x + dx, y + dy, r * HAND, r * shrink * HAND))
            x, y, r = x + dx, y + dy, r * shrink
    x, y = palm(-0.14, 0.18)
    for angle, long, r0, r1 in ((-0.85, 0.24, 0.105, 0.068), (-0.55, 0.17, 0.066, 0.058),
                                (-0.38, 0.13, 0.058, 0.046)):  # fmt: skip
        dx, dy = _lean(hand + angle + 0.5 * (bend - hand), long * HAND)
        fingers.append((x, y, x + dx, y + dy, r0 * HAND, r1 * HAND))
        x, y = x + dx, y + dy
    return sleeve, forearm, fingers


def _arm_shadow(wave: Wave, t: float) -> list[Item]:
    """The shadow of the arm on the wall; each finger is one cone, because the shadow is soft."""
    dx, dy = SHADOW_AT
    sleeve, forearm, hand = _rows(wave, t)
    fingers = [(*hand[m][:2], *hand[m + 2][2:4], hand[m][4], hand[m][4]) for m in range(5, 20, 3)]
    rows = sleeve + forearm[1:] + hand[:1] + hand[1:5:3] + fingers
    moved = [(r[0] + dx, r[1] + dy, r[2] + dx, r[3] + dy, *r[4:]) for r in rows]
    return [shadow(moved, 0.022, 0.42, 0.005)]


def _arm(wave: Wave, t: float) -> list[Item]:
    """The waving arm, from back to front."""
    upper, fore, hand, _ = wave.angles(t)
    sleeve, forearm, fingers = _rows(wave, t)
    shoulder, elbow, wrist, _ = _chain(wave, t)
    cloth = SHIRT._replace(
        x=shoulder[0], y=shoulder[1], turn=upper - 0.5 * math.pi, seam=-0.006
    )  # fmt: skip
    rolled = SHIRT._replace(x=elbow[0], y=elbow[1], turn=fore, albedo=0.43)
    skin = SKIN_TONE._replace(x=elbow[0], y=elbow[1], turn=fore)
    ux, uy = _lean(fore, FOREARM)
    vx, vy = _lean(fore + 0.5 * math.pi, 1.0)
    items = [body(forearm + fingers, skin._replace(x=wrist[0], y=wrist[1], turn=hand), 0.008)]
    items += _creases(wrist, hand)
    items += [
        # The watch: strap and dial.
        body([(elbow[0] + 0.86 * ux - 0.026 * vx, elbow[1] + 0.86 * uy - 0.026 * vy,
               elbow[0] + 0.86 * ux + 0.026 * vx, elbow[1] + 0.86 * uy + 0.026 * vy,
               0.0085, 0.0085)], Surface(0.07, shine=0.10, gloss=12.0)),
        blob(elbow[0] + 0.38 * ux, elbow[1] + 0.38 * uy, 0.040, 0.012, -0.45, fore),
        body(sleeve, cloth, 0.02),
        body([(elbow[0] + 0.34 * ux - 0.036 * vx, elbow[1] + 0.34 * uy - 0.036 * vy,
               elbow[0] + 0.34 * ux + 0.036 * vx, elbow[1] + 0.34 * uy + 0.036 * vy,
               0.0155, 0.0155)], rolled, 0.004),
    ]  # fmt: skip
    return items


def _creases(wrist: tuple[float, float], hand: float) -> list[Item]:
    """Lines of the palm."""
    palm = _palm(wrist, hand)
    lines = (
        ((-0.19, 0.40), (-0.08, 0.36), (0.0, 0.24), (0.0, 0.10)),
        ((-0.19, 0.41), (-0.05, 0.38), (0.08, 0.31), (0.16, 0.22)),
        ((-0.05, 0.50), (0.02, 0.44), (0.12, 0.41), (0.20, 0.40)),
        ((-0.11, 0.03), (0.0, 0.015), (0.11, 0.03)),
    )
    return [
        shadow(polyline([palm(*p) for p in line], 0.0002, 0.0012, 0.0003), 0.0018, 0.42)
        for line in lines
    ]
