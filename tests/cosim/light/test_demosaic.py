"""Demosaicing against cases that linear filters of these coefficients reproduce exactly."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.light.mosaic import FILTERS, Mosaic, balanced, delta_e, in_colour

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
