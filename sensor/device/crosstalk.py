"""Light on its way into the pixels: what a filter array passes, and what neighbours gather.

Cross-talk is one step of a random walk in either direction: a share a goes to each side, so the map
is [a, 1 - 2a, a] along rows and along columns, its transfer function (1 - 2a(1 - cos w)) for each,
and a pixel keeps (1 - 2a)^2 of its light. Where charge diffuses between pixels this is the least
form that keeps all light; a measured map of a chip (Estribeau and Magnan, Proc. SPIE 5251:315,
2004) has the same nine numbers. Beyond the array the border goes on, as over dummy pixels.

Under a filter array, a scene is light of three primaries; white is the sum of their luminances,
0.2126, 0.7152 and 0.0722 (Rec. ITU-R BT.709-6). A pixel's signal is

    int photons(nm) T(nm) eta(nm) dnm,   eta = 1 - exp(-alpha(nm) d),

with the photons of each primary for its luminance, the transmission T of the filter, and the share
eta that silicon of depth d absorbs. It is relative to a pixel without a filter whose lux are
counted as photons of one wavelength, as `sensor.wavelength` says.

The absorption of silicon is published. The spectra of the primaries and of the filters are Gaussian
curves as those of displays and of dyes; their middles and widths are assumed.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.cores import by_rows
from cosim.light.light import Box, Plane, PlaneMap
from cosim.light.mosaic import Mosaic
from cosim.light.radiometry import photon_density, photons_per_lux

Values = npt.NDArray[np.float64]
_LARGE: Final = 1 << 18
"""Pixels from which a plane is mapped on all cores."""
LUMINANCE: Final = (0.2126, 0.7152, 0.0722)
"""Share of each primary in white (Rec. ITU-R BT.709-6, item 3.2)."""
_NM: Final = np.arange(380.0, 781.0)
_ABSORPTION_NM: Final = np.arange(350.0, 801.0, 50.0)
_ABSORPTION_CM: Final = np.array(
    [1.06e6, 9.52e4, 2.55e4, 1.11e4, 6.39e3, 4.14e3, 2.81e3, 1.90e3, 1.30e3, 8.50e2]
)
"""Absorption of silicon at 300 K, 1/cm (Green, Sol. Energy Mater. Sol. Cells 92:1305, 2008)."""
_PRIMARIES: Final = ((620.0, 15.0), (540.0, 20.0), (455.0, 12.0))
"""Middle and standard deviation of the primaries' spectra, nm; assumed."""
_DYES: Final = ((610.0, 35.0, 0.90), (535.0, 35.0, 0.85), (455.0, 30.0, 0.80))
"""Middle, standard deviation (nm) and largest transmission of the filters; assumed."""


def side_share(crosstalk: float) -> float:
    """Share a that goes to each side, where `crosstalk` (0 to 1) is what a pixel loses in all."""
    return (1 - math.sqrt(1 - crosstalk)) / 2


def crosstalk_map(crosstalk: float) -> PlaneMap:
    """The map from light on the pixels to light that each gathers. crosstalk: share of its light
    that a pixel loses to its eight neighbours, 0 to 1."""
    from sensor.device.mixing import mix  # brings numba with it, which no other start need wait for

    share = np.float32(side_share(crosstalk))

    def part(plane: Plane, box: Box) -> Plane:
        y0, y1, x0, x1 = box
        out = np.empty((y1 - y0, x1 - x0), np.float32)
        by_rows(mix, y1 - y0, plane, share, y0, x0, out, least=_LARGE)
        return out

    return PlaneMap(lambda plane: part(plane, (0, plane.shape[0], 0, plane.shape[1])), 1, part)


def absorbed(nm: npt.ArrayLike, micrometres: float) -> Values:
    """Share of the photons that silicon of this depth absorbs (Beer and Lambert). The logarithm of
    the absorption is linear between the published wavelengths."""
    log = np.interp(np.asarray(nm, np.float64), _ABSORPTION_NM, np.log(_ABSORPTION_CM))
    return -np.expm1(-np.exp(log) * micrometres * 1e-4)


def _primary(index: int, nm: Values) -> Values:
    middle, spread = _PRIMARIES[index]
    return np.asarray(np.exp(-(((nm - middle) / spread) ** 2) / 2))


def _transmission(index: int, nm: Values) -> Values:
    middle, spread, most = _DYES[index]
    return np.asarray(most * np.exp(-(((nm - middle) / spread) ** 2) / 2))


def response(micrometres: float, wavelength_nm: float) -> Values:
    """(3, 3): signal of a red, green and blue pixel (rows) for linear red, green and blue
    (columns), over that of a pixel without a filter under white of the same illuminance.

    Args:
        micrometres: depth of the silicon that collects charge.
        wavelength_nm: wavelength at which lux are counted as photons.
    """
    counted = photons_per_lux(wavelength_nm) * absorbed(wavelength_nm, micrometres)
    made = np.empty((3, 3))
    for column, share in enumerate(LUMINANCE):
        photons = share * photon_density(partial(_primary, column), _NM)
        for row in range(3):
            signal = photons * _transmission(row, _NM) * absorbed(_NM, micrometres)
            made[row, column] = np.trapezoid(signal, _NM) / counted
    return made


def filter_array(name: str, micrometres: float, wavelength_nm: float) -> Mosaic:
    """The array of this name on a chip."""
    return Mosaic(name, response(micrometres, wavelength_nm))
