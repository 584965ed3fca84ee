"""Photons of a lux under light of a known spectrum.

A spectrum E (W/m2 per metre of wavelength) has 683 lm/W int E V dlambda lux and E lambda/(h c)
photons. Their ratio is independent of the size of E, so spectra are relative here.

- lamp: a black body of 2856 K (CIE standard illuminant A), the light of photocathode data sheets.
- daylight: a black body of 6504 K, the correlated colour temperature of CIE D65. The absorption
  bands of the atmosphere are left out.
- night-sky: the moonless sky at Paranal, 22.3, 22.6, 21.6, 20.9 and 19.7 mag/arcsec2 in U, B, V, R
  and I (Patat, A&A 400:1183, 2003), with the fluxes of magnitude 0 of Bessell (PASP 91:589, 1979).
  The logarithm of E is linear between the bands and constant outside (assumed); the bands average
  over the lines of the airglow.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.light.radiometry import LUMINOUS_EFFICACY, PLANCK, SPEED_OF_LIGHT, luminous_curve

BOLTZMANN: Final = 1.380649e-23
"""J/K, exact by definition of the SI (2019)."""
LAMP_KELVIN: Final = 2856.0
"""CIE standard illuminant A."""
DAYLIGHT_KELVIN: Final = 6504.0
"""Correlated colour temperature of CIE D65."""
Values = npt.NDArray[np.float64]
Spectrum = Callable[[Values], Values]
_BAND_UM: Final = np.array([0.36, 0.44, 0.55, 0.64, 0.79])
_ZERO_JANSKY: Final = np.array([1810.0, 4260.0, 3640.0, 3080.0, 2550.0])
_SKY_MAGNITUDES: Final = np.array([22.3, 22.6, 21.6, 20.9, 19.7])
LAMP: Final = "lamp"
_VISIBLE: Final = np.arange(380.0, 781.0)


def black_body(wavelengths_nm: Values, kelvin: float) -> Values:
    """Spectral radiant exitance of a black body, W/m2 per metre (Planck's law)."""
    metres = wavelengths_nm * 1e-9
    x = PLANCK * SPEED_OF_LIGHT / (metres * BOLTZMANN * kelvin)
    return 2 * np.pi * PLANCK * SPEED_OF_LIGHT**2 / (metres**5 * np.expm1(x))


def _night_sky(wavelengths_nm: Values) -> Values:
    """Relative: E per wavelength is E per frequency over lambda squared."""
    density = _ZERO_JANSKY * 10 ** (-0.4 * _SKY_MAGNITUDES) / _BAND_UM**2
    log = np.interp(wavelengths_nm * 1e-3, _BAND_UM, np.log(density))
    return np.exp(log - log.max())


ILLUMINANTS: Final[dict[str, Spectrum]] = {
    LAMP: lambda nm: black_body(nm, LAMP_KELVIN),
    "daylight": lambda nm: black_body(nm, DAYLIGHT_KELVIN),
    "night-sky": _night_sky,
}
"""Relative spectra by name: wavelengths (nm) to E."""


def photon_density(spectrum: Spectrum, wavelengths_nm: Values) -> Values:
    """Photons / (s m2 lx nm) at each wavelength, under one lux of this spectrum."""
    lumens = np.trapezoid(spectrum(_VISIBLE) * luminous_curve(_VISIBLE), _VISIBLE)
    energy = PLANCK * SPEED_OF_LIGHT / (wavelengths_nm * 1e-9)
    return spectrum(wavelengths_nm) / (energy * LUMINOUS_EFFICACY * lumens)
