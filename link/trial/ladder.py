"""Error against run time of a link: every tier at a ladder of tolerances.

The error of a row is that of the bit error rate of its plan against full physics, on patches and on
the same bits, in half-widths of the interval that the run's bits leave. With enough bits it is
estimated from those that are nearly wrong (`error_of` says so). The time of a row is that of air
and camera on the whole plane: the minimum over blocks, after one that is discarded.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from cosim import BLOCK, Block, InputError
from cosim.plan.ladder import Row, distinct_plans, fit_rows
from cosim.run.progress import Progress
from link.air import ber_units
from link.setup.setup import FileLinkSetup
from link.trial.check import KIND, compare
from link.trial.patches import Decided, LinkPatches, Variant
from link.trial.plan import LinkPlan, LinkSurvey, half_width
from link.trial.planned import survey_of
from sensor import CameraSetting, SpikeCamera
from sensor.latched.reference.law import DRAWS, reference_error
from sensor.latched.tiers import Tier

TIMED: Final = 2
"""Blocks of the whole chip that are timed, after one that is not."""
_FULL: Final = "reference"


@dataclass(frozen=True)
class _Rung:
    """A plan of the ladder.

    Attributes:
        tier: tier of the camera's pixels.
        tolerances: tolerances that give this plan.
        plan: the plan.
    """

    tier: Tier
    tolerances: list[float]
    plan: LinkPlan

    @property
    def name(self) -> str:
        return f"{self.tier} {self.tolerances[0]:g}"


def _rungs(setup: FileLinkSetup, survey: LinkSurvey) -> list[_Rung]:
    tiers: list[Tier] = ["exact"] if setup.device is None else ["exact", "fast"]
    return [
        _Rung(tier, tolerances, plan)
        for tier in tiers
        for tolerances, plan in distinct_plans(
            lambda tolerance, tier=tier: survey.plan(tolerance, setup.device, tier=tier),  # type: ignore[misc]
            lambda plan: plan.left_out,
        )
    ]


def _plane_ns(
    setup: FileLinkSetup, plans: Sequence[LinkPlan], progress: Progress
) -> tuple[dict[frozenset[str] | None, float], dict[tuple[Tier, CameraSetting], float]]:
    """Measures the whole chip, nanoseconds for a pixel-cycle.

    Returns:
        The time of the light by the effects of the air (None for all), and of each distinct camera.
    """
    chip = setup.setting.camera.chip
    airs = {
        effects: setup.setting.make_air(setup.sent, setup.sent.planes, effects)
        for effects in dict.fromkeys([None, *(plan.air_effects for plan in plans)])
    }
    cameras = {
        key: SpikeCamera(key[1], setup.device, tier=key[0], row_delay=airs[None].row_delay)
        for key in dict.fromkeys((plan.tier, plan.camera) for plan in plans)
    }
    blocks = min(TIMED + 1, max(setup.cycles // BLOCK, 1))
    air_ns: dict[frozenset[str] | None, list[float]] = {effects: [] for effects in airs}
    camera_ns: dict[tuple[Tier, CameraSetting], list[float]] = {key: [] for key in cameras}
    each = chip.height * chip.width * BLOCK * 1e-9
    progress.start(f"{len(cameras)} cameras on the whole chip", blocks)
    for n in range(blocks):
        block, lights = Block(n * BLOCK, BLOCK), {}
        for effects, air in airs.items():
            begin = time.perf_counter()
            lights[effects] = air.step(None, block)
            air_ns[effects].append((time.perf_counter() - begin) / each)
        for key, camera in cameras.items():
            begin = time.perf_counter()
            camera.step(lights[None], block)
            camera_ns[key].append((time.perf_counter() - begin) / each)
        progress.advance(n + 1)
    return (
        {effects: min(ns[1:] or ns) for effects, ns in air_ns.items()},
        {key: min(ns[1:] or ns) for key, ns in camera_ns.items()},
    )


def link_ladder(setup: FileLinkSetup, progress: Progress) -> dict[str, Any]:
    """Document of `viform accuracy --json` for a link.

    Raises:
        InputError: if no bit can be compared.
    """
    setting, camera = setup.setting, setup.setting.camera
    seed, detector = setup.seed, setup.modem.detector
    patches = LinkPatches(setting, setup.sent, seed, detector)
    if patches.plane is None or not patches.bits:
        raise InputError(
            "the link", "one whose panel is in view and sends more than its training",
            "nothing to compare", "check link.aim and duration",
        )  # fmt: skip
    survey = survey_of(setup, patches)  # as a run is planned
    rungs = _rungs(setup, survey)
    variants = {_FULL: Variant("reference", camera)}
    variants |= {
        rung.name: Variant(rung.tier, rung.plan.camera, rung.plan.air_effects) for rung in rungs
    }
    decided = patches.film(variants, setup.device, progress)
    air_ns, camera_ns = _plane_ns(setup, [rung.plan for rung in rungs], progress)
    full = decided[_FULL]
    rows, kind = [], KIND
    for rung in rungs:
        other, plan = decided[rung.name], rung.plan
        paired = compare(full.wrong, other.wrong, survey.scene.bits, (full.lead, other.lead))
        kind = paired.kind
        ns = air_ns[plan.air_effects] + camera_ns[plan.tier, plan.camera]
        for at, tolerance in enumerate(rung.tolerances):
            rows.append(Row(
                rung.tier, tolerance, paired.value, (paired.low, paired.high),
                ns * 1e-9 * setup.pixel_cycles, ns, plan.simulated, list(plan.left_out),
                rung.tolerances[0] if at else None,
            ))  # fmt: skip
    reference = _reference(setup, survey, patches, full, air_ns[None])
    return _document(setup, survey, patches, full, [*rows, reference], kind)


def _reference(
    setup: FileLinkSetup, survey: LinkSurvey, patches: LinkPatches, full: Decided, air_ns: float
) -> Row:
    """Row of full physics.

    Its error is that of its own tabulated thresholds, which shifts the charge of a tick against
    them.
    """
    assert patches.plane is not None
    ns = air_ns + full.camera_ns
    wrong = reference_error(setup.setting.camera, patches.plane.numbers[:DRAWS])
    error = ber_units(survey.scene, wrong * survey.scene.threshold / survey.scene.on)
    everything = [effect.name for effect in (*survey.air_effects, *survey.camera_effects)]
    seconds = ns * 1e-9 * setup.pixel_cycles
    return Row("reference", None, error, (0.0, error), seconds, ns, everything, [])


def _document(
    setup: FileLinkSetup, survey: LinkSurvey, patches: LinkPatches, full: Decided, rows: list[Row],
    kind: str,
) -> dict[str, Any]:  # fmt: skip
    assert patches.plane is not None
    unit, reference = half_width(full.rate, survey.scene.bits), rows[-1]
    return {
        "scenario": setup.scenario.title,
        "error_of": kind,
        "device": setup.device_name,
        "reference": {
            "tier": "reference", "error": reference.error,
            "ns_per_pixel_cycle": reference.ns_per_pixel_cycle,
            "run_time_s": reference.run_time_s, "effects": reference.effects,
            "patches": len(patches.plane.tiles), "pixels": int(patches.plane.numbers.size),
            "bits": patches.bits, "bit_error_rate": full.rate, "half_width": unit,
        },
        "order": fit_rows(rows[:-1]),
        "floor": {
            "reference": reference.error,
            "monte_carlo": half_width(full.rate, patches.bits) / unit,
        },
        "rows": [row.document() for row in rows],
    }  # fmt: skip
