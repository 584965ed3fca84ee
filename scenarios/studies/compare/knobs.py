"""Settings that an imager does not make by itself, made for the light as the documents' users do:
high voltage of the EBAPS, exposure and gain of the EMCCD."""

from __future__ import annotations

import math
from typing import Final

from rtl_model.imagers.ebaps.exposure import WINDOW, ExposureRule, Linear
from rtl_model.imagers.ebaps.settling import settle
from rtl_model.imagers.sections import EbapsSection, EmccdSection
from sensor.imagers.ebaps import EbapsPixels, wanted_exposure
from sensor.imagers.emccd import GAIN_RANGE, EmccdPixels

__all__ = ["set_ebaps", "set_emccd"]

VOLTS: Final = (1500.0, 1000.0, 500.0, 0.0)
"""Of the document's figure 11."""
FULL: Final = 0.8
"""Share of a well that white fills."""


def set_ebaps(section: EbapsSection, lux: float, given: frozenset[str]) -> EbapsSection:
    """The highest of the document's voltages at which the loop's range holds the exposure that the
    light wants, and the exposure at which the loop comes to rest. lux: mean on the plane."""
    rule = ExposureRule()
    target = sum(WINDOW) / 2
    choices = (-section.high_voltage,) if "high_voltage" in given else VOLTS
    volts, wanted = choices[-1], 0.0
    for volts in choices:
        wanted = wanted_exposure(EbapsPixels(volts=volts), lux, target)
        if wanted * 1e9 >= rule.shortest:
            break
    changed: dict[str, float] = {"high_voltage": -volts}
    if "exposure" not in given:
        clipped = min(max(round(wanted * 1e9), 1), 10 * rule.longest) if wanted < 1e3 else 10**12
        changed["exposure"] = settle(rule, Linear.wanting(clipped, rule)).low * 1e-9
    return section.model_copy(update=changed)


def set_emccd(section: EmccdSection, lux: float, given: frozenset[str]) -> EmccdSection:
    """The exposure that fills a share of the image well with white, 2 ms or longer only where the
    light asks for it; in the dark the gain that brings the amplifier's noise below the shot noise
    of mid-grey. lux: of white on the plane."""
    pixels = EmccdPixels()
    exposure, most = section.exposure, 4096 * 1e-5
    if "exposure" not in given:
        full = FULL * pixels.image_well / (lux * pixels.responsivity)
        exposure = max(math.floor(min(full, most) / 1e-5), 1) * 1e-5
    changed: dict[str, float] = {"exposure": exposure}
    if not given & {"gain", "gain_step"}:
        white = lux * pixels.responsivity * exposure
        needed = 3 * pixels.read_noise / math.sqrt(max(white / 2, 1e-6))
        room = FULL * pixels.register_well / max(white, 1e-6)
        changed["gain"] = min(max(min(needed, room), GAIN_RANGE[0]), GAIN_RANGE[1])
    return section.model_copy(update=changed)
