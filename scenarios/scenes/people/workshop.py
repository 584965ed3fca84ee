"""A bench with things that move: what `viform run film` shows where no clip is given.

A desk fan, a disc with lettering and a small Siemens star, a bouncing ball and a Newton's cradle
go at their own speeds in front of a pegboard; a grey wedge and a steel rule lie still. The looks
and the arrangement are assumed; each motion is its textbook closed form, stated where it stands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from scenarios.scenes.charts.star import paint_star
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
    ellipse,
)
from scenarios.scenes.drawing.shapes import STRIPES, Cam, Surface, Win, cover, diffuse, grid, lay
from scenarios.scenes.people.bench import BOARD, bench, cradle_frame, fan_back, fan_front

__all__ = ["Workshop"]

TAU = 2 * math.pi
GRAVITY = 9.80665
"""Standard acceleration of free fall, m/s^2 (3rd CGPM, 1901)."""

# Places and sizes, metres (assumed).
FAN, FAN_HUB, FAN_TIP, BLADES = BOARD["fan"], 0.026, 0.119, 5
DISC, DISC_RADIUS, STAR_RADIUS = BOARD["disc"], 0.115, 0.047
BALL_X, BALL_RADIUS, FLOOR, BALL_SPIN = -0.018, 0.027, 0.232, 2.0
CRADLE, STRING, BEAD, BEADS = BOARD["cradle"], 0.150, 0.0185, 5
CRADLE_PHASE, BALL_PHASE = 1.75, 0.93
"""Where cradle (radians) and ball (bounces) are at t = 0: both go fast, the ball just before it
meets the bench."""

# Letters as strokes in a cell one wide and one high, y down.
GLYPHS: dict[str, tuple[tuple[tuple[float, float], ...], ...]] = {
    "V": (((0, 0), (0.5, 1), (1, 0)),),
    "I": (((0.5, 0), (0.5, 1)),),
    "F": (((0.1, 1), (0.1, 0), (0.95, 0)), ((0.1, 0.48), (0.8, 0.48))),
    "O": (((0.5, 0), (0.9, 0.18), (1, 0.5), (0.9, 0.82), (0.5, 1), (0.1, 0.82), (0, 0.5),
           (0.1, 0.18), (0.5, 0)),),
    "R": (((0.1, 1), (0.1, 0), (0.7, 0), (0.95, 0.14), (0.95, 0.38), (0.7, 0.52), (0.1, 0.52)),
          ((0.55, 0.52), (1, 1))),
    "M": (((0, 1), (0.04, 0), (0.5, 0.7), (0.96, 0), (1, 1)),),
}  # fmt: skip
LETTER_RADIUS, LETTER_HIGH, LETTER_WIDE, LETTER_STEP = 0.082, 0.027, 0.021, 0.39


@lru_cache(maxsize=64)
def _blade(win: Win, cam: Cam) -> tuple[Any, ...]:
    """What of the fan stays while it turns: angle in blade periods (swept back outwards), a blade's
    half width there and pixels per period along its normal, pixels outside the ring, the circle's
    direction, and the tone of the plastic. Bands of pixels in float32."""
    x, y = grid(win, cam)
    x, y = x - FAN[0], y - FAN[1]
    r = np.sqrt(x * x + y * y) + 1e-9
    s = np.clip((r - FAN_HUB) / (FAN_TIP - FAN_HUB), 0.0, 1.0)
    angle = (np.arctan2(y, x) - 0.75 * s * s) * (BLADES / TAU)
    half = (0.20 + 0.19 * s) * np.sqrt(1.0 - np.clip((s - 0.62) / 0.40, 0.0, 1.0) ** 2)
    slope = 1.0 / np.sqrt(1.0 + (1.5 * s * r / (FAN_TIP - FAN_HUB)) ** 2)
    scale = TAU / BLADES * r * slope / cam[0]
    outside = np.maximum(r - FAN_TIP, 0.8 * FAN_HUB - r) / cam[0]
    kept = (angle, half, scale, outside, -y / r, x / r, 0.66 * (0.72 + 0.28 * s))
    return tuple(a.astype(np.float32) for a in kept)


def paint_fan(image: Any, win: Win, cam: Cam, turn: float) -> None:
    """Lay the fan's blades, turned by `turn` radians clockwise as seen.

    A blade is the part of the ring between hub and tip within an angle of its middle line that
    widens outwards; distance is along the circle or the radius, whichever is nearer. Pitch and
    curve lean its normal along the circle, so that each blade flashes as it passes the light.
    """
    angle, half, scale, outside, cx, cy, tone = _blade(win, cam)
    a = angle - np.float32(turn * BLADES / TAU)
    a -= np.round(a)
    part = cover(np.maximum((np.abs(a) - half) * scale, outside))
    lean = 0.30 + 0.55 * np.clip(a / half, -1.0, 1.0)
    lay(image, win, part, tone * diffuse(cx * lean, cy * lean))


@dataclass(frozen=True)
class Workshop(Drawn):
    """The bench.

    shape: (height, width) in pixels, each 8 to 2000. fan, disc: revolutions per second, 0 to 200
    and 0 to 100. bounce: height of the ball's hops, 0.01 to 0.4 m. swing: the cradle's amplitude,
    0 to 0.6 rad. field: metres that the picture's shorter side sees, 0.2 to 5.

    With the defaults the tips of the fan's blades pass at 18 m/s (1440 turns a minute, a desk fan
    at its fastest), the disc's rim at 9, the ball at 2.4 and the cradle's beads at 0.6.
    ValueError for values out of range.
    """

    shape: tuple[int, int]
    fan: float = 24.0
    disc: float = 12.0
    bounce: float = 0.30
    swing: float = 0.50
    field: float = 0.8

    def __post_init__(self) -> None:
        check_shape(self.shape)
        check_number("fan", self.fan, 0.0, 200.0, "revolutions per second")
        check_number("disc", self.disc, 0.0, 100.0, "revolutions per second")
        check_number("bounce", self.bounce, 0.01, 0.4, "m")
        check_number("swing", self.swing, 0.0, 0.6, "rad")
        check_number("field", self.field, 0.2, 5.0, "m")

    @property
    def _view(self) -> View:
        return View(self.shape, self.field)

    def canvas(self) -> Canvas:
        return _canvas(self)

    def speed(self) -> float:
        """Upper bound of any edge's speed, pixels per second: the fastest of the parts."""
        return max(self._speeds()) / self._view.pixel

    def _speeds(self) -> tuple[float, float, float, float]:
        """Of fan, disc, ball and cradle, metres per second."""
        return (
            TAU * self.fan * FAN_TIP,
            TAU * self.disc * DISC_RADIUS,
            math.sqrt(2 * GRAVITY * self.bounce) + TAU * BALL_SPIN * BALL_RADIUS,
            self.swing * math.sqrt(GRAVITY / STRING) * (STRING + BEAD),
        )

    def fan_angle(self, t: float) -> float:
        """Radians that the fan has turned at t, clockwise as seen, within a turn."""
        return TAU * math.fmod(self.fan * check_instant(t), 1.0)

    def disc_angle(self, t: float) -> float:
        """Radians that the disc has turned at t, clockwise as seen, within a turn."""
        return TAU * math.fmod(self.disc * check_instant(t), 1.0)

    def ball(self, t: float) -> tuple[float, float]:
        """The ball's centre (x, y) in metres at t: free fall between elastic hops, height
        4 h s (1 - s) with s the part of the hop, of 2 sqrt(2 h / g), that has passed."""
        s = math.fmod(check_instant(t) / (2 * math.sqrt(2 * self.bounce / GRAVITY)), 1.0)
        s = math.fmod(s + BALL_PHASE + 1.0, 1.0)
        return BALL_X, FLOOR - BALL_RADIUS - 4 * self.bounce * s * (1 - s)

    def cradle(self, t: float) -> tuple[float, float]:
        """Angles of the first and the last bead at t, radians from hanging, outwards: a harmonic
        swing A cos(w t), w = sqrt(g / L), handed from one to the other at each meeting (small
        angles; a swing of 0.5 rad is 1.6 % slower in truth, which is not modelled)."""
        w = math.sqrt(GRAVITY / STRING)
        a = self.swing * math.cos(TAU * math.fmod(w * check_instant(t) / TAU, 1.0) + CRADLE_PHASE)
        return max(-a, 0.0), max(a, 0.0)

    def points(self) -> list[tuple[int, int, str]]:
        """Characteristic pixels (row, column, label)."""
        view = self._view
        at = {
            "lit wall": (-0.30, -0.26),
            "pegboard hole": (0.3501, -0.2501),
            "fan blade, middle": (FAN[0] + 0.062, FAN[1] - 0.020),
            "fan blade, tip": (FAN[0] + 0.064, FAN[1] + 0.078),
            "disc, lettering": (DISC[0], DISC[1] + LETTER_RADIUS),
            "disc, spokes": (DISC[0] + 0.030, DISC[1]),
            "ball passes": (BALL_X, 0.14),
            "first bead passes": (CRADLE[0] - 2 * 2 * BEAD - 0.035, CRADLE[1] + STRING - 0.010),
            "bench": (0.02, 0.295),
            "white step": (BOARD["wedge"][0] + 0.113, BOARD["wedge"][1]),
            "dark step": (BOARD["wedge"][0] - 0.113, BOARD["wedge"][1]),
        }
        return [(*view.point(x, y), label) for label, (x, y) in at.items()]


