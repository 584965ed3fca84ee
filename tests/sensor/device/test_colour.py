"""Response of pixels under colour filters against an independent quadrature and against limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import constants, integrate

from cosim.light.illuminant import luminous_curve
from sensor.device import colour
from sensor.device.colour import absorbed, filter_array, response


@pytest.mark.parametrize(
    ("nm", "per_cm"), [(400, 9.52e4), (500, 1.11e4), (600, 4.14e3), (700, 1.90e3), (800, 8.50e2)]
)
def test_silicon_absorbs_as_published(nm: float, per_cm: float) -> None:
    """Half of the light in ln 2 over the absorption."""
    assert absorbed(nm, math.log(2) / per_cm * 1e4) == pytest.approx(0.5, rel=1e-12)


def test_the_response_is_the_integral() -> None:
    """By adaptive quadrature, with the photons per lumen from the constants of the SI."""
    depth, counted_at = 2.0, 550.0

    def gauss(nm: float, middle: float, spread: float) -> float:
        return math.exp(-(((nm - middle) / spread) ** 2) / 2)

    def quad(f: object) -> float:
        return float(integrate.quad(f, 380, 780, limit=400, epsrel=1e-9)[0])

    def curve(nm: float) -> float:
        return float(luminous_curve(np.array([nm]))[0])

    def energy(nm: float) -> float:
        return constants.h * constants.c / (nm * 1e-9)

    at = np.array([counted_at])
    base = 1 / (683 * curve(counted_at) * energy(counted_at)) * float(absorbed(at, depth)[0])
    expected = np.empty((3, 3))
    for column, share in enumerate((0.2126, 0.7152, 0.0722)):
        primary = colour._PRIMARIES[column]
        lumens = 683 * quad(lambda nm, p=primary: gauss(nm, *p) * curve(nm))
        for row, (middle, spread, most) in enumerate(colour._DYES):
            signal = quad(
                lambda nm, p=primary, m=middle, s=spread, t=most: (
                    gauss(nm, *p) / energy(nm) * t * gauss(nm, m, s)
                    * float(absorbed(np.array([nm]), depth)[0])
                )
            )  # fmt: skip
            expected[row, column] = share * signal / lumens / base
    np.testing.assert_allclose(response(depth, counted_at), expected, rtol=2e-3)


def test_each_colour_sees_its_own_primary_most() -> None:
    made = response(3.0, 550.0)
    assert (made > 0).all()
    np.testing.assert_array_equal(made.argmax(axis=0), [0, 1, 2])
    np.testing.assert_array_equal(made.argmax(axis=1), [0, 1, 2])


def test_thin_silicon_loses_red_first() -> None:
    """Red light goes deeper: its share of the response grows with depth."""
    thin, thick = response(0.5, 550.0), response(10.0, 550.0)
    assert thick[0, 0] / thick[2, 2] > 2 * thin[0, 0] / thin[2, 2]


def test_an_array_has_the_response_of_its_chip() -> None:
    array = filter_array("gbrg", 3.0, 550.0)
    np.testing.assert_array_equal(array.response, response(3.0, 550.0))
    assert array.matrix.sum(axis=1).max() == pytest.approx(1)
