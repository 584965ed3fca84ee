"""The static part of the waving person: torso, other arm, head and face.

The proportions are those of Drillis and Contini (1966), as printed in D. Winter, Biomechanics and
Motor Control of Human Movement, 4th ed., fig. 4.1, for a stature of 1.75 m: head and neck 0.182,
head 0.130, half shoulder breadth 0.129 of the stature. All other dimensions and tones are assumed.
"""

from __future__ import annotations

from collections.abc import Sequence

from scenarios.scenes.drawing.bodies import polyline
from scenarios.scenes.drawing.canvas import Item, blob, body, ellipse, shadow
from scenarios.scenes.drawing.shading import CHECK, HAIR, SKIN, Surface

CENTRE = -0.17
"""Position of the body's axis, m from the centre of the picture."""
SKIN_TONE = Surface(0.58, SKIN, period=0.0012, contrast=0.07, shine=0.05, gloss=14.0)
SHIRT = Surface(
    0.40, CHECK, period=0.040, contrast=0.50, x=CENTRE, folds=0.30, fold_size=0.060
)  # fmt: skip
HAIR_TONE = Surface(0.050, HAIR, period=0.0022, contrast=0.9, shine=0.06, gloss=8.0)

# Round cones (x, y, x, y, radius, radius), m; x is relative to CENTRE.
TORSO = (
    (-0.045, -0.060, -0.165, 0.038, 0.044, 0.058),  # trapezius to shoulder
    (0.045, -0.060, 0.150, 0.034, 0.044, 0.052),
    (-0.085, 0.11, -0.085, 0.16, 0.110, 0.110),  # chest
    (0.085, 0.11, 0.085, 0.16, 0.110, 0.110),
    (-0.05, 0.28, 0.05, 0.28, 0.125, 0.125),
    (0.0, 0.40, 0.0, 0.46, 0.185, 0.185),
)
LEGS = (
    (-0.075, 0.50, -0.095, 0.92, 0.098, 0.066),
    (-0.095, 0.92, -0.100, 1.32, 0.066, 0.046),
    (0.075, 0.50, 0.095, 0.92, 0.098, 0.066),
    (0.095, 0.92, 0.100, 1.32, 0.066, 0.046),
)
LOW_HAND = (
    (-0.215, 0.62, -0.205, 0.70, 0.030, 0.030),
    (-0.205, 0.70, -0.190, 0.79, 0.030, 0.012),
)
SLEEVE = (
    (-0.178, 0.060, -0.222, 0.330, 0.062, 0.054),
    (-0.222, 0.330, -0.215, 0.620, 0.054, 0.042),
)
NECK = ((0.0, -0.16, 0.0, -0.045, 0.049, 0.052), (0.0, -0.045, 0.0, -0.008, 0.050, 0.014))
HEAD = (
    (0.0, -0.278, 0.0, -0.235, 0.079, 0.073),
    (0.0, -0.235, 0.0, -0.176, 0.073, 0.048),
    (0.0, -0.176, 0.0, -0.166, 0.046, 0.040),
)
EARS = (
    (-0.077, -0.240, -0.072, -0.212, 0.013, 0.009),
    (0.077, -0.240, 0.072, -0.212, 0.013, 0.009),
)
# Relief: (x, y, radius x, radius y, height), m.
FACE = (
    (0.000, -0.236, 0.0085, 0.020, 0.0055),  # bridge of the nose
    (0.000, -0.207, 0.0100, 0.009, 0.0085),  # its tip
    (-0.012, -0.204, 0.0060, 0.006, 0.0035),
    (0.012, -0.204, 0.0060, 0.006, 0.0035),
    (-0.031, -0.262, 0.0230, 0.008, 0.0028),  # brow ridges
    (0.031, -0.262, 0.0230, 0.008, 0.0028),
    (-0.031, -0.246, 0.0170, 0.010, -0.0048),  # eye sockets
    (0.031, -0.246, 0.0170, 0.010, -0.0048),
    (-0.043, -0.218, 0.0170, 0.014, 0.0030),  # cheeks
    (0.043, -0.218, 0.0170, 0.014, 0.0030),
    (0.000, -0.192, 0.0035, 0.006, -0.0008),  # philtrum
    (0.000, -0.1825, 0.0170, 0.0045, 0.0016),  # lips
    (0.000, -0.1705, 0.0140, 0.0050, 0.0026),
    (0.000, -0.161, 0.0160, 0.0050, -0.0018),
    (0.000, -0.146, 0.0150, 0.0110, 0.0034),  # chin
)