@lru_cache(maxsize=2)
def _canvas(scene: Workshop) -> Canvas:
    """The scene's layers: kept beside the scene, so that this stays a plain value."""
    fan, disc, ball, cradle = scene._speeds()

    def square(x: float, y: float, r: float) -> tuple[float, float, float, float]:
        return x - r, y - r, x + r, y + r

    def blades(t: float) -> list[Item]:
        return [Item(square(*FAN, FAN_TIP), paint_fan, (scene.fan_angle(t),))]

    long = STRING + 2 * BEAD
    hop = (BALL_X - 0.2, FLOOR - scene.bounce - 0.1, BALL_X + 0.2, FLOOR + 0.1)
    swing = (CRADLE[0] - long, CRADLE[1] - 0.01, CRADLE[0] + long, CRADLE[1] + long)
    return Canvas(
        scene._view,
        (
            Layer((*bench(), *_card(), *fan_back())),
            Layer(items=blades, speed=fan, reach=square(*FAN, FAN_TIP)),
            Layer(tuple(fan_front())),
            Layer(
                items=lambda t: _disc(scene.disc_angle(t)), speed=disc,
                reach=square(*DISC, DISC_RADIUS + 0.002),
            ),
            Layer(tuple(_axle())),
            Layer(items=lambda t: _ball(scene, t), speed=ball, reach=hop),
            Layer((*cradle_frame(), *_beads((0.0,) * (BEADS - 2)))),
            Layer(items=lambda t: _swinging(scene, t), speed=cradle, reach=swing),
        ),
    )  # fmt: skip


