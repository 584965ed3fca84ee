"""Error against run time of an imager: its plans at a ladder of tolerances, on one scenario.

The imager films the scenario once with everything kept, which is the reference. On patches of
chosen frames every distinct plan converts the same exposures with the same random numbers; its
time is that of converting one whole frame of them, the least of a few calls. What a controller
would decide of a plan's frames is not compared: that a run's own check does (`decisions`).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Final

from cosim.plan.ladder import fit_order
from cosim.run.progress import Progress
from rtl_model.imagers.run.filming import watched
from rtl_model.imagers.run.judges import decides
from rtl_model.imagers.run.machine import Machine
from rtl_model.imagers.run.paired import Patches
from rtl_model.imagers.run.planning import Ready, plan_all, ready_imager
from rtl_model.imagers.run.tape import NoTape, Taped
from scenarios.assemble.scenario import ImagerScenario
from sensor.imagers import Exposed, PixelModel

__all__ = ["accuracy_imager"]

REFERENCE: Final = "reference"
LADDER: Final = (0.0, 1e-5, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0)
CALLS: Final = 4
"""Conversions that are timed of each plan, after one that is not."""


class _Watch(Patches):
    """Patches, which also time every plan on the largest exposure of the chosen frames."""

    def __init__(
        self, full: frozenset[str], ways: dict[str, frozenset[str]], seed: int, frames: list[int]
    ) -> None:
        super().__init__(full, ways, seed, frames)
        self._timed, self._seed_of, self._numbers = ways | {REFERENCE: full}, seed, set(frames)
        self._largest = 0
        self.took: dict[str, float] = {}

    def __call__(self, rows: Exposed, pixels: PixelModel) -> None:
        super().__call__(rows, pixels)
        if rows.frame in self._numbers and rows.lux_seconds.size > self._largest:
            self._largest = rows.lux_seconds.size
            self.took = _times(pixels, rows, self._seed_of, self._timed)


def _times(
    pixels: PixelModel, rows: Exposed, seed: int, ways: Mapping[str, frozenset[str]]
) -> dict[str, float]:
    """Nanoseconds a pixel-frame of each way: the least of rounds in which all take turns, so that
    what else the machine does falls on all alike; the first round does not count."""
    found: dict[str, list[float]] = {name: [] for name in ways}
    for turn in range(CALLS + 1):
        for name, kept in ways.items():
            begin = time.perf_counter()
            pixels.convert(rows, seed, kept)
            if turn:
                found[name].append(time.perf_counter() - begin)
    return {name: min(spent) * 1e9 / rows.lux_seconds.size for name, spent in found.items()}


def _plans(run: Ready) -> list[tuple[list[float], frozenset[str]]]:
    """Distinct plans, each with the tolerances that give it, the tightest first."""
    found: list[tuple[list[float], frozenset[str]]] = []
    for tolerance in LADDER:
        models = run.machine.models(run.pixels)
        plan, _ = plan_all(models, run.expected, tolerance, run.view.certain)
        kept = frozenset(plan.everywhere)
        if found and found[-1][1] == kept:
            found[-1][0].append(tolerance)
        else:
            found.append(([tolerance], kept))
    return found


def accuracy_imager(
    name: str, scenario: ImagerScenario, machine: Machine, progress: Progress
) -> dict[str, Any]:
    """The document of `viform accuracy --json`."""
    run = ready_imager(name, scenario, machine)
    effects = list(run.pixels.effects)
    full, plans = frozenset(effects), _plans(run)
    ways = {f"{tolerances[0]:g}": kept for tolerances, kept in plans}
    patches = _Watch(full, ways, scenario.seed, watched(run.expected.frames))
    imager: Any = machine.make()
    imager.pixels = Taped(imager.pixels, NoTape(), patches)
    total = max(run.expected.frames, 1)
    progress.start(f"{name}: about {total} frames, everything kept", total)
    filmed = pixels = 0
    for frame in imager.film(run.view.scenery, run.stop, seed=scenario.seed, kept=full):
        filmed, pixels = filmed + 1, pixels + frame.values.size
        progress.advance(min(filmed, total))
    took = patches.took
    rows = [_row("reference", None, 0.0, (0.0, 0.0), took.get(REFERENCE), pixels, effects, None)]
    points = []
    for tolerances, kept in plans:
        label = f"{tolerances[0]:g}"
        error = patches.of(label)
        value = None if error is None else error.value
        ci = None if error is None else (error.low, error.high)
        names = [effect for effect in effects if effect in kept]
        for n, tolerance in enumerate(tolerances):
            same = tolerances[0] if n else None
            rows.append(
                _row("exact", tolerance, value, ci, took.get(label), pixels, names, same)
                | {"left_out": [effect for effect in effects if effect not in kept]}
            )
        points.append((tolerances[0], value or 0.0))
    return {
        "reference": {
            "tier": "reference", "patches": patches.seen, "frames": filmed,
            "ns_per_pixel_cycle": took.get(REFERENCE),
            "decisions": "not compared" if decides(imager) else "none",
        },
        "order": fit_order(points),
        "floor": {"reference": 0.0, "monte_carlo": None},
        "rows": rows,
    }  # fmt: skip


def _row(
    tier: str, tolerance: float | None, error: float | None, ci: tuple[float, float] | None,
    ns: float | None, pixels: int, effects: list[str], same: float | None,
) -> dict[str, Any]:  # fmt: skip
    return {
        "tier": tier, "tolerance": tolerance, "error": error, "ci": ci,
        "run_time_s": None if ns is None else ns * 1e-9 * pixels, "ns_per_pixel_cycle": ns,
        "effects": effects, "left_out": [], "same_as": same,
    }  # fmt: skip
