"""Brightness of an image, Y = k E (D/f)^2 T G: document 002, equation 1.

The document calls k a constant. Here it is what the light passes: the lens takes rho T_l/4 of it,
the photocathode turns it into electrons, the chain into DN.
"""

from __future__ import annotations

from sensor.imagers.ebaps.pixels import EbapsPixels

__all__ = ["brightness", "brightness_constant", "wanted_exposure"]


def brightness(k: float, lux: float, aperture: float, seconds: float, gain: float) -> float:
    """Equation 1.

    Args:
        lux: E, on the scene.
        aperture: D/f.
        gain: G, here the bombardment's.
    """
    return k * lux * aperture**2 * seconds * gain


def brightness_constant(
    pixels: EbapsPixels, reflectance: float = 0.5, transmission: float = 0.9
) -> float:
    """k of light that crosses as photoelectrons, DN / (lx s): what makes equation 1 give the mean
    signal above black and dark. At infinity a lens passes rho T_l / 4 (D/f)^2 of E."""
    budget = pixels.budget(1.0, 0.0)
    signal = float(budget.tube_mean(budget.light))
    per_gain = signal / budget.gain if budget.gain > 0 else 0.0
    return reflectance * transmission / 4 * per_gain * pixels.silicon.dn_per_electron


def wanted_exposure(pixels: EbapsPixels, lux: float, target: float, zero: float = 0.0) -> float:
    """Seconds at which a middling pixel under this many lux on the plane has `target` DN.

    zero: DN with no exposure: 0 for a frame from which darks of its exposure were taken (then dark
    current has gone as well), the pedestal where one is added.
    """
    # No seconds: the photocathode's own emission is in the darks as well.
    one = pixels.budget(lux, 0.0)
    rate = float(one.response) * pixels.silicon.dn_per_electron
    return (target - zero) / rate if rate > 0 else float("inf")
