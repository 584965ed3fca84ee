"""Brightness of an image, Y = k E (D/f)^2 T G: document 002, equation 1.

The document calls k a constant. Here it is the product of the optics (rho T_l/4), the photocathode
(electrons per lux second) and the analog chain (DN per electron).
"""

from __future__ import annotations

from imagers.ebaps.pixels.array import EbapsPixels

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
    """k, DN / (lx s), with which equation 1 gives the mean signal of photoelectrons above black
    level and dark signal. A lens focused at infinity passes rho T_l / 4 (D/f)^2 of E."""
    budget = pixels.budget(1.0, 0.0)
    signal = float(budget.tube_mean(budget.light))
    per_gain = signal / budget.gain if budget.gain > 0 else 0.0
    return reflectance * transmission / 4 * per_gain * pixels.silicon.dn_per_electron


def wanted_exposure(pixels: EbapsPixels, lux: float, target: float, zero: float = 0.0) -> float:
    """Exposure, s, at which a pixel without fixed pattern has a mean of `target` DN; lux: on the
    photocathode.

    zero: DN without exposure. It is 0 for a frame from which dark frames of the same exposure were
        subtracted (which also removes the dark current), or the pedestal if one is added.
    """
    # No seconds: the photocathode's own emission is in the darks as well.
    one = pixels.budget(lux, 0.0)
    rate = float(one.response) * pixels.silicon.dn_per_electron
    return (target - zero) / rate if rate > 0 else float("inf")
