"""Spectra of illuminants: Planck's law and the photons of a lux, against printed figures."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.light.radiometry import (
    ILLUMINANTS,
    LUMINOUS_EFFICACY,
    black_body,
    luminous_curve,
    photon_density,
)

VISIBLE = np.arange(380.0, 781.0)


def photons(name: str, low: float, high: float) -> float:
    nm = np.arange(low, high + 0.5)
    return float(np.trapezoid(photon_density(ILLUMINANTS[name], nm), nm))


def test_a_black_body_radiates_as_stefan_and_boltzmann_say() -> None:
    nm = np.arange(200.0, 200_000.0, 5.0)
    whole = np.trapezoid(black_body(nm, 2856.0), nm * 1e-9)
    assert whole == pytest.approx(5.670374419e-8 * 2856.0**4, rel=1e-5)


def test_platinum_at_its_freezing_point_has_60_candela_a_square_centimetre() -> None:
    """The definition of the candela from 1948 to 1979; 2041.4 K on the scale of 1990. One kelvin
    changes the luminance by 0.6 %."""
    exitance = np.trapezoid(black_body(VISIBLE, 2041.4) * luminous_curve(VISIBLE), VISIBLE * 1e-9)
    assert LUMINOUS_EFFICACY * exitance / np.pi == pytest.approx(60e4, rel=0.01)


@pytest.mark.parametrize(
    ("name", "high", "printed"),
    [("lamp", 700, 1.19e16), ("lamp", 900, 3.90e16), ("lamp", 1000, 5.75e16),
     ("daylight", 700, 1.1e16)],
)  # fmt: skip
def test_photons_of_a_lux(name: str, high: float, printed: float) -> None:
    assert photons(name, 400, high) == pytest.approx(printed, rel=0.01)


def test_the_night_sky_has_the_colours_of_its_magnitudes() -> None:
    """Photons a nanometre of V and I: ratio of the fluxes, times lambda over that of energy."""
    v, i = photon_density(ILLUMINANTS["night-sky"], np.array([550.0, 790.0]))
    per_frequency = 2550 / 3640 * 10 ** (0.4 * (21.6 - 19.7))
    assert i / v == pytest.approx(per_frequency * 550 / 790, rel=1e-9)
