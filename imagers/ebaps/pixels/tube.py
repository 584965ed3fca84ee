"""The vacuum part of an EBAPS: photocathode, acceleration, bombardment gain, lateral spread; and
the response of photocathode and silicon to light of a known spectrum (`Spectral`).

Light is given in lux of a 2856 K lamp, as is usual in night vision. A GaAs photocathode of 1910
uA/lm gives S/q = 1.19e16 electrons / (s m2 lx). In the project's convention, where a lux counts as
4.09e15 photons of 555 nm, this is an equivalent quantum efficiency of 2.91. It is above 1 because
most electrons come from infrared light, which does not contribute to lux.

An absorbed electron of energy V makes eta_c (V - V_d)/3.6 eV electrons in the silicon (3.6 eV per
pair; V_d is lost in the layer on top, with a soft threshold). A share eta_b is scattered back and
lost, which alone gives the excess noise F^2 = 1/(1 - eta_b).

Document 002, section 1, prints the working band, 0.3 to 0.97 um, and no curve. The quantum
efficiency is assumed to rise linearly from the band's beginning to a plateau, to stay there up to
the band gap, and to fall linearly to the band's end. The height of the plateau follows from the
response to a lamp of 2856 K, in which data sheets state photocathodes:

    electrons / (s m2 lx) = int eta(lambda) n(lambda) dlambda,

n: photons / (s m2 lx nm) of the illuminant (`cosim.light.radiometry`). A monochromatic light of
wavelength l gives eta(l) photons_per_lux(l).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from cosim.light.radiometry import ILLUMINANTS, LAMP, photon_density, photons_per_lux

ELEMENTARY_CHARGE: Final = 1.602176634e-19
"""C, exact by definition of the SI (2019)."""
PAIR_ENERGY: Final = 3.6
"""eV that an electron-hole pair in silicon takes of a fast electron, about."""
FANO: Final = 0.11
"""Variance over mean of the pairs that an energy makes in silicon."""
Values = npt.NDArray[np.float64]
MONOCHROMATIC: Final = "monochromatic"
"""Name of light of one wavelength, beside those of `ILLUMINANTS`."""


@dataclass(frozen=True)
class Tube:
    """The tube. All values are assumed unless a source is named; the document states none.

    Attributes:
        sensitivity: sensitivity of the photocathode for light of 2856 K, uA/lm.
        emission_lux: equivalent background illumination of the dark emission (EBI), lx; 2.5e-7 is
            0.35 electrons per second in a pixel of 10.8 um.
        collection: collection efficiency eta_c.
        threshold: V_d, V.
        softness: width of the edge at V_d, V.
        loss: share eta_b of the electrons that is lost.
        gap: distance between photocathode and silicon, m.
        transverse: mean transverse energy at emission, eV.
        halo: share of the electrons that land a second time, within a radius of two gaps.
        ions: ion events per electron that lands (about 1 in 600 has been reported).
        burst: mean number of electrons that an ion event adds (geometric).
    """

    sensitivity: float = 1910.0
    emission_lux: float = 2.5e-7
    collection: float = 0.8
    threshold: float = 400.0
    softness: float = 60.0
    loss: float = 0.2
    gap: float = 150e-6
    transverse: float = 0.1
    halo: float = 0.05
    ions: float = 1 / 600
    burst: float = 10.0

    def __post_init__(self) -> None:
        shares = (self.collection, 1 - self.loss)
        if not all(0 < share <= 1 for share in shares) or not 0 <= self.halo < 1:
            raise ValueError("collection, loss and halo must be shares of the electrons")
        sizes = (self.threshold, self.softness, self.gap, self.sensitivity)
        if not all(0 < size < math.inf for size in sizes):
            raise ValueError("threshold, softness, gap and sensitivity must be above 0")
        rest = (self.emission_lux, self.transverse, self.ions, self.burst)
        if not all(0 <= each < math.inf for each in rest):
            raise ValueError("emission, transverse energy and ions must not be negative")

    @property
    def electrons_per_lux(self) -> float:
        """Photoelectrons / (s m2 lx): 1.19e16."""
        return self.sensitivity * 1e-6 / ELEMENTARY_CHARGE

    @property
    def quantum_efficiency(self) -> float:
        """Equivalent quantum efficiency per photon of 555 nm, for light counted by
        `photons_per_lux`."""
        return self.electrons_per_lux / photons_per_lux()

    def gain(self, volts: float) -> float:
        """Electrons in the silicon per absorbed photoelectron.

        eta_c (V - V_d)/3.6 with a soft threshold of width `softness`; exactly 0 at 0 V, where no
        field accelerates the photoelectrons. volts: magnitude of the high voltage.
        """
        w = self.softness
        edge = np.logaddexp(0, (volts - self.threshold) / w) - np.logaddexp(0, -self.threshold / w)
        return float(self.collection * w * edge / PAIR_ENERGY)

    @property
    def gain_variance(self) -> float:
        """Variance over mean of an absorbed electron's gain: Fano statistics of the pairs, then
        each collected with probability eta_c."""
        return 1 - self.collection * (1 - FANO)

    def landing_radius(self, volts: float) -> float:
        """r = 2 d sqrt(E_t/V), m: where an electron of the mean transverse energy lands."""
        return 2 * self.gap * math.sqrt(self.transverse / volts)

    def landing_spread(self, volts: float) -> float:
        """Standard deviation along one axis, m. With an exponentially distributed transverse energy
        the squared radius is exponential and the position normal: E[x^2 + y^2] = r^2."""
        return self.landing_radius(volts) / math.sqrt(2)

    def landing_kernel(self, volts: float, pitch: float) -> Values:
        """Shares along one axis of a pixel's electrons that land 0, 1, ... pixels away (one side).

        The overlap of a uniformly lit pixel, spread normally, with its neighbours: second
        difference of x Phi(x/s) + s phi(x/s).
        """
        if not volts > 0:
            return np.ones(1)
        s = self.landing_spread(volts) / pitch
        reach = max(1, math.ceil(6 * s))
        x = np.arange(-reach - 2, reach + 3, dtype=np.float64)
        if s > 0:
            density = np.exp(-((x / s) ** 2) / 2) / math.sqrt(2 * math.pi)
            ramp = x * ndtr(x / s) + s * density
        else:
            ramp = np.maximum(x, 0.0)
        shares = np.diff(ramp, 2)[reach + 1 :][: reach + 1]
        total: float = shares[0] + 2 * shares[1:].sum()
        return np.asarray(shares / total)

    @property
    def halo_radius(self) -> float:
        """m: an electron scattered back elastically comes down at most two gaps away."""
        return 2 * self.gap


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
        photocathode: ratio at the photocathode.
        silicon: ratio in the silicon behind it, for light that passes the photocathode.
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
