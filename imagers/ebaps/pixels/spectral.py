"""Spectral response of an EBAPS: photocathode and silicon under light of a known spectrum.

Document 002, section 1, prints the working band, 0.3 to 0.97 um, and no curve. The quantum
efficiency is assumed to rise linearly from the band's beginning to a plateau, to stay there up to
the band gap, and to fall linearly to the band's end. The height of the plateau follows from the
response to a lamp of 2856 K, in which data sheets state photocathodes:

    electrons / (s m2 lx) = int eta(lambda) n(lambda) dlambda,

n: photons / (s m2 lx nm) of the illuminant (`cosim.light.illuminant`). A monochromatic light of
wavelength l gives eta(l) photons_per_lux(l).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.light.illuminant import ILLUMINANTS, LAMP, photon_density
from cosim.light.radiometry import photons_per_lux
from imagers.ebaps.pixels.tube import ELEMENTARY_CHARGE

__all__ = ["PHOTOCATHODES", "SILICON", "Response", "Spectral", "spectral_ratios"]

MONOCHROMATIC: Final = "monochromatic"
"""Name of light of one wavelength, beside those of `ILLUMINANTS`."""

Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Response:
    """Quantum efficiency against wavelength: a trapezoid.

    Attributes:
        begin, rise, fall, end: its corners, nm.
        sensitivity: under a lamp of 2856 K, uA/lm.
    """

    begin: float
    rise: float
    fall: float
    end: float
    sensitivity: float

    def _shape(self, nm: Values) -> Values:
        corners = (self.begin, self.rise, self.fall, self.end)
        return np.interp(nm, corners, (0.0, 1.0, 1.0, 0.0), left=0.0, right=0.0)

    def _integral(self, illuminant: str) -> float:
        nm = np.arange(self.begin, self.end + 0.5)
        density = photon_density(ILLUMINANTS[illuminant], nm)
        return float(np.trapezoid(self._shape(nm) * density, nm))

    @cached_property
    def plateau(self) -> float:
        """Largest quantum efficiency."""
        return self.sensitivity * 1e-6 / ELEMENTARY_CHARGE / self._integral(LAMP)

    def efficiency(self, nm: Values) -> Values:
        """Quantum efficiency at each wavelength (nm)."""
        return self.plateau * self._shape(nm)

    def electrons_per_lux(self, illuminant: str, wavelength_nm: float = 555.0) -> float:
        """Electrons / (s m2 lx) under an illuminant; wavelength: of `MONOCHROMATIC`."""
        if illuminant == MONOCHROMATIC:
            efficiency = float(self.efficiency(np.array(wavelength_nm)))
            return photons_per_lux(wavelength_nm) * efficiency
        return self.plateau * self._integral(illuminant)


PHOTOCATHODES: Final = {
    "GaAs": Response(300, 550, 871, 970, 1910.0),
    "GaAsP": Response(300, 480, 640, 730, 721.0),
}
"""Band ends of GaAs: document 002; its fall begins at the band gap, 1.424 eV. The other corners are
assumed: GaAsP ends near its own band gap, about 1.7 eV. 1.19e16 and 4.5e15 electrons."""
SILICON: Final = Response(300, 500, 800, 1107, 5287.0)
"""Back-thinned, 3.3e16 electrons, up to its band gap, 1.12 eV; the other corners are assumed."""


@dataclass(frozen=True)
class Spectral:
    """Electrons of a lux over those of a lux from a lamp of 2856 K.

    Attributes:
        photocathode: of the photocathode.
        silicon: of the silicon behind it, for light that passes the photocathode.
    """

    photocathode: float = 1.0
    silicon: float = 1.0


def spectral_ratios(photocathode: str, illuminant: str, wavelength_nm: float = 555.0) -> Spectral:
    """The ratios under an illuminant; exactly 1 under the lamp itself.

    ValueError for a wavelength at which the photocathode emits nothing.
    """
    cathode = PHOTOCATHODES[photocathode]
    ratios = [
        each.electrons_per_lux(illuminant, wavelength_nm) / each.electrons_per_lux(LAMP)
        for each in (cathode, SILICON)
    ]
    if ratios[0] <= 0:
        raise ValueError(
            f"the wavelength must be within {cathode.begin:g} to {cathode.end:g} nm for "
            f"{photocathode}, not {wavelength_nm:g} nm"
        )
    return Spectral(*ratios)
