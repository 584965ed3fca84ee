"""Error against run time of an imager, for its plans at a ladder of tolerances, on one scenario.

The imager films the scenario once with every effect; this is the reference. On patches of chosen
frames, every distinct plan converts the same exposures with the same random numbers. The time of a
plan is the shortest of a few conversions of one whole frame. The decisions of the controller are
not compared; the check of a run does that (`check.decisions`).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Final

from cosim.plan.error import Measured
from cosim.plan.study import REFERENCE, Step, climb, ladder_document
from cosim.run.progress import Progress
from imagers.run.check import Patches, watched_frames
from imagers.run.plan import PlannedRun, plan_effects
from imagers.run.tape import NoTape, Taped
from sensor.frame_pixels import Exposed, PixelModel

CALLS: Final = 4
"""Timed conversions of each plan, after one that is not timed."""


class _TimedPatches(Patches):
    """Patches that also measure the time of every plan, on the largest of the chosen frames."""

    def __init__(
        self, full: frozenset[str], ways: dict[str, frozenset[str]], seed: int, frames: list[int]
    ) -> None:
        super().__init__(full, ways, seed, frames)
        self._timed, self._noise, self._numbers = ways | {REFERENCE: full}, seed, set(frames)
        self._largest = 0
        self.nanoseconds: dict[str, float] = {}

    def __call__(self, rows: Exposed, pixels: PixelModel) -> None:
        super().__call__(rows, pixels)
        if rows.frame in self._numbers and rows.lux_seconds.size > self._largest:
            self._largest = rows.lux_seconds.size
            self.nanoseconds = _times(pixels, rows, self._noise, self._timed)


def _times(
    pixels: PixelModel, rows: Exposed, seed: int, ways: Mapping[str, frozenset[str]]
) -> dict[str, float]:
    """Time of each set of effects, ns per pixel and frame: the shortest of several rounds. The sets
    take turns, so that other load of the processor affects all alike. The first round is not
    timed."""
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for turn in range(CALLS + 1):
        for name, kept in ways.items():
            begin = time.perf_counter()
            pixels.convert(rows, seed, kept)
            if turn:
                spent[name].append(time.perf_counter() - begin)
    return {name: min(each) * 1e9 / rows.lux_seconds.size for name, each in spent.items()}


def measure_ladder(run: PlannedRun, progress: Progress) -> dict[str, Any]:
    """The document of `viform accuracy --json`."""
    effects = list(run.pixels.effects)
    full = frozenset(effects)
    settings = run.model.settings(run.pixels)
    rungs = climb(
        ["exact"],
        lambda _, tolerance: frozenset(
            plan_effects(settings, run.exposures, tolerance, run.view.certain)[0].everywhere
        ),
        lambda kept: kept,
    )
    ways = {rung.name: rung.plan for rung in rungs}
    patches = _TimedPatches(full, ways, run.spec.seed, watched_frames(run.exposures.frames))
    imager: Any = run.model.make()
    decides = run.model.judge(imager, full, full, run.spec.seed) is not None
    imager.pixels = Taped(imager.pixels, NoTape(), patches)
    total = max(run.exposures.frames, 1)
    progress.start(f"{run.spec.name}: about {total} frames, everything kept", total)
    frames = pixels = 0
    for frame in imager.film(run.view.scenery, run.spec.stop, seed=run.spec.seed, kept=full):
        frames, pixels = frames + 1, pixels + frame.values.size
        progress.advance(min(frames, total))
    spent = patches.nanoseconds
    steps = [
        Step.of(REFERENCE, None, Measured(0.0, 0.0, 0.0), spent.get(REFERENCE), pixels, effects)
    ]
    for rung in rungs:
        kept = [effect for effect in effects if effect in rung.plan]
        out = [effect for effect in effects if effect not in rung.plan]
        steps += rung.steps(patches.of(rung.name), spent.get(rung.name), pixels, kept, out)
    return ladder_document(
        steps,
        {
            "tier": REFERENCE, "patches": patches.count, "frames": frames,
            "ns_per_pixel_cycle": spent.get(REFERENCE),
            "decisions": "not compared" if decides else "none",
        },
        0.0, None,
    )  # fmt: skip
