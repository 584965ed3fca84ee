"""What `viform plan` says of a link: the plan of its run, and what it would take on this device."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any, Final

from cosim import BLOCK, Block
from cosim.light.light import PlaneMap
from cosim.run.progress import Progress
from link.air import Air
from link.run.prepare import ReadyLink, ready_link, tags_told
from link.section import LinkScenario
from link.trial.check import KIND
from link.trial.patches import LinkPatches
from link.trial.plan import LinkPlan, look_link
from sensor import SpikeCamera
from sensor.latched.patches import PatchCamera

__all__ = ["forecast_link"]

BLOCKS: Final = 4
"""Of the run's beginning that are run; the first warms up, of the others the fastest counts: what
else the machine does only adds to it."""


@dataclass(frozen=True)
class _Measured:
    """Nanoseconds a pixel-cycle: of the camera as planned, with everything kept, of full physics
    (None where nothing of the panel is in view), and of making the light as planned. Leaving out
    costs no more than keeping: what is simulated as planned is a part of everything."""

    planned: float
    everything: float
    full: float | None
    light: float


def _measure(run: ReadyLink, plan: LinkPlan, everything: LinkPlan) -> _Measured:
    s, chip = run.setting, run.setting.camera.chip
    air = Air(
        run.sent, s.panel, s.optics, s.aim, s.air, s.camera, first_light=s.first_light,
        planes=run.sent.planes, kept=plan.run_air,
    )  # fmt: skip
    # where only light's effects are left out the camera is the same, and is timed once
    kept = [plan] if plan.camera == everything.camera else [plan, everything]
    cameras = [SpikeCamera(each.camera, run.device, tier=each.tier, late=air.late) for each in kept]
    plane = LinkPatches(s, run.sent, run.scenario.seed).plane
    reference, cut = None, None
    if plane is not None:
        reference = PatchCamera(s.camera, plane, "reference", late=air.late)
        cut = PlaneMap(plane.cut, None)
    spent: list[list[float]] = [[] for _ in range(4)]
    pixels = chip.height * chip.width
    for start in range(0, BLOCKS * BLOCK, BLOCK):
        block, begin = Block(start, BLOCK), time.perf_counter()
        light = air.step(None, block)
        spent[3].append((time.perf_counter() - begin) / pixels)
        # in turn: the one that reads new light first pays for bringing it near
        for n, camera in list(enumerate(cameras))[:: -1 if start // BLOCK % 2 else 1]:
            begin = time.perf_counter()
            camera.step(light, block)
            spent[n].append((time.perf_counter() - begin) / pixels)
        if reference is not None and cut is not None and plane is not None:
            patches = cut(light)
            begin = time.perf_counter()
            reference.step(patches, start, BLOCK)
            spent[2].append((time.perf_counter() - begin) / plane.numbers.size)
    planned, every, full, made = (
        min(each[1:]) * 1e9 / BLOCK if each else None for each in spent
    )  # fmt: skip
    assert planned is not None and made is not None
    return _Measured(planned, max(planned, every or 0.0), full, made)


def forecast_link(
    name: str, scenario: LinkScenario, device_name: str | None, progress: Progress
) -> dict[str, Any]:
    """The document of `viform plan --json` for a link."""
    run = ready_link(scenario, device_name, progress)
    look = look_link(run.setting, run.mode, run.sent.symbols, run.cycles)
    made = look.plan(scenario.tolerance, run.device)
    everything = look.plan(0.0, run.device, tier=made.tier)
    if run.hopeless:
        progress.note(run.hopeless_told())
    if (told := tags_told(run.setting, run.mode)) is not None:
        progress.note(told)
    progress.note("timing a few blocks")
    took = _measure(run, made, everything)
    chip, plan = run.setting.camera.chip, made.plan
    total = chip.width * chip.height * run.cycles * 1e-9

    def seconds(ns: float | None) -> float | None:
        return None if ns is None else ns * total

    return {
        "scenario": name,
        "tolerance": scenario.tolerance,
        "error_of": KIND,
        "tier": made.tier,
        "device": run.device.name if run.device is not None else "numba on this processor",
        "mode": asdict(run.mode),
        "tiles": {},
        "display": None,
        "kept": made.kept,
        "left_out": [
            {"effect": r.effect, "bound": r.bound, "kind": r.kind, "share": 1 - r.kept}
            for r in plan.rows if r.effect in made.left_out
        ],
        "promised": float(plan.total.max()) + made.own,
        "promised_kind": plan.kind if made.own == 0 else "estimate",
        "rows": [asdict(row) for row in plan.rows],
        "sets": [{"effects": made.kept, "tiles": 1}],
        "predicted": {
            "ns_per_pixel_cycle": took.planned,
            "sensor_s": seconds(took.planned),
            "scene_s": seconds(took.light),
            "everything_ns_per_pixel_cycle": took.everything,
            "everything_s": seconds(took.everything),
            "full_physics_ns_per_pixel_cycle": took.full,
            "full_physics_s": seconds(took.full),
        },
    }  # fmt: skip
