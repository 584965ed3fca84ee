"""Demosaicing against cases that linear filters of these coefficients reproduce exactly."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.light.mosaic import (
    FILTERS,
    Mosaic,
    balanced,
    delta_e,
    delta_e_2000,
    fitted_matrix,
    in_colour,
    lab,
)

RESPONSE = np.array([[0.30, 0.06, 0.01], [0.04, 0.45, 0.05], [0.01, 0.05, 0.20]])
"""Rows of unequal sum, colours that mix."""


@pytest.mark.parametrize("name", FILTERS)
def test_cells_are_those_of_the_name(name: str) -> None:
    cells = Mosaic(name, RESPONSE).colour((5, 7))
    letters = np.array(list("rgb"))[cells]
    assert "".join(letters[:2, :2].ravel()) == name
    np.testing.assert_array_equal(cells[2:, 2:], cells[:-2, :-2])


@pytest.mark.parametrize("name", FILTERS)
def test_a_uniform_colour_is_read_back(name: str) -> None:
    mosaic, colour = Mosaic(name, RESPONSE), np.array([0.7, 0.3, 0.9], np.float32)
    rgb = np.broadcast_to(colour, (9, 12, 3))
    plane = mosaic.mixed(rgb)
    rows = mosaic.response @ colour / mosaic.white
    np.testing.assert_allclose(plane, rows[mosaic.colour((9, 12))], rtol=1e-6)
    np.testing.assert_allclose(in_colour(mosaic, plane), rgb, atol=2e-6)


@pytest.mark.parametrize("name", FILTERS)
def test_a_white_ramp_is_read_back(name: str) -> None:
    """Away from the border, where mirrored pixels bend the ramp."""
    y, x = np.mgrid[:12, :16].astype(np.float32)
    ramp = 0.1 + 0.03 * y + 0.02 * x
    mosaic = Mosaic(name, RESPONSE)
    rgb = np.repeat(ramp[..., None], 3, axis=2)
    made = in_colour(mosaic, mosaic.mixed(rgb))
    np.testing.assert_allclose(made[2:-2, 2:-2], rgb[2:-2, 2:-2], atol=5e-6)
    np.testing.assert_array_equal(made.shape, (12, 16, 3))


def test_white_is_balanced() -> None:
    mosaic = Mosaic("grbg", RESPONSE)
    white = mosaic.mixed(np.ones((8, 8, 3), np.float32))
    np.testing.assert_allclose(white, mosaic.neutral((8, 8)), rtol=1e-6)
    assert white.max() == pytest.approx(1)
    np.testing.assert_allclose(balanced(mosaic, white), 1, rtol=1e-6)


def test_balanced_colours_are_those_of_the_camera() -> None:
    mosaic, colour = Mosaic("bggr", RESPONSE), np.array([0.2, 0.8, 0.5])
    plane = mosaic.mixed(np.broadcast_to(colour, (6, 6, 3)).astype(np.float32))
    seen = RESPONSE @ colour / RESPONSE.sum(axis=1)
    np.testing.assert_allclose(balanced(mosaic, plane)[3, 3], seen, rtol=1e-6)


def test_the_colour_difference_of_grey_levels_is_that_of_lightness() -> None:
    """L* = 116 Y^(1/3) - 16 for Y above (6/29)^3 (CIE 15)."""
    levels = np.array([0.9, 0.5, 0.1, 0.02], np.float32)
    grey = np.repeat(levels[None, :, None], 3, axis=2)
    lightness = 116 * np.cbrt(levels.astype(np.float64)) - 16
    found = delta_e(grey, np.ones_like(grey))
    np.testing.assert_allclose(found[0], 100 - lightness, atol=0.05)


PAIRS = np.array([
    (50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425),
    (50.0, 3.1571, -77.2803, 50.0, 0.0, -82.7485, 2.8615),
    (50.0, 2.8361, -74.02, 50.0, 0.0, -82.7485, 3.4412),
    (50.0, -1.3802, -84.2814, 50.0, 0.0, -82.7485, 1.0),
    (50.0, -1.1848, -84.8006, 50.0, 0.0, -82.7485, 1.0),
    (50.0, -0.9009, -85.5211, 50.0, 0.0, -82.7485, 1.0),
    (50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669),
    (50.0, -1.0, 2.0, 50.0, 0.0, 0.0, 2.3669),
    (50.0, 2.49, -0.001, 50.0, -2.49, 0.0009, 7.1792),
    (50.0, 2.49, -0.001, 50.0, -2.49, 0.001, 7.1792),
    (50.0, 2.49, -0.001, 50.0, -2.49, 0.0011, 7.2195),
    (50.0, 2.49, -0.001, 50.0, -2.49, 0.0012, 7.2195),
    (50.0, -0.001, 2.49, 50.0, 0.0009, -2.49, 4.8045),
    (50.0, -0.001, 2.49, 50.0, 0.001, -2.49, 4.8045),
    (50.0, -0.001, 2.49, 50.0, 0.0011, -2.49, 4.7461),
    (50.0, 2.5, 0.0, 50.0, 0.0, -2.5, 4.3065),
    (50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.1492),
    (50.0, 2.5, 0.0, 61.0, -5.0, 29.0, 22.8977),
    (50.0, 2.5, 0.0, 56.0, -27.0, -3.0, 31.903),
    (50.0, 2.5, 0.0, 58.0, 24.0, 15.0, 19.4535),
    (50.0, 2.5, 0.0, 50.0, 3.1736, 0.5854, 1.0),
    (50.0, 2.5, 0.0, 50.0, 3.2972, 0.0, 1.0),
    (50.0, 2.5, 0.0, 50.0, 1.8634, 0.5757, 1.0),
    (50.0, 2.5, 0.0, 50.0, 3.2592, 0.335, 1.0),
    (60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644),
    (63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.263),
    (61.2901, 3.7196, -5.3901, 61.4292, 2.248, -4.962, 1.8731),
    (35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645),
    (22.7233, 20.0904, -46.694, 23.0331, 14.973, -42.5619, 2.0373),
    (36.4612, 47.858, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146),
    (90.8027, -2.0831, 1.441, 91.1528, -1.6435, 0.0447, 1.4441),
    (90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381),
    (6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377),
    (2.0776, 0.0795, -1.135, 0.9033, -0.0636, -0.5514, 0.9082),
])  # fmt: skip
"""L*, a*, b* of two colours, and CIEDE2000 (Sharma, Wu and Dalal, Color Res. Appl. 30:21, 2005,
table 1)."""


def test_ciede2000_of_the_published_pairs() -> None:
    assert PAIRS.shape == (34, 7)
    one, two = PAIRS[:, :3], PAIRS[:, 3:6]
    for found in (delta_e_2000(one, two), delta_e_2000(two, one)):
        assert np.abs(found - PAIRS[:, 6]).max() < 1e-4
    assert (delta_e_2000(one, one) == 0).all()


def test_lab_of_the_corners_of_srgb() -> None:
    """White and mid grey by definition, the red primary by IEC 61966-2-1 and CIE 15."""
    found = lab([[1, 1, 1], [0, 0, 0], [0.18418652, 0.18418652, 0.18418652], [1, 0, 0]])
    expected = [[100, 0, 0], [0, 0, 0], [50, 0, 0], [53.24, 80.09, 67.20]]
    np.testing.assert_allclose(found, expected, atol=0.01)


def test_a_matrix_that_mixes_colours_is_found_and_white_stays_white() -> None:
    random = np.random.default_rng(1)
    camera = np.array([[0.7, 0.25, 0.05], [0.1, 0.8, 0.1], [0.02, 0.18, 0.8]])
    true = random.random((24, 3))
    np.testing.assert_allclose(
        fitted_matrix(true @ camera.T, true), np.linalg.inv(camera), atol=1e-12
    )
    noisy = fitted_matrix(true @ camera.T + random.normal(0, 0.02, (24, 3)), true)
    np.testing.assert_allclose(noisy.sum(axis=1), 1, atol=1e-12)
    assert 1e-3 < np.abs(noisy - np.linalg.inv(camera)).max() < 0.2
