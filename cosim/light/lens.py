"""A lens between a lit scene and a sensor: illuminance of the sensor, and blur.

On the axis, a Lambertian scene of reflectance 1 under E lux causes E T / (4 N^2 (1 + m)^2) lux on
the sensor (camera equation, e.g. Ray, Applied Photographic Optics, 3rd ed., 2002; m is the
magnification). Not modelled: cos^4 fall-off towards the corners, distortion, veiling glare.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from cosim.light.light import Light, Plane, PlaneMap

FASTEST_F_NUMBER = 0.5
"""Lowest f-number of a lens in air: the sine of its cone's half angle, 1/(2N), is at most 1."""


def diffraction_mtf(frequency: npt.NDArray[np.float64], cutoff: float) -> npt.NDArray[np.float64]:
    """MTF of a perfect lens with a round pupil, incoherent light.

    2/pi (acos v - v sqrt(1 - v^2)), v = frequency / cutoff, cutoff = 1/(wavelength N)
    (Goodman, Introduction to Fourier Optics, 3rd ed., eq. 6-31).

    Args:
        frequency: any shape, cycles per metre.
        cutoff: cycles per metre.
    """
    v = np.clip(frequency / cutoff, 0, 1)
    return 2 / math.pi * (np.arccos(v) - v * np.sqrt(1 - v * v))


@dataclass(frozen=True)
class Lens:
    """A lens.

    Attributes:
        f_number: N, at least 0.5.
        transmission: T, above 0 and at most 1.
        magnification: m, 0 or more.
        psf: "none" for no blur, "airy" for diffraction at `wavelength_nm`.
        wavelength_nm: wavelength for the diffraction.

    Raises:
        ValueError: a value is out of range.
    """

    f_number: float
    transmission: float = 0.9
    magnification: float = 0.0
    psf: Literal["none", "airy"] = "none"
    wavelength_nm: float = 555.0

    def __post_init__(self) -> None:
        if not self.f_number >= FASTEST_F_NUMBER:
            raise ValueError(f"f-number must be at least {FASTEST_F_NUMBER}, not {self.f_number:g}")
        if not 0 < self.transmission <= 1:
            raise ValueError(f"transmission must be in (0, 1], not {self.transmission:g}")
        if not self.magnification >= 0:
            raise ValueError(f"magnification must be >= 0, not {self.magnification:g}")
        if not self.wavelength_nm > 0:
            raise ValueError(f"wavelength must be above 0 nm, not {self.wavelength_nm:g} nm")
        if not math.isfinite(self.working_f_number * self.wavelength_nm):
            raise ValueError(f"a lens must be described by finite numbers, not {self}")

    @property
    def working_f_number(self) -> float:
        """N (1 + m), which determines the light on the sensor and the diffraction."""
        return self.f_number * (1 + self.magnification)

    @property
    def gain(self) -> float:
        """Lux on the sensor per lux of scene exitance (illuminance x reflectance)."""
        return self.transmission / (4 * self.working_f_number**2)

    def blur(self, plane: Plane, pitch_um: float) -> Plane:
        """The plane convolved with the PSF, with mirrored edges and the same sum of light.

        Light between pixel centres is interpolated as band-limited, so the image rings near a point
        far brighter than its surroundings, by up to a hundredth of that point. Negative values are
        clipped to 0, and the rest is scaled to the original sum.
        """
        if self.psf == "none":
            return plane
        height, width = plane.shape
        # The cosine transform mirrors the edges, so no light wraps around to the other side.
        from scipy.fft import dctn, idctn

        pitch = pitch_um * 1e-6
        fy = np.arange(height)[:, None] / (2 * height * pitch)
        fx = np.arange(width)[None, :] / (2 * width * pitch)
        cutoff = 1 / (self.wavelength_nm * 1e-9 * self.working_f_number)
        spectrum = dctn(plane.astype(np.float64), norm="ortho")
        image = idctn(spectrum * diffraction_mtf(np.hypot(fy, fx), cutoff), norm="ortho")
        total = image.sum()
        np.maximum(image, 0, out=image)
        if total > 0:
            image *= total / image.sum()
        return image.astype(np.float32)

    def relay(self, pitch_um: float) -> LensRelay:
        """The lens in front of pixels of this pitch."""
        return LensRelay(self, pitch_um)


class LensRelay:
    """Maps scene exitance (lux) on the pixel grid to illuminance of the pixels (lux).

    Attributes:
        gain: Factor of all light, where the lens does not blur; else None.
    """

    def __init__(self, lens: Lens, pitch_um: float) -> None:
        gain = np.float32(lens.gain)
        self.gain = gain if lens.psf != "airy" else None
        # The tails of the Airy pattern are unlimited: a change affects the whole plane.
        if lens.psf == "airy":
            self._map = PlaneMap(lambda plane: lens.blur(plane, pitch_um) * gain, None)
        else:
            self._map = PlaneMap(
                lambda plane: plane * gain,
                0,
                lambda plane, box: plane[box[0] : box[1], box[2] : box[3]] * gain,
            )

    def __call__(self, light: Light) -> Light:
        return self._map(light)
