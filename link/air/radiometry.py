"""Lux on the sensor: of the panel's pixels, of what surrounds them, of glare.

A resolved surface of luminance L gives pi L T / (4 N^2 (v / f)^2) lux whatever its distance (Ray,
Applied Photographic Optics, 3rd ed., 2002), v / f = 1 + m in focus. cos^4 is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cosim import Clock, InputError
from cosim.light.lens import FASTEST_F_NUMBER
from link.air.fog import airlight, extinction, forward_share
from link.air.geometry import lengths
from link.air.setting import AirSetting, Optics

__all__ = ["Levels", "f_number_for", "lens_gain", "levels"]


def lens_gain(optics: Optics, distance: float) -> float:
    """Lux on the sensor for a cd/m2 of the scene."""
    working = optics.f_number * lengths(optics, distance).extension
    return math.pi * optics.transmission / (4 * working**2)


@dataclass(frozen=True)
class Levels:
    """Of the image before glare, lux on the sensor. panel: of a pixel that is on, of its own light
    alone. face: what the panel reflects. around: its surroundings. fog: airlight, which is added to
    all three. halo: share of the undimmed image that comes spread out; dimmed: what is left of the
    image itself, already in the other figures."""

    panel: float
    face: float
    around: float
    fog: float
    halo: float
    dimmed: float

    @property
    def on(self) -> float:
        """Of the middle of a large part that is on, everything counted but glare."""
        return self.panel * (1 + self.halo / self.dimmed) + self.off

    @property
    def off(self) -> float:
        """Of the middle of a large part that is off, likewise."""
        return self.face * (1 + self.halo / self.dimmed) + self.fog


def levels(optics: Optics, air: AirSetting, kept: frozenset[str] | None = None) -> Levels:
    """kept: names of effects (`link.air.effects`), all of them unless given."""

    def has(name: str) -> bool:
        return kept is None or name in kept

    gain = lens_gain(optics, air.distance)
    thickness = 0.0
    if air.visibility is not None:
        thickness = extinction(air.visibility, optics.wavelength_nm, air.particles) * air.distance
    dimmed = max(math.exp(-thickness), 1e-300) if has("fog extinction") else 1.0
    halo = forward_share(thickness) if has("fog blur") else 0.0
    veil = -math.expm1(-thickness) - halo if has("airlight") else 0.0
    lit = air.ambient / math.pi
    face = optics.reflectance * lit if has("ambient on the panel") else 0.0
    around = air.surroundings * lit if has("surroundings") else 0.0
    through = gain * dimmed
    return Levels(
        optics.luminance * through, face * through, around * through,
        gain * max(veil, 0.0) * airlight(air.ambient), halo, dimmed,
    )  # fmt: skip


def f_number_for(
    on_level: float, optics: Optics, distance: float, threshold: float,
    electrons_per_lux: float, clock: Clock,
) -> float:  # fmt: skip
    """F-number at which a pixel that is on, by the panel's own light in clear air, brings
    `on_level` thresholds (electrons) a tick of `clock`. That of `optics` is not looked at.

    Raises InputError where no lens is so fast.
    """
    lux = on_level * threshold * clock.hz / electrons_per_lux
    extension = lengths(optics, distance).extension
    number = math.sqrt(math.pi * optics.luminance * optics.transmission / (4 * lux)) / extension
    if not number >= FASTEST_F_NUMBER:
        most = on_level * (number / FASTEST_F_NUMBER) ** 2
        raise InputError(
            "link.aim.on_level", f"at most {most:.3g} with this panel and threshold",
            f"{on_level:g}", "give it less, link.panel.luminance more, or a lower sensor.threshold",
        )  # fmt: skip
    return number
