"""Effects on the path from panel to camera: their cost, and the change if they are left out.

Every bound starts from a share e of the charge of a lit pixel. No pixel's charge in a tick is wrong
by more than e, whatever the panel shows:

- blur: the weights k of the panel pixels, which sum to 1, become k': e = sum |k - k'| / 2;
- a shift by (x, y) camera pixels: the field of a pixel changes by |x| + |y| of its area;
- any displacement up to r: 4 r + pi r^2 of its area;
- light that is added or removed: its largest share in the image;
- vibration: its standard deviation and its correlation time.

Scintillation is not such a share. It multiplies the light of a patch of the panel, of ON and OFF
alike, and is described by its law, its correlation time and the number of independent patches
(`flicker_units`).

`ber_units` (summary.py) turns e into a change of the bit error rate. It assumes the optimal
decision from a few pixels and ticks in the middle of a uniform panel. The receiver decides
otherwise, so every bound is an estimate and counts twice; the check of the plan measures the effect
on the receiver itself. An effect that is only a number in the computation costs nothing and is
kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from cosim import Bound, Effect, Summary
from cosim.compute.streams import Stream
from cosim.plan.effects import free
from link.air.air import lens_psf
from link.air.geometry import affine_at, image_of, panel_corners
from link.air.kernel import Psf, kernel_table, taps
from link.air.motion import DAMPING
from link.air.radiometry import extinction, forward_share, levels, sun_glare, sun_image
from link.air.scintillation import Flicker, flicker_of
from link.air.setting import Scene
from link.air.summary import LinkSummary, ber_units, flicker_units
from sensor import CameraSetting

_PHASES: Final = 32
_STILL: Final = 1e6
"""Correlation time of air without wind, s."""

# ns for each camera pixel of a new plane of light, on one loaded core at 2.5 GHz. The costs decide
# the order in which the planner leaves effects out, as in `sensor/latched/effects/effect.py`.
_COSTS: Final = {
    "lens blur": 6.0,  # 4 x 4 taps for 2 x 2
    "diffraction": 1e-3,
    "defocus": 20.0,
    "vibration": 1e-3,
    "fog blur": 4.0,
    "glare": 1.0,
    "scintillation": 1e-3,
    "emitter response": 30.0,  # one image for each plane instead of one for each symbol
}
_SOURCES: Final = {
    "lens blur": "a Gaussian PSF",
    "diffraction": "Goodman, Introduction to Fourier Optics, eq. 6-31",
    "defocus": "geometrical disc of a thin lens",
    "vibration": "a damped resonance driven by noise",
    "misalignment": "homography of a turned and tilted panel",
    "fog extinction": "Kim, SPIE 4214:26; Kruse 1962",
    "airlight": "Koschmieder",
    "fog blur": "single scattering by diffraction, van de Hulst 1957",
    "ambient on the panel": "diffuse reflection",
    "surroundings": "diffuse reflection",
    "glare": "even veiling glare",
    "sun": "disc of 0.53 degrees",
    "scintillation": "Andrews and Phillips 2005; Al-Habash, Andrews and Phillips 2001",
    "emitter response": "first-order emitter (SpikePanel.rise, decay)",
}


@dataclass(frozen=True)
class Change:
    """Change of the charges if an effect is left out.

    Attributes:
        size: e; a standard deviation if `duration` is above 0.
        duration: correlation time of a random effect, cycles; 0 for a constant one.
        law: law of the factor of the panel's light, of which `size` is the deviation; None for an
            effect that is not a factor.
        patches: number of parts of the panel with independent factors.
    """

    size: float
    duration: float = 0.0
    law: Flicker | None = None
    patches: int = 1

    def units(self, scene: LinkSummary) -> float:
        """Change of the link's bit error rate, in half-widths of its interval."""
        times = max(scene.cycles / self.duration, 1.0) if self.duration > 0 else 0.0
        if self.law is not None:
            return flicker_units(scene, self.law, times * self.patches)
        return ber_units(scene, self.size, times)


def _blur_change(scene: Scene, shape: tuple[int, int], one: Psf, other: Psf) -> float:
    """Change e of the charges if one PSF is replaced by the other, in the middle of the panel."""
    if one == other:
        return 0.0
    if max(one.radius, other.radius) > 3:  # a camera pixel hardly resolves the panel pixel
        return 1.0
    optics = scene.optics
    home = image_of(optics, scene.aim, scene.air, shape)
    affine = affine_at(home, (optics.width - 1) / 2, (optics.height - 1) / 2)
    count = max(taps(affine, one), taps(affine, other))
    tables = [kernel_table(affine, psf, count, _PHASES) for psf in (one, other)]
    return float(np.abs(tables[0] - tables[1]).sum(axis=(2, 3)).max() / 2)


