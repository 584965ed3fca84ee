"""How far the fast tier's rate can be from the exact tier's: a proof where charge is carried.

Let G run linearly from k to k + 1 between the charges at which spikes k and k + 1 fall: spikes plus
the stored share of the running interval. Its slope is one over a threshold. So where all of these
charges, and the charge gathered, are right to E, G is right to E / (shortest threshold). E grows by

    a cycle   half a unit (the increment's rounding) and the float32 roundings of its light,
    a spike   the threshold's error, and with dead time that of the light lost. A spike that falls
              on a cycle's edge in one tier and beyond it in the other loses another cycle's light;

and the fraction itself is read with a unit and a threshold's error. This holds while a cycle cannot
hold two spikes, its light being less than the shortest threshold. Light that reaches the longest
fires in every cycle in both tiers, whose rates then differ by the two fractions alone. In between
the number of spikes that share a cycle hangs on the last bit, and nothing is promised.

Under `subtract` the same holds while no charge piles up. Under `hard` errors end with the interval,
but a spike that falls on a cycle's edge in one tier and beyond it in the other loses another
cycle's light, so that the rate is not smooth in the charge: how often that happens is an estimate.
"""

from __future__ import annotations

import math
from typing import Final

from cosim.plan.effects import Bound
from sensor.latched.fast.units import units_of
from sensor.latched.pixel.fixed_point import ONE
from sensor.latched.pixel.model import ExactModel

__all__ = ["charge_error", "rate_bound"]

_ROUNDINGS: Final = 10 * 2.0**-24
"""Of a cycle's light in float32, relative to the brightest level: gain, dark charge, their product
and sum, difference of levels, weight, product, sum, units, the half that is added."""


def rate_bound(
    model: ExactModel,
    dimmest: float,
    brightest: float,
    window: int,
    floor: float = 0.0,
    cycles: int | None = None,
) -> Bound:
    """Largest difference of a pixel's rate between this tier and the exact one, with the same
    draws, relative to max(rate, floor).

    dimmest, brightest: light of a cycle in electrons, dark current in it, of the levels between
    which light runs in the whole run. window: cycles over which the rate is taken (spikes plus the
    change of stored charge over the running interval's own threshold). floor: spikes a cycle.
    cycles: of the run up to the window's end, the window alone unless given.

    The value is infinite where nothing can be promised.
    """
    units = units_of(model)
    unit = 2.0**-units.bits
    error, shortest, dead = units.error * unit, units.shortest * unit, model.dead / 65536
    low, high = dimmest / model.mean, brightest / model.mean
    if not model.noisy and not model.dead:
        unit = 2.0**-32
    rate = low / (1 + low * dead)
    scale = window * max(min(rate, 1.0), floor)
    top = units.top * 2.0**-units.bits
    if dead == 0 and low >= top and model.reset != "subtract":
        return Bound(2 / scale, "proof")
    # No rounding of a transfer is bounded here.
    if model.transfers or scale == 0 or (high >= shortest and model.reset != "hard"):
        return Bound(math.inf, "proof")
    run = window if cycles is None else cycles
    # The exact tier rounds too: a slope for as many cycles, and the light that dead time costs.
    a_cycle = unit / 2 + _ROUNDINGS * high + run / (ONE * model.mean)
    lost = unit + _ROUNDINGS * high + 2.0**-24 / model.mean
    a_spike = error + dead * (lost + high - low)

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
    """RMS number of spikes of a run that fall into another cycle under a hard reset: those whose
    threshold lies within `charge` of what is gathered at some edge. The densities of a threshold at
    points at least `low` apart sum to its peak and 1 / low at most. All in nominal thresholds.

    Infinite without noise: all spikes of a pixel may then be ties.
    """
    shot = model.threshold if model.shot else 0.0
    spread = math.sqrt(shot + model.threshold_noise**2) / model.mean
    if low == 0 or spread == 0:
        return math.inf
    peak = 1 / (math.sqrt(2 * math.pi) * spread)
    mean = run * min(high, 1.0) * min(2 * charge * (peak + 1 / low), 1.0)
    return math.sqrt(mean + mean * mean)


def charge_error(model: ExactModel, brightest: float, cycles: int) -> float:
    """By how much a charge that has been gathered for so many cycles without a reset to zero, with
    the threshold that it is held against, may differ from the exact tier's, in nominal thresholds:
    an estimate, since roundings go either way. brightest: light of a cycle in electrons, at most.
    """
    units = units_of(model)
    unit, high = 2.0**-units.bits, brightest / model.mean
    a_cycle = unit / 2 + _ROUNDINGS * high + model.dead / 65536 * unit
    spikes = 1.0 if model.reset == "hard" else min(high, 1.0) * cycles
    law = units.error * unit * math.sqrt(max(spikes, 1.0))
    return 2 * unit + math.sqrt(cycles) * a_cycle + law + cycles / (ONE * model.mean)
