"""An asynchronous camera that is planned and measured without a run: what full physics costs, what
a run would keep and leave out, and error against run time over a ladder of tolerances.

Full physics is every interval by itself, on the brightest tile, times the intervals that the light
of the whole array makes. The tier "fast" is the engine, and closed form where a tile's plan lets
it; at tolerance 0 it is the engine alone, so this is the exact tier. A cycle is one of
sensor.clock. Time is that of the pixels alone, their making included: one call discarded, the least
of the rest; finding the plan and the error is not timed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import PS, InputError
from cosim.light.steps import light_steps
from cosim.plan.error import Measured
from cosim.plan.planner import EffectRow
from cosim.plan.study import REFERENCE, Step, ladder_document, plan_document
from cosim.run.progress import Progress
from cosim.run.timing import least
from sensor.asynchronous.model import EventModel
from sensor.asynchronous.pixel.array import AsynchronousPixels
from sensor.asynchronous.pixel.closed import ClosedPixels
from sensor.asynchronous.pixel.reference import follow, quantile_error
from sensor.asynchronous.plan.check import View, check_events, measure, tiles_of
from sensor.asynchronous.plan.effects import LATER
from sensor.asynchronous.plan.law import WeakError, weak_error
from sensor.asynchronous.plan.plan import EventPlan, PlannedPixels, reduced
from sensor.asynchronous.run import EventSpec, EventStart
from sensor.asynchronous.setting import channel_model

_FEW: Final = 8
_MANY: Final = 64
"""Intervals a pixel whose difference in time is the cost of one."""
_ENOUGH: Final = 5.0
"""Seconds of repeated calls after which no more are made."""
_SAMPLE: Final = 4096
"""Pixels that costs are measured on."""
_SPIKES: Final = 500_000
"""Upper limit of the spikes of these pixels, where each is simulated by itself."""
_SKIPS: Final = 4.0
"""`EventModel.change` from which on at most one spike in 256 is reported."""
_FORECAST: Final = 3
"""Timed calls of a forecast."""
_CALLS: Final = 25
"""Timed calls of a ladder."""
TOLERANCES: Final = (1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 0.0)
_BRIGHTEST: Final = 1024
"""Pixels whose unsent spikes are compared in law."""
_DIGITS: Final = 200_000
"""Terms that checking the reference's quantiles may add up."""
_ROUNDING: Final = 2.0**-50
"""Rounding of the reference's instants: a few roundings of float64 each."""


@dataclass(frozen=True, eq=False)
class Cost:
    """Time that the reference takes.

    Attributes:
        numbers: numbers of the pixels that were timed.
        intervals_timed: number of intervals of the longer call.
        each: time of an interval, s.
        pixel: time of a pixel, s.
        intervals: number of intervals of the whole array, as long as its light is known.
        seconds: time of all of them, s.
    """

    numbers: npt.NDArray[np.uint32]
    intervals_timed: int
    each: float
    pixel: float
    intervals: float
    seconds: float


def reference_cost(model: EventModel, view: View, plan: EventPlan, calls: int) -> Cost:
    """calls: that are timed, of which the least counts."""
    scene = plan.scene
    tile = int(np.argmax(scene.mean))
    numbers = np.flatnonzero(scene.tile_of == tile).astype(np.uint32)

    def call(intervals: int) -> int:
        run = follow(model, numbers, view.light, view.gain, view.pattern, view.until, intervals)
        return int(run.count.sum())

    few, many = (least(lambda n=n: call(n), calls, _ENOUGH) for n in (_FEW, _MANY))  # type: ignore[misc]
    # Fewer intervals than asked for are drawn all the same.
    each = max(many - few, 0.0) / (numbers.size * (_MANY - _FEW))
    pixel = max(few / numbers.size - _FEW * each, 0.0)
    lasts = (view.until - view.light.pieces[0].start) / PS
    intervals = float((scene.mean * scene.pixels).sum()) * lasts + scene.tile_of.size
    whole = pixel * scene.tile_of.size + each * intervals
    return Cost(numbers, call(_MANY), each, pixel, intervals, whole)


def forecast_events(start: EventStart) -> dict[str, Any]:
    """What a run would keep and leave out, and what full physics would take.

    The camera's own time depends on the number of events and is not predicted.
    """
    spec, view = start.spec, start.view
    plan = start.plan(spec.tolerance)
    cost = reference_cost(spec.model, view, plan, 1)
    full = cost.seconds * spec.stop / (view.until - view.light.pieces[0].start)
    return plan_document(
        spec.name, spec.tolerance, plan_rows(start, plan),
        tier="fast" if spec.tolerance > 0 else "exact", device="numba on this processor",
        predicted={"sensor_s": None, "full_physics_s": full},
    )  # fmt: skip


def plan_rows(start: EventStart, plan: EventPlan) -> list[EffectRow]:
    """Rows of a plan, and one for the shared channel, which delays events and loses those that find
    their place taken; costs are per pixel and cycle of sensor.clock, as they are measured."""
    costs = _costs(start, plan)
    rows = [replace(row, cost_ns=costs[row.effect]) for row in plan.rows]
    sensor, channel = start.spec.section, channel_model(start.spec.section)
    if channel is None or sensor.channel is None:
        return rows
    # A pixel's own place is free for its first report, and its time stamp is not late.
    harmless = channel.buffer == "pixel" and sensor.channel.timestamp == "pixel"
    if harmless and start.spec.model.change > 0:
        return [*rows, EffectRow("shared channel", 0.0, "proof", 1.0)]
    return [*rows, EffectRow("shared channel", np.inf, "estimate", 1.0)]