def _displacement(scene: Scene, shape: tuple[int, int]) -> float:
    """Largest displacement of a corner of the panel's image by rotation and tilt, camera pixels."""
    flat = replace(scene.aim, rotation=0.0, tilt=(0.0, 0.0))
    ends = []
    for aim in (scene.aim, flat):
        u, v, w = image_of(scene.optics, aim, scene.air, shape) @ panel_corners(scene.optics).T
        ends.append(np.stack([u / w, v / w]))
    return float(np.hypot(*(ends[0] - ends[1])).max())


def charge_changes(scene: Scene, camera: CameraSetting) -> dict[str, Change]:
    """Change of charges of every effect that is active in the scene, by name."""
    panel, optics, aim, air = scene.panel, scene.optics, scene.aim, scene.air
    shape = camera.chip.height, camera.chip.width
    level, psf = levels(optics, air), lens_psf(optics, air.distance)
    lit, out = level.on, {}
    out["lens blur"] = _blur_change(scene, shape, psf, replace(psf, sigma=0.0))
    out["diffraction"] = _blur_change(scene, shape, psf, replace(psf, cutoff=None))
    out["defocus"] = _blur_change(scene, shape, psf, replace(psf, disc=0.0))
    out["vibration"] = math.sqrt(2) * aim.vibration
    moved = _displacement(scene, shape)
    out["misalignment"] = 4 * moved + math.pi * moved**2
    if air.visibility is not None:
        thick = extinction(air.visibility, optics.wavelength_nm, air.particles) * air.distance
        clear = levels(optics, air, frozenset({"ambient on the panel", "surroundings"}))
        out["fog extinction"] = max(clear.on, clear.around) * -math.expm1(-thick) / lit
        out["airlight"] = level.fog / lit
        # Without the halo, airlight takes its share.
        most = max(clear.on, clear.around, level.fog / max(-math.expm1(-thick), 1e-300))
        out["fog blur"] = forward_share(thick) * most / lit
    out["ambient on the panel"] = level.face * (1 + level.halo / level.dimmed) / lit
    out["surroundings"] = level.around * (1 + level.halo / level.dimmed) / lit
    brightest = max(level.on, level.around + level.fog)
    stray = sun_glare(optics, air, aim, shape)
    out["glare"] = (air.glare * brightest + stray) / lit
    if air.sun > 0:
        disc = float(sun_image(optics, aim, air, shape).max())
        out["sun"] = (disc + stray) / lit
        out["glare"] += air.glare * disc / lit
    law, patches = flicker_of(optics, air)
    response = max(panel.rise, panel.decay) * panel.clock.hz
    out["emitter response"] = -response * math.expm1(-1 / response) if response > 0 else 0.0
    hz = camera.clock.hz
    # Twice the correlation time, which is 1 / (damping 2 pi f) for a resonance.
    duration = {"vibration": hz / (math.pi * DAMPING * aim.vibration_frequency)}
    changes = {name: Change(e, duration.get(name, 0.0)) for name, e in out.items() if e > 0}
    if law.index > 0:
        independent = 2 * min(law.time, _STILL) * hz
        changes["scintillation"] = Change(math.sqrt(law.index), independent, law, patches.count)
    return changes


def air_effects(scene: Scene, camera: CameraSetting) -> tuple[Effect, ...]:
    """Every effect that is active in the scene. The bounds read a `LinkSummary`."""
    return tuple(_effect(name, change) for name, change in charge_changes(scene, camera).items())


def _effect(name: str, change: Change) -> Effect:
    def bound(summary: Summary) -> Bound:
        if not isinstance(summary, LinkSummary):
            raise TypeError("the bounds of a link's effects need a LinkSummary")
        return Bound(change.units(summary), "estimate")

    def cost(summary: Summary) -> float:
        return float(_COSTS[name] * np.max(summary.planes))

    streams = {"vibration": Stream.VIBRATION, "scintillation": Stream.SCINTILLATION}
    return Effect(
        name, _SOURCES[name], streams.get(name, Stream.NONE), bound,
        cost if name in _COSTS else free,
    )  # fmt: skip
