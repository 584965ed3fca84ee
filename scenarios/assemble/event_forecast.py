"""What `viform plan` says of an asynchronous readout."""

from __future__ import annotations

from typing import Any

from scenarios.assemble.event_plan import begin_events, plan_events
from scenarios.assemble.scenario import Scenario
from sensor.asynchronous.cost import reference_cost

__all__ = ["forecast_events"]


def forecast_events(name: str, scenario: Scenario) -> dict[str, Any]:
    """The document of `viform plan --json` for asynchronous pixels, whose own time hangs on the
    events and is not predicted."""

    rows, start = plan_events(scenario), begin_events(scenario)
    view = start.view
    cost = reference_cost(start.model, view, start.plan(scenario.tolerance), 1)
    full = cost.seconds * start.stop / (view.until - view.light.pieces[0].start)
    return {
        "scenario": name,
        "tolerance": scenario.tolerance,
        "tier": "fast" if scenario.tolerance > 0 else "exact",
        "device": "numba on this processor",
        "tiles": {},
        "kept": [row["effect"] for row in rows if row["kept"]],
        "left_out": [
            {"effect": r["effect"], "bound": r["bound"], "kind": r["kind"], "share": 1 - r["share"]}
            for r in rows if r["share"] < 1
        ],
        "promised": None,
        "promised_kind": None,
        "rows": [
            {
                "effect": r["effect"], "kept": r["share"], "bound": r["bound"], "kind": r["kind"],
                "cost_ns": r["cost_ns"],
            }
            for r in rows
        ],
        "sets": [],
        "predicted": {"sensor_s": None, "full_physics_s": full},
    }  # fmt: skip
