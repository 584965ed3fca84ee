"""What the plan of a latched camera promises of the error of its spikes, and of their law."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cosim.plan.error import Bounds, Law, Measured
from sensor.latched.planning import CameraPlan
from sensor.latched.tiers import Tier


def law_of_plan(plan: CameraPlan) -> Law | None:
    """Change of the law of spikes by the bank, computed from the bank itself over all tiles that
    take it; None where none does. Limits of the mean include all bounds of the plan."""
    tiles = plan.from_bank
    if not tiles.any():
        return None
    from sensor.latched.fast.bank_law import bank_law

    scene = plan.survey.scene
    darkest, brightest = (
        np.broadcast_to(np.asarray(light, np.float64) / scene.threshold, tiles.shape)[tiles]
        for light in (scene.darkest, scene.brightest)
    )
    law, most = bank_law(plan.setting.model, darkest, brightest), float(plan.promised[tiles].max())
    return replace(law, mean=law.mean.within(most, -most))


@dataclass(frozen=True, kw_only=True)
class LatchedBounds(Bounds):
    """The bounds of a latched camera.

    Attributes:
        arithmetic: Limit for the arithmetic of the tier.
        tier: Tier of most tiles.
        better: Share of tiles that a better tier simulates, 0 to 1.
    """

    arithmetic: float
    tier: Tier
    better: float

    @classmethod
    def of_plan(
        cls, plan: CameraPlan, measured: Measured | None = None, law: Law | None = None
    ) -> LatchedBounds:
        """The bounds of a plan, and what its check has measured."""
        return cls(
            bound=float(np.max(plan.promised)),
            # The bounds of the arithmetic are estimates; those of the effects may be proofs.
            kind=plan.plan.kind if not plan.tier_error.any() else "estimate",
            left_out={row.effect: row.bound for row in plan.plan.absent},
            kept=plan.plan.everywhere,
            tolerance=plan.plan.tolerance,
            measured=measured,
            arithmetic=float(np.max(plan.tier_error)),
            tier=plan.tier,
            better=float(plan.fine.mean()),
            of=plan.of,
            law=law_of_plan(plan) if law is None else law,
        )
