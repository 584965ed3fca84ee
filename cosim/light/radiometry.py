"""From illuminance to photons and photoelectrons.

Convention: light is stated in lux and converted as if it were monochromatic, by default at 555 nm.
One lux is then 4.09e15 photons a second and square metre, the value of Huang 2022 (section 4.3).
White light of the same illuminance has more photons (1.1e16 for daylight within 400-700 nm), so a
figure in electrons always states its wavelength.

Under light of a known spectrum E (W/m2 per metre of wavelength), there are 683 lm/W int E V dlambda
lux and E lambda/(h c) photons. Their ratio is independent of the size of E, so spectra are relative
here.

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
from functools import cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

PLANCK: Final = 6.62607015e-34
"""J s, exact by definition of the SI (2019)."""
SPEED_OF_LIGHT: Final = 299_792_458.0
"""m/s, exact by definition of the SI."""
LUMINOUS_EFFICACY: Final = 683.0
"""lm/W at 540 THz, exact by definition of the SI."""
# CIE 1924 photopic luminous efficiency V(lambda), 380 to 780 nm in steps of 10 nm
# (ISO/CIE 23539:2023, Table 1 holds the same values every nanometre).
_V: Final = np.array(
    [
        0.000039, 0.00012, 0.000396, 0.00121, 0.0040, 0.0116, 0.023, 0.038, 0.060, 0.09098,
        0.13902, 0.20802, 0.323, 0.503, 0.710, 0.862, 0.954, 0.99495, 0.995, 0.952,
        0.870, 0.757, 0.631, 0.503, 0.381, 0.265, 0.175, 0.107, 0.061, 0.032,
        0.017, 0.00821, 0.004102, 0.002091, 0.001047, 0.00052, 0.000249, 0.00012, 0.00006,
        0.00003, 0.000015,
    ]
)  # fmt: skip
_V_NM: Final = np.arange(380, 790, 10)
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


def photons_per_lux(wavelength_nm: float = 555.0) -> float:
    """Photons / (s m2 lx) at one wavelength: lambda / (683 V(lambda) h c); 4.09e15 at 555 nm."""
    watts = 1 / (LUMINOUS_EFFICACY * luminous_efficiency(wavelength_nm))
    return watts * wavelength_nm * 1e-9 / (PLANCK * SPEED_OF_LIGHT)


def luminous_efficiency(wavelength_nm: float) -> float:
    """V(lambda), 1 at 555 nm, from a cubic spline of the logarithm of the table. It is within 1 %
    of the finer CIE table, and within 4 % below 430 nm.

    Raises ValueError outside 380 to 780 nm, where lux does not determine photons.
    """
    if not 380 <= wavelength_nm <= 780:
        raise ValueError(f"wavelength must be 380 to 780 nm, not {wavelength_nm:g} nm")
    if wavelength_nm == 555:
        return 1.0  # by definition
    return float(np.exp(_spline()(wavelength_nm)))


def luminous_curve(wavelengths_nm: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """V(lambda) of any shape, for integrals over a spectrum: the spline of `luminous_efficiency`,
    and 0 outside 380 to 780 nm, where less than 1e-4 of the area of V lies."""
    inside = (wavelengths_nm >= _V_NM[0]) & (wavelengths_nm <= _V_NM[-1])
    held = np.clip(wavelengths_nm, _V_NM[0], _V_NM[-1])
    return np.where(inside, np.exp(_spline()(held)), 0.0)


@cache
def _spline() -> Any:
    from scipy.interpolate import CubicSpline

    return CubicSpline(_V_NM, np.log(_V))


def photon_density(spectrum: Spectrum, wavelengths_nm: Values) -> Values:
    """Photons / (s m2 lx nm) at each wavelength, under one lux of this spectrum."""
    lumens = np.trapezoid(spectrum(_VISIBLE) * luminous_curve(_VISIBLE), _VISIBLE)
    energy = PLANCK * SPEED_OF_LIGHT / (wavelengths_nm * 1e-9)
    return spectrum(wavelengths_nm) / (energy * LUMINOUS_EFFICACY * lumens)


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
