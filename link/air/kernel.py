"""What a panel's pixel gives a camera's pixel: the boxes of both and the lens's blur, tabulated.

Near a point the image is affine: panel pixel steps a1, a2 (camera pixels). A panel pixel's share of
a camera pixel's light, its centre r away in the image, is K(r) = B(r) * C(r) * P(r): B is 1 within
the parallelogram a1, a2, C is the camera's pixel, P the PSF of light 1. Summed over the panel it is
1 everywhere. Its Fourier transform is a product, frequencies f in cycles a camera pixel:

    |a1 x a2| sinc(a1 f) sinc(a2 f) sinc(fx) sinc(fy) exp(-2 pi^2 s^2 f^2) MTF(f) 2 J1(z) / z

with the lens's blur s, the diffraction MTF of `cosim.lens` and defocus of radius q, z = 2 pi q f
(Goodman, Introduction to Fourier Optics, 3rd ed., 6.4: the geometrical limit).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.light.lens import diffraction_mtf

__all__ = ["Psf", "kernel_table", "taps"]

Values = npt.NDArray[np.float64]
_GRID: Final = 384
"""Samples along a side of the kernel's square."""
_TAIL: Final = 2.6
"""Standard deviations of blur within the taps; what lies beyond is put back among them."""


@dataclass(frozen=True)
class Psf:
    """sigma: standard deviation of the Gaussian part, camera pixels. disc: radius of defocus,
    camera pixels. cutoff: of diffraction, cycles a camera pixel; None for none."""

    sigma: float = 0.0
    disc: float = 0.0
    cutoff: float | None = None

    @property
    def radius(self) -> float:
        """Camera pixels that it reaches, all but the tails."""
        return _TAIL * self.sigma + self.disc

    def mtf(self, fx: Values, fy: Values) -> Values:
        """Of everything, at frequencies in cycles a camera pixel."""
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
    """Panel pixels along a side that give light to a camera pixel, even."""
    inverse = np.abs(np.linalg.inv(affine))
    reach = 0.5 + 0.5 * inverse.sum(axis=1) + psf.radius * np.sqrt((inverse**2).sum(axis=1))
    return 2 * math.ceil(float(reach.max()))


def kernel_table(affine: Values, psf: Psf, count: int, phases: int) -> npt.NDArray[np.float32]:
    """(phases, phases, count, count) float32: weights of the `count` panel pixels along y and x
    about a point whose fraction of a panel pixel along y and x is (n + 1/2) / phases; each set adds
    up to 1. The pixels begin count / 2 - 1 before the one that the point's whole part names.
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
