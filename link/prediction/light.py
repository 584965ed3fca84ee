"""Light of a run's cells and of the background, from the closed forms of the air."""

from __future__ import annotations

import math

import numpy as np

from link.air import image_of, lens_psf, levels
from link.air.geometry import affine_at, lengths
from link.air.radiometry import sun_glare
from link.prediction.drawn_cells import CellSight, Mixed
from link.prediction.error_bound import CellScene
from link.setting import LinkSetting
from link.timing import Timing
from sensor.device.crosstalk import side_share

_AIRY = 0.42
"""Standard deviation of the Gaussian that fits an Airy core, in wavelength over aperture (Zhang,
Zerubia and Olivo-Marin, Appl. Opt. 46:1819, 2007)."""

_ROWS = 33
"""Number of rows of the panel's image, and of symbols, that represent all."""


def _blur(setting: LinkSetting) -> float:
    """Standard deviation of the blur of an edge, camera pixels.

    It combines the lens, diffraction, defocus (q / 2 along an axis for a disc of radius q), and
    vibration over the run.
    """
    optics = setting.optics
    image = lengths(optics, setting.air.distance)
    working = optics.f_number * image.extension
    airy = _AIRY * optics.wavelength_nm * 1e-9 * working / optics.camera_pitch
    return math.hypot(optics.blur, airy, image.disc / 2, setting.aim.vibration)


def cell_scene(setting: LinkSetting) -> CellScene:
    """Light of the cells at the run's distance, with half of the panel on at any time."""
    optics, air, camera = setting.optics, setting.air, setting.camera
    here = levels(optics, air)
    covered = min(
        optics.width * optics.height * setting.scale**2 / (camera.chip.width * camera.chip.height),
        1.0,
    )
    mean = covered * (here.panel / 2 + here.face) + (1 - covered) * here.around + here.fog
    stray = (
        here.off * (1 - air.glare)
        + air.glare * mean
        + sun_glare(optics, air, setting.aim, (camera.chip.height, camera.chip.width))
    )
    per_lux = camera.electrons_per_lux / (camera.clock.hz * camera.threshold)
    return CellScene(
        setting.scale, _blur(setting), here.panel * per_lux, stray * per_lux, camera.threshold,
        camera.threshold_noise, camera.reset, setting.phase,
    )  # fmt: skip


def cell_sight(setting: LinkSetting, timing: Timing, symbols: int) -> CellSight:
    """Input of `cell_errors` for a run.

    Args:
        setting: the link.
        timing: true timing of the symbols.
        symbols: number of symbols of the run.
    """
    optics, chip = setting.optics, setting.camera.chip
    home = image_of(optics, setting.aim, setting.air, (chip.height, chip.width))
    psf = lens_psf(optics, setting.air.distance)
    mixed = Mixed(psf.sigma, psf.disc, psf.cutoff, side_share(setting.camera.crosstalk))
    half = optics.height * setting.scale / 2
    rows = chip.height / 2 + setting.aim.offset[1] + np.linspace(-half, half, _ROWS)
    begins = timing.start(np.linspace(0, symbols, _ROWS).astype(int)[:, None], rows)
    return CellSight(
        cell_scene(setting), affine_at(home, (optics.width - 1) / 2, (optics.height - 1) / 2),
        mixed, math.hypot(psf.sigma, psf.disc / 2), (begins % 1.0).ravel(),
    )  # fmt: skip