def _arc(x: float, y: float, wide: float, bow: float, n: int = 6) -> list[tuple[float, float]]:
    """Points of a parabolic arc around (x, y), m: half width `wide`, height of the middle `bow`."""
    return [
        (CENTRE + x + wide * u, y - bow * (1 - u * u))
        for u in (2 * m / n - 1 for m in range(n + 1))
    ]


def _shift(rows: Sequence[Sequence[float]]) -> list[tuple[float, ...]]:
    """Rows of cones (x, y, x, y, ...), shifted to the body's axis."""
    return [(r[0] + CENTRE, r[1], r[2] + CENTRE, *r[3:]) for r in rows]


def _eye(side: float) -> list[Item]:
    """One eye; `side` is -1 for the left of the picture, 1 for the right."""
    x, y = side * 0.0315, -0.2445
    cx = CENTRE + x
    lid = _arc(x, y + 0.0005, 0.0148, 0.0068)
    return [
        blob(cx, y - 0.001, 0.015, 0.008, -0.30),
        ellipse(cx, y - 0.0008, 0.0132, 0.0052, 0.50, lit=0.25),
        ellipse(cx + 0.0006, y - 0.0014, 0.0060, 0.0056, 0.10, lit=0.2),
        ellipse(cx + 0.0006, y - 0.0014, 0.0027, 0.0027, 0.015),
        ellipse(cx - 0.0014, y - 0.0036, 0.0012, 0.0012, 0.95),
        blob(cx, y - 0.0065, 0.014, 0.0028, -0.45),
        shadow(polyline(lid, 0.0006, 0.0016, 0.0010), 0.0006, 0.90, 0.001),
        shadow(polyline(_arc(x, y - 0.0052, 0.0145, 0.0065), 0.0002, 0.0007, 0.0004), 0.0012, 0.45),
        shadow(polyline(_arc(x, y + 0.0022, 0.0130, -0.0030), 0.0003, 0.0008, 0.0003), 0.001, 0.4),
        body(
            polyline(_arc(x + side * 0.001, y - 0.0175, 0.0185, 0.0052), 0.0014, 0.0034, 0.0014),
            HAIR_TONE._replace(albedo=0.075, x=cx, y=y, turn=side * 1.2, contrast=0.6), 0.002,
        ),
    ]  # fmt: skip


def _mouth() -> list[Item]:
    lip = SKIN_TONE._replace(albedo=0.33, shine=0.08, gloss=30.0, contrast=0.05)
    y = -0.1765
    return [
        body(polyline(_arc(0, y - 0.0014, 0.0225, -0.0036), 0.0006, 0.0040, 0.0006), lip, 0.002),
        body(polyline(_arc(0, y + 0.0026, 0.0190, -0.0052), 0.0006, 0.0048, 0.0006), lip, 0.002),
        shadow(polyline(_arc(0, y - 0.0008, 0.0255, -0.0046), 0.0005, 0.0009, 0.0005), 0.001, 0.7),
        blob(CENTRE - 0.0265, y - 0.001, 0.0035, 0.0030, -0.30),
        blob(CENTRE + 0.0265, y - 0.001, 0.0035, 0.0030, -0.30),
        blob(CENTRE, y + 0.0135, 0.012, 0.0032, -0.22),
    ]


