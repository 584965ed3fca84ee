"""A threshold of its own for each spike, in place of one from the bank of the fast tier.

The bank (sensor/latched/pixel/bank.py) has one threshold for each of 4096 equal shares of the
distribution. Independent thresholds can be drawn by first drawing the entry of the bank, and then a
threshold within its share. Two pixels with such pairs of thresholds differ by what the bank leaves
out of the distribution: `bank_distance`, .006 of its standard deviation, for each interval. The
bound is the error of a window that lacks a noise of this size. Correlations between the draws of
neighbours are below 1e-5 and are neglected. To this is added the rounding of light that grows by a
whole number of units a cycle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Final, Literal

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from cosim.spikes.viform import WORD
from sensor.latched.effects.effect import bank_cost, noise_cost
from sensor.latched.effects.windows import noise_error

if TYPE_CHECKING:
    from sensor.latched.setting import CameraSetting

OWN_DRAWS: Final = "a draw for each spike"
"""Name in plans and reports."""
Draws = Literal["each", "bank"]
"""Source of thresholds: a draw for each spike, or the bank where the tolerance allows it."""
SOURCE: Final = "quantiles of one random word for each spike; without it, those of a bank"
_GROUP: Final = "noise"
_GROWTH: Final = 0.5 * (WORD - 1) / 2
"""Mean error of the light of a ramp, units: half a unit of its growth adds up over the cycles of a
word."""


def with_own_draws(effects: Sequence[Effect], setting: CameraSetting) -> tuple[Effect, ...]:
    """The effects of a run in the fast tier, in which noise may come from the bank: its cost is
    then that of the bank, and draws of their own for each spike are an effect that costs the rest.

    Where registers are written or thresholds spread too widely there is no bank, and the effects
    are returned as they are.
    """
    from sensor.latched.fast.units import units_of
    from sensor.latched.pixel.bank import bank_distance, has_bank

    if setting.writes or not has_bank(setting.model):
        return tuple(effects)
    distance = bank_distance(setting.model)
    growth = _GROWTH * 2.0 ** -units_of(setting.model).bits * setting.threshold

    def bound(scene: Summary) -> Bound:
        return Bound(noise_error(scene, distance) + scene.relative(growth), "estimate")

    cheaper = tuple(
        replace(effect, cost=bank_cost) if effect.group == _GROUP else effect for effect in effects
    )
    own = Effect(OWN_DRAWS, SOURCE, Stream.SHOT_NOISE, bound, noise_cost, "tile", _GROUP)
    return (*cheaper, own)
