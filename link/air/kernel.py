"""Tabulated weights of a panel pixel in a camera pixel: both apertures and the lens's blur.

Locally the image is affine: a panel pixel steps by a1 and a2 camera pixels. The share of a panel
pixel in the light of a camera pixel at distance r in the image is K(r) = B(r) * C(r) * P(r). B is 1
within the parallelogram a1, a2, C is the camera's pixel, P a PSF of unit sum. The sum over the
panel is 1 everywhere. The Fourier transform is a product, for frequencies f in cycles per camera
pixel:

    |a1 x a2| sinc(a1 f) sinc(a2 f) sinc(fx) sinc(fy) exp(-2 pi^2 s^2 f^2) MTF(f) 2 J1(z) / z

with the lens's blur s, the diffraction MTF of `cosim.light.lens` and defocus of radius q, z = 2 pi
q f (Goodman, Introduction to Fourier Optics, 3rd ed., 6.4: the geometrical limit).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.light.lens import diffraction_mtf

Values = npt.NDArray[np.float64]
_GRID: Final = 384
"""Samples along a side of the kernel's square."""
_TAIL: Final = 2.6
"""Standard deviations of blur within the taps; the remainder is distributed among them."""


@dataclass(frozen=True)
class Psf:
    """Point spread function of the lens.

    Attributes:
        sigma: standard deviation of the Gaussian part, camera pixels.
        disc: radius of defocus, camera pixels.
        cutoff: diffraction limit, cycles per camera pixel; None for no diffraction.
    """

    sigma: float = 0.0
    disc: float = 0.0
    cutoff: float | None = None

    @property
    def radius(self) -> float:
        """Radius without the tails, camera pixels."""
        return _TAIL * self.sigma + self.disc

    def mtf(self, fx: Values, fy: Values) -> Values:
        """Modulation transfer function at frequencies in cycles per camera pixel."""
        from scipy.special import j1

        f = np.hypot(fx, fy)
        out = np.exp(-2 * (math.pi * self.sigma * f) ** 2)
        if self.cutoff is not None:
            out = out * diffraction_mtf(f, self.cutoff)
        if self.disc > 0:
            z = np.maximum(2 * math.pi * self.disc * f, 1e-9)
            out = out * (2 * j1(z) / z)
        return np.asarray(out)


def taps(affine: Values, psf: Psf) -> int:
    """Number of panel pixels along a side that contribute to a camera pixel, even."""
    inverse = np.abs(np.linalg.inv(affine))
    reach = 0.5 + 0.5 * inverse.sum(axis=1) + psf.radius * np.sqrt((inverse**2).sum(axis=1))
    return 2 * math.ceil(float(reach.max()))


def kernel_table(affine: Values, psf: Psf, count: int, phases: int) -> npt.NDArray[np.float32]:
    """Weights of panel pixels by sub-pixel position, each set of sum 1.

    Args:
        affine: (2, 2) camera pixels for a step of one panel pixel.
        psf: point spread function.
        count: taps along each axis.
        phases: sub-pixel positions along each axis, at (n + 1/2) / phases.

    Returns:
        (phases, phases, count, count) float32, weights along y and x. The pixels begin count / 2 -
        1 before the one at the integer part of the position.
    """
    from scipy.ndimage import map_coordinates

    corner = np.abs(affine).sum(axis=1).max() / 2 + 0.5 + psf.radius
    step = 2 * 1.25 * (corner + 0.1) / _GRID
    f = np.fft.fftfreq(_GRID, step)
    fx, fy = f[None, :], f[:, None]
    spectrum = np.sinc(fx) * np.sinc(fy) * psf.mtf(*np.broadcast_arrays(fx, fy))
    for ax, ay in affine.T:
        spectrum = spectrum * np.sinc(ax * fx + ay * fy)
    area = abs(float(np.linalg.det(affine)))
    kernel = np.fft.fftshift(np.fft.ifft2(spectrum).real) * (area / step**2)
    at = (np.arange(phases) + 0.5) / phases
    away = np.arange(count)[None, :] - (count // 2 - 1) - at[:, None]  # (phases, count)
    dy, dx = away[:, None, :, None], away[None, :, None, :]
    x = (affine[0, 0] * dx + affine[0, 1] * dy) / step + _GRID // 2
    y = (affine[1, 0] * dx + affine[1, 1] * dy) / step + _GRID // 2
    weights = map_coordinates(kernel, np.stack(np.broadcast_arrays(y, x)), order=1, cval=0.0)
    weights = np.maximum(weights, 0)
    return np.asarray(weights / weights.sum(axis=(2, 3), keepdims=True), np.float32)
