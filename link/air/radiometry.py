"""Illuminance on the sensor: of the panel's pixels, of their surroundings, of fog.

A resolved surface of luminance L gives pi L T / (4 N^2 (v / f)^2) lux at any distance (Ray, Applied
Photographic Optics, 3rd ed., 2002), with v / f = 1 + m in focus. The cos^4 law is not modelled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cosim import Clock, InputError
from cosim.config.amounts import at_most
from cosim.light.lens import FASTEST_F_NUMBER
from link.air.fog import airlight, extinction, forward_share
from link.air.geometry import lengths
from link.air.setting import AirSetting, Optics


def lens_gain(optics: Optics, distance: float) -> float:
    """Illuminance on the sensor for a luminance of 1 cd/m2, lux."""
    working = optics.f_number * lengths(optics, distance).extension
    return math.pi * optics.transmission / (4 * working**2)


@dataclass(frozen=True)
class Levels:
    """Illuminance of the parts of the image before glare, lux on the sensor.

    Attributes:
        panel: light of an ON pixel itself.
        face: light reflected by the panel.
        around: surroundings of the panel.
        fog: airlight, added to all three.
        halo: share of the unattenuated image that arrives blurred.
        dimmed: share of the image that arrives sharp; the other figures include it.
    """

    panel: float
    face: float
    around: float
    fog: float
    halo: float
    dimmed: float

    @property
    def on(self) -> float:
        """Illuminance in the middle of a large ON area, without glare."""
        return self.panel * (1 + self.halo / self.dimmed) + self.off

    @property
    def off(self) -> float:
        """Illuminance in the middle of a large OFF area, without glare."""
        return self.face * (1 + self.halo / self.dimmed) + self.fog


def levels(optics: Optics, air: AirSetting, effects: frozenset[str] | None = None) -> Levels:
    """Illuminance levels with these effects (`link.air.effects`), None for all."""

    def has(name: str) -> bool:
        return effects is None or name in effects

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
    """F-number at which an ON pixel gives `on_level` thresholds in a tick.

    Only the panel's own light in clear air counts. The f-number in `optics` is not read.

    Args:
        on_level: charge of a tick over the threshold.
        optics: panel and lens.
        distance: distance from lens to panel, m.
        threshold: electrons.
        electrons_per_lux: electrons a second of a pixel under 1 lux.
        clock: latch clock of the camera.

    Raises:
        InputError: if no lens is fast enough.
    """
    lux = on_level * threshold * clock.hz / electrons_per_lux
    extension = lengths(optics, distance).extension
    number = math.sqrt(math.pi * optics.luminance * optics.transmission / (4 * lux)) / extension
    if not number >= FASTEST_F_NUMBER:
        most = on_level * (number / FASTEST_F_NUMBER) ** 2
        raise InputError(
            "link.aim.on_level", f"at most {at_most(most, 3)} with this panel and threshold",
            f"{on_level:g}", "give it less, link.panel.luminance more, or a lower sensor.threshold",
        )  # fmt: skip
    return number
