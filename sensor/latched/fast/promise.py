"""What the fast tier's own arithmetic may change over a scene."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Summary
from cosim.plan.planner import ESTIMATE_WEIGHT
from sensor.latched.effects.windows import saturated, shifted
from sensor.latched.fast.bound import rate_bound
from sensor.latched.fast.units import units_of
from sensor.latched.setting import CameraSetting

__all__ = ["fast_bound"]


def fast_bound(setting: CameraSetting, scene: Summary) -> float:
    """Relative error of the fast tier's own arithmetic against the exact tier's in the worst tile:
    twice the lesser of its proof for the nominal pixel, in which every rounding of the run goes the
    same way, and of an estimate.

    Estimated: a rounding of float32 and half a unit a cycle, and the quantile's error a spike, move
    the rate; what they add up to over the run shifts the spikes against their draws.
    """
    if setting.reset != "residual":  # not smooth in its charge
        return ESTIMATE_WEIGHT * _fast_proof(setting, scene)
    units, q = units_of(setting.model), setting.model.mean
    unit = 2.0**-units.bits
    spikes = np.asarray(scene.brightest, np.float64) / q
    roundings = 2.0**-23 * (1 + 4 * len(setting.model.transfers))  # a map has about four more
    cycle = unit / 2 + roundings * spikes + units.error * unit * spikes
    guess = scene.relative(cycle * q) + shifted(scene, cycle * scene.cycles)
    twice = ESTIMATE_WEIGHT * np.where(saturated(scene), 0.0, guess)
    return min(ESTIMATE_WEIGHT * _fast_proof(setting, scene), float(np.max(twice)))


def _fast_proof(setting: CameraSetting, scene: Summary) -> float:
    """Infinite where nothing is promised. Tiles under the shortest threshold are one case, those
    beyond the longest another; one in between has no promise."""
    model = setting.model
    low, high = np.broadcast_arrays(scene.darkest, scene.brightest)

    def worst(tiles: npt.NDArray[np.bool_]) -> float:
        if not tiles.any():
            return 0.0
        least, most = float(low[tiles].min()), float(high[tiles].max())
        return float(rate_bound(model, least, most, scene.window, scene.floor, scene.cycles).value)

    bright = low > model.mean
    return max(worst(bright), worst(~bright))