def _head() -> list[Item]:
    """Head, hair and face, from back to front."""
    c = CENTRE
    crown = [
        (c - 0.0765, -0.243, c - 0.072, -0.290, 0.0045, 0.016),
        (c - 0.070, -0.290, c - 0.040, -0.330, 0.018, 0.034),
        (c - 0.040, -0.330, c + 0.015, -0.342, 0.034, 0.036),
        (c + 0.015, -0.342, c + 0.045, -0.326, 0.036, 0.034),
        (c + 0.045, -0.326, c + 0.070, -0.290, 0.034, 0.018),
        (c + 0.072, -0.290, c + 0.0765, -0.243, 0.016, 0.0045),
    ]
    fringe = [
        (c - 0.066, -0.292, c - 0.020, -0.322, 0.014, 0.024),
        (c - 0.020, -0.322, c + 0.046, -0.308, 0.024, 0.018),
        (c + 0.046, -0.308, c + 0.070, -0.285, 0.018, 0.011),
    ]
    strands = HAIR_TONE._replace(x=c - 0.02, y=-0.36, turn=-1.15)
    bumps = [(x + c, y, a, b, h) for x, y, a, b, h in FACE]
    items = [
        body(_shift(NECK), SKIN_TONE._replace(albedo=0.46), 0.01),
        blob(c + 0.012, -0.112, 0.052, 0.026, -0.62),
        body(_shift(EARS), SKIN_TONE._replace(albedo=0.44), 0.01),
        blob(c - 0.076, -0.228, 0.005, 0.011, -0.40),
        blob(c + 0.076, -0.228, 0.005, 0.011, -0.40),
        body(crown, strands, 0.02),
        body(_shift(HEAD), SKIN_TONE, 0.035, bumps),
        blob(c, -0.300, 0.070, 0.018, -0.42),
        blob(c + 0.055, -0.205, 0.022, 0.045, -0.16),
        blob(c - 0.032, -0.220, 0.016, 0.012, 0.10),
        blob(c - 0.0075, -0.2005, 0.0032, 0.0018, -0.75),
        blob(c + 0.0075, -0.2005, 0.0032, 0.0018, -0.75),
        blob(c + 0.009, -0.194, 0.011, 0.005, -0.20),
        blob(c, -0.165, 0.045, 0.035, -0.07),
    ]
    items += _eye(-1.0) + _eye(1.0) + _mouth()
    items += [body(crown + fringe, strands, 0.015)]
    return items


def _collar(side: float, lower: float = 0.0) -> list[tuple[float, ...]]:
    """One leaf of the collar: cones along the neck, then down to the tip."""
    c = CENTRE
    return [
        (c + side * 0.050, -0.098 + lower, c + side * 0.034, -0.048 + lower, 0.0090, 0.0190),
        (c + side * 0.034, -0.048 + lower, c + side * 0.031, 0.012 + lower, 0.0190, 0.0050),
        (c + side * 0.034, -0.048 + lower, c + side * 0.011, -0.004 + lower, 0.0150, 0.0100),
    ]


def person() -> list[Item]:
    """The person without the waving arm, from back to front."""
    c = CENTRE
    shirt = _shift(TORSO)
    cuff = SHIRT._replace(x=c - 0.2, y=0.2, turn=0.18)
    lapel = SHIRT._replace(albedo=0.42, turn=0.9, folds=0.08, round=0.55)
    items = [
        body(_shift(LEGS), Surface(0.09, folds=0.25, fold_size=0.08), 0.02),
        body(_shift(LOW_HAND), SKIN_TONE, 0.01),
        body(_shift(SLEEVE), cuff, 0.03),
        body(shirt, SHIRT, 0.05, [(c + x, 0.13, 0.06, 0.05, 0.012) for x in (-0.07, 0.07)]),
        blob(c - 0.175, 0.20, 0.016, 0.11, -0.45, 0.05),
        blob(c + 0.02, -0.01, 0.075, 0.036, -0.35),
    ]  # fmt: skip
    items += _head()
    items += [
        shadow(_collar(-1.0, 0.005), 0.008, 0.55, 0.01),
        shadow(_collar(1.0, 0.005), 0.008, 0.55, 0.01),
        body(_collar(-1.0), lapel, 0.01),
        body(_collar(1.0), lapel._replace(turn=-0.9), 0.01),
        shadow([(c, 0.01, c, 0.8, 0.0012, 0.0012)], 0.002, 0.5),
    ]  # fmt: skip
    for m in range(7):
        y = 0.040 + 0.085 * m
        items += [
            blob(c + 0.002, y + 0.003, 0.006, 0.006, -0.4),
            ellipse(c, y, 0.0056, 0.0056, 0.62, lit=0.6, shine=0.2),
            ellipse(c, y, 0.0014, 0.0014, 0.2),
        ]
    return items


def person_shadow(dx: float, dy: float, soft: float, depth: float) -> list[Item]:
    """The shadow of the static part on a wall.

    Args:
        dx, dy: offset of the shadow, m.
        soft: half width of its edge, m.
        depth: share of the light that it takes away.
    """
    rows = _shift(TORSO + LEGS + SLEEVE + NECK + HEAD)
    rows += [(CENTRE, -0.305, CENTRE, -0.30, 0.092, 0.09)]
    moved = [(r[0] + dx, r[1] + dy, r[2] + dx, r[3] + dy, *r[4:]) for r in rows]
    return [shadow(moved, soft, depth, 0.05)]