def _costs(start: EventStart, plan: EventPlan) -> dict[str, float]:
    """Nanoseconds per pixel and cycle of each effect: the difference of the times with and without
    it, on evenly chosen pixels. An effect that is part of a formula of others costs nothing."""
    view, clock = start.view, start.spec.setting.clock
    scene, n = plan.scene, plan.scene.tile_of.size
    numbers = np.unique(np.linspace(0, n - 1, _SAMPLE).astype(np.uint32))
    begin, stop = view.light.pieces[0].start, view.until
    fires = float(scene.mean[scene.tile_of[numbers]].sum())
    if scene.model.change < _SKIPS and fires > 0:
        stop = min(stop, begin + max(round(_SPIKES / fires * PS), 1))
    costs: dict[str, float] = {}

    def engine(names: frozenset[str]) -> Callable[[], object]:
        model, device = reduced(scene.model, view.pattern, names)
        return lambda: AsynchronousPixels(
            model, view.shape, view.gain, device, numbers=numbers
        ).unordered(view.light, begin, stop)

    def closed(names: frozenset[str]) -> Callable[[], object]:
        model, device = reduced(scene.model, view.pattern, names)
        return lambda: ClosedPixels(model, view.shape, view.gain, device, numbers).unordered(
            view.light, begin, stop
        )

    once = bool(scene.model.change and not scene.model.longest and scene.steady)
    run = closed if once else engine
    spend = partial(least, repeats=_FORECAST, enough=_ENOUGH)
    everything = frozenset(e.name for e in plan.effects)
    bare = spend(run(everything))
    for effect in plan.effects:
        spent = 0.0
        if effect.name == LATER and once:
            spent = spend(engine(frozenset())) - spend(closed(frozenset()))
        elif effect.name != LATER and effect.cost(scene) > 0:
            spent = spend(run(everything - {effect.name})) - bare
        per_second = numbers.size * clock.hz * (stop - begin) / PS
        costs[effect.name] = max(spent, 0.0) * 1e9 / per_second
    return costs


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
    """Weak error of the brightest pixels."""
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


def measure_ladder(start: EventStart, progress: Progress) -> dict[str, Any]:
    """The document of `viform accuracy`, its steps the loosest first, with `failed` and `notes` for
    each, and with `weak`, the laws of unsent spikes. The error is that of the worst of the tiles
    that any step's plan has reason to look at. Raises InputError for what a run would refuse."""
    progress.start("accuracy of asynchronous pixels", len(TOLERANCES) + 1)
    checks = [check_events(start.plan(tol), start.view, tol) for tol in TOLERANCES]
    tiles = sorted({n for c in checks for n in tiles_of(c.plan, start.view.seed)})
    full = checks[-1].plan
    reference = _reference(start, full)
    progress.advance(1)
    pixels, own = full.scene.tile_of.size, float(reference["error"])
    steps: list[Step] = []
    notes: list[dict[str, Any]] = []
    for n, (tolerance, checked) in enumerate(zip(TOLERANCES, checks, strict=True)):
        error, ns, failed = None, None, None
        try:
            spent = least(lambda plan=checked.plan: _run(start, plan), _CALLS, _ENOUGH)  # type: ignore[misc]
            error = measure(checked.plan, start.view, tiles)
            ns = spent * 1e9 / (pixels * start.cycles)
        except InputError as exc:
            failed = str(exc)
        steps.append(Step.measured(
            "fast", tolerance, error, ns, pixels * start.cycles,
            checked.plan.acting(channel=False), checked.plan.plan.left_out,
        ))  # fmt: skip
        notes.append({"failed": failed, "notes": checked.notes})
        progress.advance(n + 2)
    steps.append(Step.measured(
        REFERENCE, 0.0, Measured(own, 0.0, own), reference["ns_per_pixel_cycle"],
        pixels * start.cycles, full.acting(channel=False),
    ))  # fmt: skip
    notes.append({"failed": None, "notes": ["run time: predicted, see reference"]})
    weak = _weak(start, full)
    document = ladder_document(steps, reference, own, None if weak is None else weak.mean[2])
    for row, more in zip(document["rows"], notes, strict=True):
        del row["same_as"]  # every tolerance is checked by itself
        row |= more
    document["weak"] = None if weak is None else {
        "what": f"{weak.intervals} unsent intervals of {weak.pixels} of the brightest pixels: "
        "charge against the closed form, (engine, reference, 99.9 % by chance)",
        "mean": weak.mean,
        "variance": weak.variance,
    }  # fmt: skip
    return document


class AsynchronousStudy:
    """See `Study`."""

    def __init__(self, spec: EventSpec) -> None:
        steps = light_steps(spec.source, spec.relay, spec.setting.clock, spec.stop)
        light, _, until = next(steps)
        self.start = EventStart.under(spec, light, until)

    def forecast(self, progress: Progress) -> dict[str, Any]:
        return forecast_events(self.start)

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return measure_ladder(self.start, progress)
