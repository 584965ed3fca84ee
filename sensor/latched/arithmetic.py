"""Error of the exact and of the fast tier against full physics, tile by tile, before a run.

Both tiers take the dead time of a spike by the mean light of its cycle, and thresholds from a
table. Where light changes, and with every spike, their phase (spikes so far, with the fraction of
the current interval) shifts by a little against that of the reference. A shift as such changes a
rate by next to nothing. However, it moves a few spikes into a neighbouring cycle. Near one spike a
cycle two spikes then share a latch and one of them is lost; under a hard reset the next interval
begins a cycle later. A single such pixel changes the rate of its tile by about 1 / (16 window).

All values are estimates. Expected sizes are returned at twice their size, and limits as they are.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.plan.effects import Summary
from cosim.plan.planner import ESTIMATE_WEIGHT
from sensor.latched.effects.windows import (
    CHANCE,
    GAINS,
    crossing_error,
    ends_error,
    latch_error,
    rare_error,
    saturated_tiles,
    share_of_window,
)
from sensor.latched.fast.bound import rate_bound
from sensor.latched.fast.units import units_of
from sensor.latched.pixel.charge import ONE
from sensor.latched.setting import CameraSetting
from sensor.latched.tiers import Tier

Values = npt.NDArray[np.float64]

_JUMP: Final = 2 / (3 * np.sqrt(3))
"""Largest RMS of the light that a spike loses wrongly in the cycle of a jump, over the dead time's
light after it; see `_dead_shift`."""
_AFTER: Final = 8
"""Share of a window that comes after a change in which all pixels of a tile brighten at once: one
part in so many, at least. An assumption: a window that ends with the change has less."""
_SWEEPS: Final = 4
"""Number of times in a run that light whose changes are not known sweeps from one end of its range
to the other."""
TABLE_RMS: Final = 1.2e-6
"""RMS error of a threshold from the exact tier's table, in standard deviations of the threshold.
tests/sensor/latched/test_arithmetic.py measures it for thresholds of 10 to 20 000 electrons."""
TABLE_BIAS: Final = 1.7e-6
"""Mean of that error, in squares of the relative standard deviation."""
LAW_RMS: Final = 0.35
"""RMS error of a threshold in the fast tier, over the largest error that its units state.
tests/sensor/latched/test_arithmetic.py measures it for thresholds of 1 to 30 000 electrons."""
LAW_BIAS: Final = 0.07
"""Mean of that error, in the same measure; largest at one electron."""
FLOAT_RMS: Final = 0.7 * 2.0**-24
"""RMS rounding of the fast tier's light in float32, relative. The same test measures it: .35 to .66
of 2^-24 under constant light, less where light changes and errors have either sign."""


def _dead_shift(
    setting: CameraSetting, scene: Summary, cycles: int, tier: Tier = "exact"
) -> Values:
    """RMS phase by which dead time is off after a number of cycles, in spikes, (tiles,).

    In the exact tier dead time d is a multiple of 2^-16 of a cycle. Of n expected spikes a pixel
    has the whole number below or above, whose mean square is at most n^2 + min(n, 1 / 4). Where
    light changes by s a cycle, a spike loses the light of the middle of its cycle instead of that
    of its own instant.
    Light that changes evenly is off by up to d s / 2 with either sign, RMS d s / sqrt(12). Light
    that jumps by s after the part f of a cycle is off by d s f for the spikes after the jump, of
    which there are 1 - f in a cycle: RMS d s f sqrt(1 - f), which is largest, _JUMP d s, at f =
    2/3. As more spikes fall into the brighter part of a cycle, too little is lost on average: d
    times the variance of the light within the cycle, s^2 / 12 to s^2 / 4. With S the limit of s,
    and V the sum of all changes, the sum of s^2 over n cycles is at most n S^2 and V S. If V is not
    known, _SWEEPS changes by the whole range are assumed in the run.

    Under the other reset rules dead time begins at the latch, and a spike loses light of the next
    cycle: up to d s more or less. This is a limit rather than an expected size, and counts once.
    """
    model = setting.model
    if model.dead_time == 0:
        return np.zeros(np.broadcast(scene.darkest, scene.brightest).shape)
    low, high = (np.asarray(x, np.float64) / model.mean for x in (scene.darkest, scene.brightest))
    spikes = np.minimum(high, 1)
    rounded = 0.0 if tier == "fast" and model.dead else abs(model.dead / 65536 - model.dead_time)
    count = spikes * cycles
    rounding = rounded * high * np.sqrt(count**2 + np.minimum(count, 0.25))
    swept = high - low
    most = np.minimum(np.asarray(scene.slope) / model.mean, swept)
    moved = np.asarray(scene.moved) / model.mean
    assumed = max(_SWEEPS * cycles / scene.cycles, 1) * swept
    squares = np.minimum(cycles * most**2, np.where(np.isinf(moved), assumed, moved) * most)
    off = _JUMP if model.reset == "residual" else 1.0
    lost = off * np.sqrt(spikes * squares) + squares / 4
    lost = model.dead_time * np.maximum(high, 1) * lost
    return rounding + np.where(np.asarray(scene.planes) > 0, lost, 0.0)


def _reaching(scene: Summary) -> Values:
    """Root of the share of a tile's pixels with its brightest light at which an error of these
    pixels is largest, relative to the mean light of the tile or the floor, (tiles,)."""
    low, high = (np.asarray(x, np.float64) / scene.threshold for x in (
        scene.darkest, scene.brightest
    ))  # fmt: skip
    share = np.maximum(low, scene.floor - low) / np.maximum(high - low, 1e-300)
    return np.asarray(np.sqrt(np.minimum(share, 1)))


def _rounding(mean: float, cycles: int) -> float:
    """Rounding of the charge of a number of cycles, and of a fraction in float64, in spikes. Levels
    and slopes are whole units of 2^-40 electrons."""
    return 8 * cycles / (ONE * mean) + 2.0**-48


def _table_walk(setting: CameraSetting, scene: Summary, cycles: int) -> Values:
    """Phase by which the exact tier's table of thresholds and its rounding are off after a number
    of cycles, in spikes, (tiles,)."""
    mean, spread = setting.model.mean, setting.spread
    light = np.asarray(scene.brightest, np.float64) / mean
    spikes = np.minimum(light, 1) * cycles
    walk: Values = TABLE_RMS * spread * np.sqrt(spikes) + TABLE_BIAS * spread**2 * spikes
    return walk + _rounding(mean, cycles)


def _fast_walk(setting: CameraSetting, scene: Summary, cycles: int) -> Values:
    """Phase by which the fast tier's thresholds and its rounding are off from the exact tier's
    after a number of cycles, in spikes, (tiles,).

    Under constant light the increment of a cycle is always rounded alike: by a uniform part of a
    unit, and by that of its float32. Errors of thresholds are independent, but for their mean.
    """
    units, mean = units_of(setting.model), setting.model.mean
    unit = 2.0**-units.bits
    light = np.asarray(scene.brightest, np.float64) / mean
    spikes = np.minimum(light, 1) * cycles
    roundings = FLOAT_RMS * (1 + 4 * len(setting.model.transfers))  # a transfer adds about four
    law = LAW_RMS * np.sqrt(spikes) + LAW_BIAS * spikes
    rounded = unit / np.sqrt(12) + roundings * light
    return np.asarray(rounded * cycles + units.error * unit * law)


def _walk(setting: CameraSetting, scene: Summary, tier: Tier, cycles: int) -> Values:
    """Phase by which a tier's thresholds and rounding are off after a number of cycles, in spikes,
    (tiles,)."""
    walk = _table_walk(setting, scene, cycles)
    if tier == "exact":
        return walk
    walk = walk + _fast_walk(setting, scene, cycles)
    return np.where(_subtracts_means(setting, scene), np.maximum(walk, 1.0), walk)


def _subtracts_means(setting: CameraSetting, scene: Summary) -> npt.NDArray[np.bool_]:
    """Tiles with changing light that reaches the longest threshold, (tiles,). There the fast tier
    subtracts thresholds at their mean. When the light falls below it again, the phase is off by up
    to a spike."""
    units = units_of(setting.model)
    most = np.asarray(scene.brightest, np.float64) / setting.model.mean
    over = most * (1 + GAINS * scene.uneven) >= units.top / units.one
    falls = (np.asarray(scene.planes) > 0) & ~saturated_tiles(scene)
    return np.asarray(over & falls & (setting.model.noisy or scene.dead > 0))


def _phase_error(
    setting: CameraSetting, scene: Summary, tier: Tier, chance: Values | None = None
) -> Values:
    """Relative error of the rates of each tile, (tiles,), if phases are off by thresholds, rounding
    and dead time. Rare events are limits, and count once. chance: see `rare_error`."""
    walk = _walk(setting, scene, tier, scene.cycles)
    inside = _walk(setting, scene, tier, scene.window)
    dead = _dead_shift(setting, scene, scene.cycles, tier)
    # The RMS over a tile is relative to its mean light or the floor. It is largest if only a share
    # of the pixels reaches the brightest light. The shift of the dead time is a limit already.
    part = _reaching(scene) / ESTIMATE_WEIGHT
    moved_inside = _dead_shift(setting, scene, scene.window, tier)
    # If all of them brighten at once, it is relative to a window that is partly bright.
    low, high = (np.asarray(x, np.float64) / scene.threshold for x in (
        scene.darkest, scene.brightest
    ))  # fmt: skip
    window = (low + (high - low) / _AFTER) * scene.window
    at_once = share_of_window(moved_inside / ESTIMATE_WEIGHT, scene, window)
    few = share_of_window(part * moved_inside, scene)
    smooth = share_of_window(inside, scene) + np.maximum(few, at_once)
    smooth = smooth + ends_error(scene, walk + part * dead)
    moved = walk + ESTIMATE_WEIGHT * dead
    rare = latch_error(scene, moved, chance) + crossing_error(scene, moved, chance)
    # A saturated pixel fires in every cycle; the fractions at the ends of a window remain.
    least = share_of_window(walk, scene)
    return ESTIMATE_WEIGHT * np.where(
        saturated_tiles(scene), least, smooth + rare / ESTIMATE_WEIGHT
    )


def moved_spikes(setting: CameraSetting, scene: Summary, tier: Tier) -> Values:
    """Spikes a cycle of a pixel that the tier latches in another cycle than the reference,
    (tiles,).

    A pixel whose phase is off by x spikes has latched a spike early or late in the share x of all
    cycles. The errors of the fast tier count with their limits, and all with the same sign: images
    of a display consist of whole spikes, which the other bounds neglect.
    """
    cycles, dead = scene.cycles, _dead_shift(setting, scene, scene.cycles, tier)
    if setting.model.reset == "hard":
        mean, spread = setting.model.mean, setting.spread
        low, high = (np.asarray(x, np.float64) / mean for x in (scene.darkest, scene.brightest))
        charge = 4 * TABLE_RMS * spread + _rounding(mean, cycles) + _dead_shift(setting, scene, 1)
        return _moved_spikes(spread, low, high, charge, cycles) / cycles
    walk = _table_walk(setting, scene, cycles)
    if tier == "fast":
        units = units_of(setting.model)
        unit = 2.0**-units.bits
        light = np.asarray(scene.brightest, np.float64) / setting.model.mean
        roundings = 2.0**-23 * (1 + 4 * len(setting.model.transfers))
        walk = walk + cycles * (unit / 2 + (roundings + units.error * unit) * light)
    return np.minimum(walk + dead, 1.0)


def exact_error(setting: CameraSetting, scene: Summary) -> Values:
    """Relative RMS error of the rates of each tile in the exact tier against the reference,
    (tiles,)."""
    if setting.model.reset != "hard":
        return _phase_error(setting, scene, "exact")
    low, high = np.broadcast_arrays(
        np.asarray(scene.darkest, np.float64), np.asarray(scene.brightest, np.float64)
    )
    mean, spread = setting.model.mean, setting.spread
    # Errors end with the interval.
    interval = 4 * TABLE_RMS * spread + _rounding(mean, scene.cycles)
    charge = interval + _dead_shift(setting, scene, 1)
    moved = _moved_spikes(spread, low / mean, high / mean, charge, scene.cycles)
    value = ESTIMATE_WEIGHT * share_of_window(2 * charge, scene)
    return value + np.where(saturated_tiles(scene), 0.0, rare_error(scene, moved))


def _moved_spikes(spread: float, low: Values, high: Values, charge: Values, cycles: int) -> Values:
    """Spikes of a pixel that fall into another cycle in a run, under a hard reset.

    These are the spikes whose threshold lies within `charge` of the accumulated charge at some
    edge. The densities of a threshold at points at least `low` apart sum to at most its peak plus
    1 / low. All in nominal thresholds.
    """
    peak = np.inf if spread == 0 else 1 / (np.sqrt(2 * np.pi) * spread)
    density = peak + 1 / np.maximum(low, 1e-12)
    return cycles * np.minimum(high, 1) * np.minimum(2 * charge * density, 1)


def fast_error(
    setting: CameraSetting, scene: Summary, banked: npt.NDArray[np.bool_] | None = None
) -> Values:
    """Relative RMS error of the rates of each tile in the fast tier against the reference,
    (tiles,); infinite where there is no bound.

    Args:
        setting: the camera with every effect.
        scene: summary of the scene.
        banked: (tiles,) tiles whose thresholds come from the bank; None for none. They have other
            spikes than the reference in any case, with the same distribution. A rare event there is
            neglected where a tile has it with a chance of CHANCE: on average it changes that part
            of a spike. Elsewhere any tile of the scene may have it with this chance.

    It is the error of the exact tier, and the smaller of two values. The proof against the exact
    tier (sensor/latched/fast/bound.py) holds for the nominal pixel and assumes that all rounding
    errors of the run have the same sign. The estimate takes their expected sizes
    (`_fast_walk`), and their sum over the run as a shift of the spikes against their draws.
    """
    proof = ESTIMATE_WEIGHT * _fast_proof(setting, scene) + exact_error(setting, scene)
    if setting.reset != "residual":  # the rate is not smooth in the charge
        return proof
    chance = None
    if banked is not None:
        chance = np.where(banked, CHANCE, CHANCE / banked.size)
    return np.minimum(proof, _phase_error(setting, scene, "fast", chance))


def _fast_proof(setting: CameraSetting, scene: Summary) -> Values:
    """The proven bound, (tiles,): one for all tiles below the nominal threshold a cycle, one for
    all above. It exists for light below the shortest threshold and above the longest, but not in
    between."""
    model = setting.model
    low, high = np.broadcast_arrays(scene.darkest, scene.brightest)
    bright = low > model.mean
    out = np.zeros(low.shape)
    for tiles in (bright, ~bright):
        if tiles.any():
            least, most = float(low[tiles].min()), float(high[tiles].max())
            bound = rate_bound(model, least, most, scene.window, scene.floor, scene.cycles)
            out[tiles] = float(bound.value)
    return out
