"""Extinction, airlight and the sun against published points and closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from cosim import InputError
from link.air import Aim, levels
from link.air.radiometry import (
    SUN_SOLID_ANGLE,
    extinction,
    forward_share,
    sun_glare,
    sun_image,
    sun_lux,
)
from tests.link.air.scenes import AIR, CAMERA, OPTICS, SHAPE, make

DB = 10 / math.log(10)


@pytest.mark.parametrize(
    ("visibility", "nm", "db"),
    [
        (50, 532, 340), (200, 532, 85), (500, 532, 34), (1000, 532, 17.3), (1000, 785, 14.2),
        (1000, 1550, 10.1), (4000, 532, 4.39), (4000, 785, 3.00), (4000, 1550, 1.54),
        (10_000, 532, 1.77), (10_000, 1550, 0.44), (23_000, 532, 0.77), (23_000, 785, 0.47),
        (23_000, 1550, 0.19),
    ],
)  # fmt: skip
def test_kims_points(visibility: float, nm: float, db: float) -> None:
    """dB/km, to the digits that are printed."""
    digits = 0 if db >= 30 else 1 if db > 10 else 2
    assert extinction(visibility, nm) * 1000 * DB == pytest.approx(db, abs=0.51 * 10.0**-digits)


def test_kruse_below_six_kilometres() -> None:
    """q = 0.585 V^(1/3): 1.55 um sees further than 0.55 um through the same fog, by 2.818^q."""
    ratio = extinction(500, 550, "kruse") / extinction(500, 1550, "kruse")
    assert ratio == pytest.approx((1550 / 550) ** (0.585 * 0.5 ** (1 / 3)))
    assert extinction(20_000, 700, "kruse") == extinction(20_000, 700, "kim")
    with pytest.raises(InputError, match="visibility must be above 0"):
        extinction(0, 550)


def test_fogs_light_adds_up() -> None:
    """L e^-t + h L + A (1 - e^-t - h) for a large surface, t = 3.91 d / V at 550 nm."""
    optics = replace(OPTICS, wavelength_nm=550.0, reflectance=0.0)
    foggy = replace(AIR, visibility=10.0, ambient=2000.0)
    t = 0.391 * 2
    made, clear = levels(optics, foggy), levels(optics, replace(foggy, visibility=None))
    h = t * math.exp(-t) / 2
    assert forward_share(t) == pytest.approx(h)
    gain = clear.panel / 1000
    share = 2000 / math.pi / 1000
    assert made.on / gain / 1000 == pytest.approx(
        math.exp(-t) + h + share * (1 - math.exp(-t) - h), rel=1e-12
    )
    assert made.dimmed == pytest.approx(math.exp(-t))


def test_the_suns_solid_angle_and_light() -> None:
    """Disc of 0.53 degrees: 6.72e-5 sr; its image's lux over the image's area is what enters."""
    assert pytest.approx(math.pi / 4 * math.radians(0.53) ** 2, rel=1e-4) == SUN_SOLID_ANGLE
    sunny = replace(AIR, sun=1e5, sun_angle=0.0)
    far = replace(OPTICS, focus=1e6, f_number=8.0)  # sharp
    image = sun_image(far, Aim(), sunny, SHAPE).astype(np.float64)
    opening = math.pi / 4 * (39e-3 / 8.0) ** 2 * 0.9
    flux = image.sum() * (10e-6) ** 2
    assert flux == pytest.approx(1e5 * opening, rel=0.01)
    assert image.max() == pytest.approx(sun_lux(far, sunny), rel=0.01)
    rows, columns = np.nonzero(image > image.max() / 2)
    assert (rows.mean(), columns.mean()) == pytest.approx((23.5, 31.5), abs=0.01)
    diameter = 2 * math.sqrt(len(rows) / math.pi) * 10e-6
    assert diameter == pytest.approx(2 * 39e-3 * math.tan(math.radians(0.265)), rel=0.02)
    assert not sun_image(far, Aim(), replace(sunny, sun_angle=20.0), SHAPE).any()


def test_a_sun_beside_the_view_makes_glare() -> None:
    """Glare of what enters the lens, over the sensor's area; all of it on the dark panel."""
    sunny = replace(AIR, sun=5e4, sun_angle=15.0, glare=0.01)
    opening = math.pi / 4 * (39e-3 / 1.864) ** 2 * 0.9 * math.cos(math.radians(15))
    area = SHAPE[0] * SHAPE[1] * 1e-10
    exact = 0.01 * 5e4 * opening / area
    assert sun_glare(OPTICS, sunny, Aim(), SHAPE) == pytest.approx(exact, rel=1e-9)
    dark = make(air=sunny)._before
    assert dark is not None
    assert dark.first == pytest.approx(np.full(SHAPE, exact), rel=1e-5)
    assert sun_glare(OPTICS, replace(sunny, sun_angle=100.0), Aim(), SHAPE) == 0


def test_the_panel_hides_the_sun_behind_it() -> None:
    sunny = replace(AIR, sun=1e5, sun_angle=0.0, glare=0.0)
    air = make(air=sunny)
    assert air._before is not None
    image = air._before.first
    assert image[24, 32] == pytest.approx(0, abs=sun_lux(OPTICS, sunny) * 1e-5)
    assert image.max() > 0.2 * sun_lux(OPTICS, sunny)  # its rim, out of focus, beside the panel
    assert CAMERA.rate(float(image.max())) > 1
