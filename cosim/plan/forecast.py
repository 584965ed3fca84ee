"""The document of `viform plan`: effects that a run would keep and leave out, and run times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from cosim.plan.planner import Plan, Values


@dataclass(frozen=True)
class Speeds:
    """Run times in ns per pixel-cycle, None if unknown.

    Attributes:
        planned, everything: the camera with the planned effects, and with all effects.
        full: full physics.
        scene: computation of the light.
    """

    planned: float | None
    everything: float | None
    full: float | None
    scene: float | None

    def document(self, pixel_cycles: float) -> dict[str, float | None]:
        """The key `predicted` of the document, for a run of `pixel_cycles`."""

        def seconds(ns: float | None) -> float | None:
            return None if ns is None else ns * pixel_cycles * 1e-9

        return {
            "ns_per_pixel_cycle": self.planned,
            "sensor_s": seconds(self.planned),
            "scene_s": seconds(self.scene),
            "everything_ns_per_pixel_cycle": self.everything,
            "everything_s": seconds(self.everything),
            "full_physics_ns_per_pixel_cycle": self.full,
            "full_physics_s": seconds(self.full),
        }


def forecast_document(
    name: str, plan: Plan, *, tier: str, device: str, tier_error: Values | float, speeds: Speeds,
    pixel_cycles: float, kept: Sequence[str] | None = None, **others: Any,
) -> dict[str, Any]:  # fmt: skip
    """The document of a plan.

    Args:
        name: name of the scenario.
        plan: plan of the run.
        tier, device: tier and device of the run.
        tier_error: bound of the error of the tier's arithmetic, relative; a number, or one a tile.
        speeds: predicted run times.
        pixel_cycles: size of the run.
        kept: effects that some tile keeps; by default, those of the plan.
        others: keys of one kind of machine, which precede `kept`.
    """
    kept = list(plan.everywhere if kept is None else kept)
    return {
        "scenario": name,
        "tolerance": plan.tolerance,
        "tier": tier,
        "device": device,
        "tiles": {},
        **others,
        "kept": kept,
        "left_out": [
            {"effect": r.effect, "bound": r.bound, "kind": r.kind, "share": 1 - r.kept}
            for r in plan.absent
        ],
        "promised": float(np.max(plan.total + tier_error)),
        "promised_kind": "estimate" if np.any(tier_error) else plan.kind,
        "rows": [asdict(row) for row in plan.rows],
        "sets": [
            {"effects": list(effects), "tiles": count} for effects, count in plan.sets.items()
        ],
        "predicted": speeds.document(pixel_cycles),
    }  # fmt: skip
