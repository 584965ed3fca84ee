"""A threshold of its own for each spike, in place of one from the bank of the fast tier.

The bank (sensor/latched/pixel/bank.py) has the mean and the variance of the distribution of
thresholds. What it leaves out are the tails beyond 3.7 standard deviations, 0.4 % of the skew, and
the independence of neighbours, whose thresholds have a correlation below 1e-5. Both sources of
thresholds are equally random, so the bound is the change of the size of the noise, and not the
difference between two draws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from sensor.latched.effects.costs import bank_cost, noise_cost
from sensor.latched.effects.windows import noise_error
from sensor.latched.setting import CameraSetting

__all__ = ["OWN_DRAWS", "SOURCE", "with_own_draws"]

OWN_DRAWS: Final = "a draw for each spike"
"""Name in plans and reports."""
SOURCE: Final = "quantiles of one random word for each spike; without it, those of a bank"
_LAW: Final = 5e-3
"""Difference of the bank's distribution from that of a threshold, relative to its standard
deviation: of the skew 4e-3, and of the variance of counts 1e-3, as the tests measure."""
_GROUP: Final = "noise"


def _bound(scene: Summary) -> Bound:
    return Bound(noise_error(scene, _LAW * scene.spread), "estimate")


def with_own_draws(effects: Sequence[Effect], setting: CameraSetting) -> tuple[Effect, ...]:
    """The effects of a run in the fast tier, in which noise may come from the bank: its cost is
    then that of the bank, and draws of their own for each spike are an effect that costs the rest.

    Where registers are written or thresholds spread too widely there is no bank, and the effects
    are returned as they are.
    """
    from sensor.latched.pixel.bank import has_bank

    if setting.writes or not has_bank(setting.model):
        return tuple(effects)
    cheaper = tuple(
        replace(effect, cost=bank_cost) if effect.group == _GROUP else effect for effect in effects
    )
    own = Effect(
        OWN_DRAWS, SOURCE, Stream.SHOT_NOISE, _bound, noise_cost, "tile", _GROUP
    )  # fmt: skip
    return (*cheaper, own)