def _card() -> list[Item]:
    """What of the disc looks the same while it turns: its rim and card."""
    x, y = DISC
    return [
        ellipse(x, y, DISC_RADIUS, DISC_RADIUS, 0.10),
        ellipse(x, y, DISC_RADIUS - 0.007, DISC_RADIUS - 0.007, 0.80),
    ]


def _disc(turn: float) -> list[Item]:
    """The disc's star and lettering."""
    x, y = DISC
    r = STAR_RADIUS
    star = (x, y, r, 12, 12 * turn / TAU, "square", 0.44, 0.90)
    return [
        Item((x - r, y - r, x + r, y + r), paint_star, star),
        body(_lettering(turn), Surface(0.04, round=0.0)),
    ]


def _axle() -> list[Item]:
    """The ring around the disc's star, and the nut."""
    x, y = DISC
    return [
        ellipse(x, y, STAR_RADIUS, STAR_RADIUS, 0.06, ring=0.0012),
        ellipse(x, y, 0.0085, 0.0085, 0.45, lit=1.0, shine=0.3),
    ]


def _lettering(turn: float) -> Any:
    """Capsule rows of the disc's two words and the dots between them."""
    rows = _letters()
    cos, sin = math.cos(turn), math.sin(turn)
    spin = np.array([[cos, sin], [-sin, cos]])
    return np.hstack([rows[:, 0:2] @ spin + DISC, rows[:, 2:4] @ spin + DISC, rows[:, 4:6]])


