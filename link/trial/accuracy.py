"""Error against run time of a link: every tier at a ladder of tolerances.

The error of a row is that of its plan's bit error rate against full physics, on patches and on the
same bits, in half-widths of the interval that the run's bits leave, estimated from bits that are
nearly wrong where there are enough of them (`error_of` says so). Its time is that of the air and
of the camera on the whole plane: the least of the blocks after one that is thrown away.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, Final

from cosim import BLOCK, Block, InputError
from cosim.compute.opencl import Device
from cosim.plan.ladder import LADDER, Row, fit_rows
from cosim.run.progress import Progress
from link.air import Air, ber_units
from link.run.prepare import ReadyLink, ready_link
from link.section import LinkScenario
from link.trial.check import KIND, compare
from link.trial.patches import Decided, LinkPatches, Variant
from link.trial.plan import LinkLook, LinkPlan, half_width, look_link
from sensor import CameraSetting, SpikeCamera
from sensor.latched.reference.error import DRAWS, reference_error
from sensor.latched.tiers import Tier

__all__ = ["accuracy_link"]

TIMED: Final = 2
"""Blocks of the whole chip that are timed, after one that is not."""
_FULL: Final = "reference"


def _ladder(
    look: LinkLook, device: Device | None, tier: Tier
) -> list[tuple[list[float], LinkPlan]]:
    """Distinct plans of one tier, each with the tolerances that give it, the tightest first."""
    found: list[tuple[list[float], LinkPlan]] = []
    for tolerance in LADDER:
        plan = look.plan(tolerance, device, tier=tier)
        if found and plan.left_out == found[-1][1].left_out:
            found[-1][0].append(tolerance)
        else:
            found.append(([tolerance], plan))
    return found


def _plane_ns(
    run: ReadyLink, plans: Sequence[LinkPlan], progress: Progress
) -> tuple[dict[frozenset[str] | None, float], dict[tuple[Tier, CameraSetting], float]]:
    """What a pixel-cycle of the whole chip takes: of the light, by the effects that are kept, full
    physics' with them, and of every camera that is not another's like."""
    s, chip = run.setting, run.setting.camera.chip
    airs = {
        kept: Air(
            run.sent, s.panel, s.optics, s.aim, s.air, s.camera, first_light=s.first_light,
            planes=run.sent.planes, kept=kept,
        )
        for kept in dict.fromkeys([None, *(plan.run_air for plan in plans)])
    }  # fmt: skip
    cameras = {
        key: SpikeCamera(key[1], run.device, tier=key[0], late=airs[None].late)
        for key in dict.fromkeys((plan.tier, plan.camera) for plan in plans)
    }
    blocks = min(TIMED + 1, max(run.cycles // BLOCK, 1))
    shone: dict[frozenset[str] | None, list[float]] = {kept: [] for kept in airs}
    took: dict[tuple[Tier, CameraSetting], list[float]] = {key: [] for key in cameras}
    each = chip.height * chip.width * BLOCK * 1e-9
    progress.start(f"{len(cameras)} cameras on the whole chip", blocks)
    for n in range(blocks):
        block, lights = Block(n * BLOCK, BLOCK), {}
        for kept, air in airs.items():
            begin = time.perf_counter()
            lights[kept] = air.step(None, block)
            shone[kept].append((time.perf_counter() - begin) / each)
        for key, camera in cameras.items():
            begin = time.perf_counter()
            camera.step(lights[None], block)
            took[key].append((time.perf_counter() - begin) / each)
        progress.advance(n + 1)
    return (
        {kept: min(of[1:] or of) for kept, of in shone.items()},
        {key: min(of[1:] or of) for key, of in took.items()},
    )


def accuracy_link(
    scenario: LinkScenario, device_name: str | None, progress: Progress
) -> dict[str, Any]:
    """The document of `viform accuracy --json` for a link."""
    run = ready_link(scenario, device_name, progress)
    setting, camera = run.setting, run.setting.camera
    look = look_link(setting, run.mode, run.sent.symbols, run.cycles)
    tiers: list[Tier] = ["exact"]
    if run.device is not None:
        tiers.append("fast")
    ladder = [(t, *each) for t in tiers for each in _ladder(look, run.device, t)]
    names = [f"{tier} {tolerances[0]:g}" for tier, tolerances, _ in ladder]
    patches = LinkPatches(setting, run.sent, scenario.seed, scenario.link.modem.detector)
    if patches.plane is None or not patches.bits:
        raise InputError(
            "the link", "one whose panel is in view and sends more than its training",
            "nothing to compare", "check link.aim and duration",
        )  # fmt: skip
    variants = {_FULL: Variant("reference", camera)}
    variants |= {
        key: Variant(tier, plan.camera, plan.run_air)
        for key, (tier, _, plan) in zip(names, ladder, strict=True)
    }
    decided = patches.film(variants, run.device, progress)
    airs, spent = _plane_ns(run, [plan for *_, plan in ladder], progress)
    pixel_cycles = camera.chip.height * camera.chip.width * run.cycles
    full = decided[_FULL]
    rows, kind = [], KIND
    for key, (tier, tolerances, plan) in zip(names, ladder, strict=True):
        found = compare(
            full.wrong, decided[key].wrong, look.scene.bits, (full.lead, decided[key].lead)
        )
        kind = found.kind
        ns = airs[plan.run_air] + spent[plan.tier, plan.camera]
        for at, tolerance in enumerate(tolerances):
            rows.append(Row(
                tier, tolerance, found.value, (found.low, found.high), ns * 1e-9 * pixel_cycles,
                ns, plan.kept, list(plan.left_out), tolerances[0] if at else None,
            ))  # fmt: skip
    return _document(scenario, run, look, patches, full, rows, kind, airs[None], pixel_cycles)


def _document(
    scenario: LinkScenario, run: ReadyLink, look: LinkLook, patches: LinkPatches, full: Decided,
    rows: list[Row], kind: str, air_ns: float, pixel_cycles: int,
) -> dict[str, Any]:  # fmt: skip
    assert patches.plane is not None
    ns = air_ns + full.camera_ns
    # What its thresholds are off by moves a tick's charge against them.
    wrong = reference_error(run.setting.camera, patches.plane.numbers[:DRAWS])
    own = ber_units(look.scene, wrong * look.scene.threshold / look.scene.on)
    unit = half_width(full.rate, look.scene.bits)
    everything = [effect.name for effect in (*look.of_air, *look.of_camera)]
    best = Row("reference", None, own, (0.0, own), ns * 1e-9 * pixel_cycles, ns, everything, [])
    return {
        "scenario": scenario.title,
        "error_of": kind,
        "device": run.device.name if run.device is not None else "numba on this processor",
        "reference": {
            "tier": "reference", "error": own, "ns_per_pixel_cycle": ns,
            "run_time_s": best.run_time_s, "effects": everything,
            "patches": len(patches.plane.tiles), "pixels": int(patches.plane.numbers.size),
            "bits": patches.bits, "bit_error_rate": full.rate, "half_width": unit,
        },
        "order": fit_rows(rows),
        "floor": {
            "reference": own, "monte_carlo": half_width(full.rate, patches.bits) / unit,
        },
        "rows": [row.document() for row in [*rows, best]],
    }  # fmt: skip
