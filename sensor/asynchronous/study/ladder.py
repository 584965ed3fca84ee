"""Error against run time of asynchronous pixels: a ladder of tolerances.

The tier "fast" is the engine, and closed form where a tile's plan lets it; at tolerance 0 it is the
engine alone, so this is the exact tier.

A cycle is one of sensor.clock. Time is that of the pixels alone, their making included: one call
discarded, the least of the rest; finding the plan and the error is not timed.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from cosim import PS, InputError
from cosim.plan.ladder import fit_order
from cosim.run.progress import Progress
from sensor.asynchronous.pixel.reference import quantile_error
from sensor.asynchronous.plan.cost import least, reference_cost
from sensor.asynchronous.plan.law import WeakError, weak_error
from sensor.asynchronous.plan.plan import EventPlan
from sensor.asynchronous.plan.planned import PlannedPixels
from sensor.asynchronous.plan.verify import choose_tiles, measure, verify
from sensor.asynchronous.run import EventStart

TOLERANCES: Final = (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 0.0)
_CALLS: Final = 25
_BRIGHTEST: Final = 1024
"""Pixels whose unsent spikes are compared in law."""
_DIGITS: Final = 200_000
"""Terms that checking the reference's quantiles may add up."""
_ROUNDING: Final = 2.0**-50
"""Rounding of the reference's instants: a few roundings of float64 each."""


def _run(start: EventStart, plan: EventPlan) -> None:
    view = start.view
    pixels = PlannedPixels(plan, view.pattern, view.shape, view.gain)
    pixels.step(view.light, view.light.pieces[0].start, view.until)


def _reference(start: EventStart, plan: EventPlan) -> dict[str, Any]:
    """What an interval and a pixel cost the reference, on the brightest tile, what the whole run
    would cost it, and its own error."""
    cost = reference_cost(start.spec.model, start.view, plan, _CALLS)
    checked = cost.numbers[: max(_DIGITS // start.spec.model.threshold, 1)]
    own = max(quantile_error(start.spec.model, checked), _ROUNDING)
    return {
        "what": "every interval by itself in float64, instants in whole picoseconds and a "
        "fraction, scipy's quantiles of Gamma(Q) at the same random words, compiled by numba; "
        "its cost is that of an interval and of a pixel on the brightest tile, times those "
        "that the light of the whole array makes",
        "intervals_measured": cost.intervals_timed, "ns_per_interval": cost.each * 1e9,
        "intervals": cost.intervals,
        "error": own,
        "error_is": f"thresholds of {checked.size} pixels against the law added up in 60 digits, "
        "and a few roundings",
        "run_time_s": cost.seconds,
        "ns_per_pixel_cycle": cost.seconds * 1e9 / (plan.scene.tile_of.size * start.cycles),
    }  # fmt: skip


def _weak(start: EventStart, plan: EventPlan) -> WeakError | None:
    """Of the brightest pixels."""
    view = start.view
    if not plan.scene.steady:
        return None
    light = view.light.pieces[0].first.ravel().astype(np.float64) * view.gain
    numbers = np.sort(np.argsort(-light, kind="stable")[:_BRIGHTEST]).astype(np.uint32)
    rates = light[numbers]
    if view.pattern is not None:
        fixed = view.pattern.at(numbers)
        rates = rates * fixed.gain + fixed.dark
    lit = rates > 0
    return weak_error(start.spec.model, numbers[lit], rates[lit] / PS) if lit.any() else None


def _left_out(plan: EventPlan) -> list[str]:
    """Effects that some tile leaves out."""
    pairs = zip(plan.effects, plan.left_out, strict=True)
    return [effect.name for effect, out in pairs if out.any()]


def measure_ladder(start: EventStart, progress: Progress) -> dict[str, Any]:
    """{reference, order, rows, floor, weak} of a scenario with asynchronous pixels.

    rows: {tier, tolerance, error, ci, run_time_s, ns_per_pixel_cycle, effects, failed, notes,
    left_out}, the loosest first. error: as `event_verify` has it, of the worst of the tiles that
    any row's plan has reason to look at. floor: the reference's own error; and, of the laws of
    unsent spikes, what chance alone makes of the mean. Raises InputError for what a run would
    refuse.
    """
    progress.start("accuracy of asynchronous pixels", len(TOLERANCES) + 1)
    checks = [verify(start.plan(tol), start.view, tol) for tol in TOLERANCES]
    tiles = sorted({n for c in checks for n in choose_tiles(c.plan, start.view.seed)})
    full = checks[-1].plan
    reference = _reference(start, full)
    progress.advance(1)
    pixels, own = full.scene.tile_of.size, float(reference["error"])
    rows: list[dict[str, Any]] = []
    for n, (tolerance, checked) in enumerate(zip(TOLERANCES, checks, strict=True)):
        row = {
            "tier": "fast", "tolerance": tolerance, "error": None, "ci": None, "run_time_s": None,
            "ns_per_pixel_cycle": None, "effects": checked.plan.acting(channel=False),
            "failed": None, "notes": checked.notes,
            "left_out": _left_out(checked.plan),
        }  # fmt: skip
        try:
            spent = least(lambda plan=checked.plan: _run(start, plan), _CALLS)  # type: ignore[misc]
            distance = measure(checked.plan, start.view, tiles)
            row |= {
                "error": distance.value, "ci": [distance.low, distance.high], "run_time_s": spent,
                "ns_per_pixel_cycle": spent * 1e9 / (pixels * start.cycles),
            }  # fmt: skip
        except InputError as exc:
            row["failed"] = str(exc)
        rows.append(row)
        progress.advance(n + 2)
    lowest = min((r["error"] for r in rows if r["error"] and not r["tolerance"]), default=0.0)
    order = fit_order([(r["tolerance"], r["error"] or 0.0) for r in rows], lowest)
    rows.append({
        "tier": "reference", "tolerance": 0.0, "error": own, "ci": [0.0, own],
        "run_time_s": reference["run_time_s"],
        "ns_per_pixel_cycle": reference["ns_per_pixel_cycle"],
        "effects": full.acting(channel=False), "failed": None, "left_out": [],
        "notes": ["run time: predicted, see reference"],
    })  # fmt: skip
    weak = _weak(start, full)
    return {
        "reference": reference,
        "order": order,
        "rows": rows,
        "floor": {"reference": own, "monte_carlo": None if weak is None else weak.mean[2]},
        "weak": None
        if weak is None
        else {
            "what": f"{weak.intervals} unsent intervals of {weak.pixels} of the brightest pixels: "
            "charge against the closed form, (engine, reference, 99.9 % by chance)",
            "mean": weak.mean,
            "variance": weak.variance,
        },
    }
