"""Bound of the difference between the rates of the fast and the exact tier; proven for `residual`.

Let G be the number of spikes plus the stored share of the current interval. As a function of the
accumulated charge, G rises linearly from k to k + 1 between the charges of spikes k and k + 1, with
a slope of 1 / threshold. If all these charges, and the accumulated charge, have an error of at most
E, then G has an error of at most E / (shortest threshold). E grows with

    each cycle   by half a unit (rounding of the increment) and the float32 rounding of its light;
                 in a ramp without noise and dead time also by the rounding of its growth, which
                 adds up over the cycles since the anchor,
    each spike   by the error of the threshold, and with dead time by that of the lost light. If a
                 spike falls on the edge of a cycle in one tier and beyond it in the other, the
                 light of another cycle is lost.

Reading the fraction adds a unit and the error of a threshold. The bound holds while a cycle cannot
contain two spikes, because its light is below the shortest threshold. Light above the longest
threshold fires in every cycle in both tiers, and the rates then differ only by the two fractions.
In between, the number of spikes in a cycle depends on the last bit, and there is no bound.

Under `subtract` the same holds while no charge accumulates beyond a threshold. Under `hard` errors
end with the interval. However, a spike that falls on the edge of a cycle in one tier and beyond it
in the other loses the light of another cycle, so the rate is not smooth in the charge. The number
of such spikes is estimated.
"""

from __future__ import annotations

import math
from typing import Final

from cosim.plan.effects import Bound
from cosim.spikes.viform import WORD
from sensor.latched.fast.units import units_of
from sensor.latched.pixel.charge import ONE
from sensor.latched.pixel.model import ExactModel

_ROUNDINGS: Final = 10 * 2.0**-24
"""Rounding of a cycle's light in float32, relative to the brightest level: gain, dark charge, their
product and sum, difference of levels, weight, product, sum, conversion to units, and the half that
is added."""
_GROWTH: Final = 2 * (WORD - 1) / 2 * 2.0**-32
"""Mean error of a ramp without noise, thresholds: its growth is cut to an even number of units, and
the error adds up over the cycles of a word."""


def rate_bound(
    model: ExactModel,
    dimmest: float,
    brightest: float,
    window: int,
    floor: float = 0.0,
    cycles: int | None = None,
) -> Bound:
    """Largest difference between a pixel's rates in this tier and in the exact tier, with the same
    draws, relative to max(rate, floor).

    A rate counts spikes plus the change of stored charge over the threshold of its interval.

    Args:
        model: rules of the pixel.
        dimmest, brightest: limits of the light in the whole run, electrons a cycle, including dark
            current.
        window: cycles over which the rate is taken.
        floor: spikes a cycle.
        cycles: cycles of the run up to the end of the window, by default the window.

    Returns:
        The bound; infinite where there is none.
    """
    units = units_of(model)
    unit, ramp = 2.0**-units.bits, 0.0
    error, shortest, dead = units.error * unit, units.shortest * unit, model.dead / 65536
    low, high = dimmest / model.mean, brightest / model.mean
    if not model.noisy and not model.dead:
        unit, ramp = 2.0**-32, _GROWTH
    rate = low / (1 + low * dead)
    scale = window * max(min(rate, 1.0), floor)
    top = units.top * 2.0**-units.bits
    if dead == 0 and low >= top and model.reset != "subtract":
        return Bound(2 / scale, "proof")
    # The rounding of transfers has no bound here.
    if model.transfers or scale == 0 or (high >= shortest and model.reset != "hard"):
        return Bound(math.inf, "proof")
    run = window if cycles is None else cycles
    # The exact tier rounds as well: the slope in every cycle, and the light lost in dead time.
    a_cycle = unit / 2 + ramp + _ROUNDINGS * high + run / (ONE * model.mean)
    lost = unit + _ROUNDINGS * high + 2.0**-24 / model.mean
    rounded = abs(dead - model.dead_time) if model.dead else 0.0  # in the exact tier alone
    a_spike = error + dead * (lost + high - low) + rounded * high

    if model.reset == "hard":
        longest = min(top / low, run) if low > 0 else run
        charge = 2 * unit + longest * a_cycle + error + dead * lost
        value = 4 * charge / shortest + _moved(model, charge, low, high, run) * 2 * high / shortest
        return Bound(value / scale, "estimate")

    def off(n: int) -> float:
        return 2 * unit + n * a_cycle + (n * high / shortest + 1) * a_spike

    ends = off(run) + off(run - window) + 2 * (error + unit) + 2 * dead * high
    return Bound(ends / shortest / scale, "proof")


def _moved(model: ExactModel, charge: float, low: float, high: float, run: int) -> float:
    """RMS number of spikes of a run that fall into another cycle under a hard reset.

    These are the spikes whose threshold lies within `charge` of the accumulated charge at some
    edge. The densities of a threshold at points at least `low` apart sum to at most its peak plus 1
    / low. Charges are in nominal thresholds. Without noise the result is infinite, because all
    spikes of a pixel may then be ties.
    """
    shot = model.threshold if model.shot else 0.0
    spread = math.sqrt(shot + model.threshold_noise**2) / model.mean
    if low == 0 or spread == 0:
        return math.inf
    peak = 1 / (math.sqrt(2 * math.pi) * spread)
    mean = run * min(high, 1.0) * min(2 * charge * (peak + 1 / low), 1.0)
    return math.sqrt(mean + mean * mean)


def charge_error(model: ExactModel, brightest: float, cycles: int) -> float:
    """Difference of accumulated charge and threshold from the exact tier's, in nominal thresholds.

    It is an estimate, because rounding errors have either sign.

    Args:
        model: rules of the pixel.
        brightest: most light of a cycle, electrons.
        cycles: cycles of accumulation without a reset to 0.
    """
    units = units_of(model)
    unit, high = 2.0**-units.bits, brightest / model.mean
    a_cycle = unit / 2 + _ROUNDINGS * high + model.dead / 65536 * unit
    spikes = 1.0 if model.reset == "hard" else min(high, 1.0) * cycles
    law = units.error * unit * math.sqrt(max(spikes, 1.0))
    return 2 * unit + math.sqrt(cycles) * a_cycle + law + cycles / (ONE * model.mean)
