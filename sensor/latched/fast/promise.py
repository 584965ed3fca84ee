"""Error of the fast tier's arithmetic over a scene."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Summary
from cosim.plan.planner import ESTIMATE_WEIGHT
from sensor.latched.effects.windows import saturated_tiles, shift_error
from sensor.latched.fast.bound import rate_bound
from sensor.latched.fast.units import units_of
from sensor.latched.setting import CameraSetting

__all__ = ["fast_bound"]


def fast_bound(setting: CameraSetting, scene: Summary) -> float:
    """Relative error of the fast tier's arithmetic against the exact tier's, in the worst tile.

    It is twice the smaller of two values. The proof holds for the nominal pixel and assumes that
    all rounding errors of the run have the same sign. The estimate takes the rounding errors of a
    cycle (float32, and half a unit) and the quantile's error a spike as an error of the rate, and
    their sum over the run as a shift of the spikes against their draws.
    """
    if setting.reset != "residual":  # the rate is not smooth in the charge
        return ESTIMATE_WEIGHT * _fast_proof(setting, scene)
    units, q = units_of(setting.model), setting.model.mean
    unit = 2.0**-units.bits
    spikes = np.asarray(scene.brightest, np.float64) / q
    roundings = 2.0**-23 * (1 + 4 * len(setting.model.transfers))  # a transfer adds about four
    cycle = unit / 2 + roundings * spikes + units.error * unit * spikes
    estimate = scene.relative(cycle * q) + shift_error(scene, cycle * scene.cycles)
    twice = ESTIMATE_WEIGHT * np.where(saturated_tiles(scene), 0.0, estimate)
    return min(ESTIMATE_WEIGHT * _fast_proof(setting, scene), float(np.max(twice)))


def _fast_proof(setting: CameraSetting, scene: Summary) -> float:
    """The proven bound of all tiles, infinite if there is none. It exists for tiles below the
    shortest threshold and for tiles above the longest, but not for those in between."""
    model = setting.model
    low, high = np.broadcast_arrays(scene.darkest, scene.brightest)

    def worst(tiles: npt.NDArray[np.bool_]) -> float:
        if not tiles.any():
            return 0.0
        least, most = float(low[tiles].min()), float(high[tiles].max())
        return float(rate_bound(model, least, most, scene.window, scene.floor, scene.cycles).value)

    bright = low > model.mean
    return max(worst(bright), worst(~bright))