@lru_cache(maxsize=1)
def _letters() -> Any:
    """The same before it turns, about the disc's centre: (n, 6)."""
    rows: list[tuple[float, ...]] = []
    for word in (0.0, math.pi):
        for m, letter in enumerate("VIFORM"):
            angle = word + (m - 2.5) * LETTER_STEP
            cos, sin = math.cos(angle), math.sin(angle)
            for stroke in GLYPHS[letter]:
                points = []
                for u, v in stroke:
                    a = (u - 0.5) * LETTER_WIDE
                    b = (v - 0.5) * LETTER_HIGH - LETTER_RADIUS
                    points.append((cos * a - sin * b, sin * a + cos * b))
                rows += polyline(points, 0.0026, 0.0026, 0.0026)
        x, y = LETTER_RADIUS * math.cos(word), LETTER_RADIUS * math.sin(word)
        rows.append((x, y, x, y, 0.004, 0.004))
    return np.asarray(rows)


def _ball(scene: Workshop, t: float) -> list[Item]:
    """The ball and its shadow on the bench, which fades and widens as the ball rises."""
    x, y = scene.ball(t)
    high = FLOOR - BALL_RADIUS - y
    wide = BALL_RADIUS * (0.75 + 1.6 * high)
    depth = -0.75 / (1.0 + high / 0.06)
    skin = Surface(
        0.62, STRIPES, period=0.027, contrast=0.62, x=x, y=y, shine=0.25, gloss=30.0,
        turn=TAU * math.fmod(BALL_SPIN * t, 1.0),
    )  # fmt: skip
    return [
        blob(x + 0.10 * high + 0.006, FLOOR - 0.002, wide, 0.30 * wide, depth),
        body([(x, y, x, y, BALL_RADIUS, BALL_RADIUS)], skin),
    ]


def _bead(x: float, y: float, angle: float) -> list[Item]:
    """A steel bead on its string, hung from (x, y)."""
    bx, by = x + STRING * math.sin(angle), y + STRING * math.cos(angle)
    string = [(x, y, bx, by, 0.0007, 0.0007)]
    return [
        body(string, Surface(0.75, round=0.3)),
        ellipse(bx, by, BEAD, BEAD, 0.36, lit=1.0, shine=0.5),
        blob(bx, by + 0.45 * BEAD, 0.55 * BEAD, 0.16 * BEAD, -0.45),
        blob(bx + 0.05 * BEAD, by + 0.74 * BEAD, 0.18 * BEAD, 0.06 * BEAD, 0.8),
        ellipse(bx - 0.34 * BEAD, by - 0.38 * BEAD, 0.16 * BEAD, 0.12 * BEAD, 0.97, turn=-0.7),
    ]


def _beads(angles: tuple[float, ...]) -> list[Item]:
    """The middle beads, which hang still."""
    items: list[Item] = []
    for m, angle in enumerate(angles):
        items += _bead(CRADLE[0] + (m + 1 - (BEADS - 1) / 2) * 2 * BEAD, CRADLE[1], angle)
    return items


def _swinging(scene: Workshop, t: float) -> list[Item]:
    """The two outer beads."""
    first, last = scene.cradle(t)
    far = (BEADS - 1) * BEAD
    return _bead(CRADLE[0] - far, CRADLE[1], -first) + _bead(CRADLE[0] + far, CRADLE[1], last)
