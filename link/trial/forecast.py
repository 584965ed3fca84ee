"""The document of `viform plan` for a link: its plan, and its run time on this device."""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import Any, Final

from cosim import BLOCK, Block
from cosim.light.light import PlaneMap
from cosim.plan.forecast import Speeds, forecast_document
from cosim.run.progress import Progress
from link.setup.setup import LinkSetup
from link.trial.check import KIND
from link.trial.patches import LinkPatches
from link.trial.plan import LinkPlan, survey_link
from sensor import SpikeCamera
from sensor.latched.patches import PatchCamera

__all__ = ["link_forecast"]

BLOCKS: Final = 4
"""Blocks at the start of the run that are timed. The first warms up; of the others that show data
throughout the fastest counts, since other load of the machine only adds time."""


def _measure(setup: LinkSetup, plan: LinkPlan, everything: LinkPlan) -> Speeds:
    """Returns the speeds of light and cameras.

    A simulation with fewer effects is never slower than one with all of them, so the latter bounds
    it.
    """
    setting, chip = setup.setting, setup.setting.camera.chip
    air = setting.make_air(setup.sent, setup.sent.planes, plan.air_effects)
    # If only effects of the air are left out, the camera is the same and is timed once.
    plans = [plan] if plan.camera == everything.camera else [plan, everything]
    cameras = [
        SpikeCamera(each.camera, setup.device, tier=each.tier, row_delay=air.row_delay)
        for each in plans
    ]
    plane = LinkPatches(setting, setup.sent, setup.scenario.seed).plane
    reference, cut = None, None
    if plane is not None:
        reference = PatchCamera(setting.camera, plane, "reference", row_delay=air.row_delay)
        cut = PlaneMap(plane.cut, None)
    spent: list[list[float]] = [[] for _ in range(4)]
    pixels = chip.height * chip.width
    dark = setting.first_light + setting.panel.clock.edge(setup.sent.planes)
    # A block that the end of the data cuts would look cheap; the first ones have it if all are cut.
    whole = min(max(setting.camera.clock.cycle_at(dark) // BLOCK, 2), BLOCKS)
    for start in range(0, whole * BLOCK, BLOCK):
        block, begin = Block(start, BLOCK), time.perf_counter()
        light = air.step(None, block)
        spent[3].append((time.perf_counter() - begin) / pixels)
        # The order alternates: the first camera to read new light pays for loading it into cache.
        for n, camera in list(enumerate(cameras))[:: -1 if start // BLOCK % 2 else 1]:
            begin = time.perf_counter()
            camera.step(light, block)
            spent[n].append((time.perf_counter() - begin) / pixels)
        if reference is not None and cut is not None and plane is not None:
            patches = cut(light)
            begin = time.perf_counter()
            reference.step(patches, start, BLOCK)
            spent[2].append((time.perf_counter() - begin) / plane.numbers.size)
    planned, every, full, light_ns = (
        min(each[1:]) * 1e9 / BLOCK if each else None for each in spent
    )  # fmt: skip
    return Speeds(planned, max(planned or 0.0, every or 0.0), full, light_ns)


def link_forecast(name: str, setup: LinkSetup, progress: Progress) -> dict[str, Any]:
    """Returns the document of `viform plan --json` for a link."""
    survey = survey_link(setup.setting, setup.mode, setup.symbols, setup.cycles)
    planned = survey.plan(setup.scenario.tolerance, setup.device)
    everything = survey.plan(0.0, setup.device, tier=planned.tier)
    for warning in setup.warnings():
        progress.note(warning)
    progress.note("timing a few blocks")
    return forecast_document(
        name, planned.plan, tier=planned.tier, device=setup.device_name,
        tier_error=planned.tier_bound,
        speeds=_measure(setup, planned, everything), pixel_cycles=setup.pixel_cycles, display=None,
        error_of=KIND, mode=asdict(setup.mode),
    )  # fmt: skip
