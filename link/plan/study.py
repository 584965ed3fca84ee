"""A link that is planned and measured without a run.

The document of `viform plan` says what a run keeps, takes and carries, and its run time on this
device. That of `viform accuracy` has the error against the run time: every tier at a ladder of
tolerances. The error of a step is that of the bit error rate of its plan against full physics, on
patches and on the same bits, in half-widths of the interval that the run's bits leave. With enough
bits it is estimated from those that are nearly wrong (`error_of` says so). The time of a step is
that of air and camera on the whole plane: the minimum over blocks, after one that is discarded.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

from cosim import BLOCK, Block, InputError, Viform
from cosim.plan.error import Measured
from cosim.plan.study import (
    REFERENCE,
    FirstBlocks,
    Rung,
    Spell,
    Step,
    climb,
    film_blocks,
    forecast_document,
    ladder_document,
    timed,
)
from cosim.run.progress import Progress
from link.air import ber_units
from link.plan.check import KIND, check_variants, compare
from link.plan.patches import FEWEST, Decided, LinkPatches, Variant
from link.plan.plan import LinkPlan, LinkSurvey, half_width
from link.plan.planned import is_checked, survey_of
from link.plan.stages import (
    PROGRAM,
    Amounts,
    StageTime,
    amounts,
    carried,
    evaluation_times,
    receiver_times,
    recorder_time,
    stage_document,
)
from link.section import LinkScenario
from link.setup.setup import FileLinkSetup, set_up_link
from sensor import CameraSetting, SpikeCamera
from sensor.latched.fine_tiles import PatchCamera
from sensor.latched.reference.law import DRAWS, reference_error
from sensor.latched.tiers import Tier

BLOCKS: Final = 4
"""Blocks at the start of the run that are timed. The first warms up; of the others that show data
throughout the fastest counts, since other load of the machine only adds time."""
TIMED: Final = 2
"""Blocks of the whole chip that are timed, after one that is not."""


def _film(setup: FileLinkSetup, plan: LinkPlan, everything: LinkPlan) -> FirstBlocks[Viform]:
    """Films the first blocks."""
    setting, chip = setup.setting, setup.setting.camera.chip
    air = setting.make_air(setup.sent, setup.sent.planes, plan.air_effects)
    # If only effects of the air are left out, the camera is the same and is timed once.
    plans = [plan] if plan.camera == everything.camera else [plan, everything]
    cameras = [
        SpikeCamera(each.camera, setup.device, tier=each.tier, row_delay=air.row_delay)
        for each in plans
    ]
    plane, reference = LinkPatches(setting, setup.sent, setup.seed).plane, None
    if plane is not None:
        full = PatchCamera(setting.camera, plane, "reference", row_delay=air.row_delay)
        reference = plane, full
    dark = setting.first_light + setting.panel.clock.edge(setup.sent.planes)
    # A block that the end of the data cuts would look cheap; the first ones have it if all are cut.
    whole = min(max(setting.camera.clock.cycle_at(dark) // BLOCK, 2), BLOCKS)
    return film_blocks(
        [Block(n * BLOCK, BLOCK) for n in range(whole)], chip.height * chip.width,
        lambda block: air.step(None, block), [camera.step for camera in cameras], reference,
    )  # fmt: skip


def _check_time(setup: FileLinkSetup, plan: LinkPlan, progress: Progress) -> list[StageTime]:
    """Time of the check of the plan, from that of one of fewer symbols."""
    if not is_checked(setup):
        return []
    detector, seed = setup.modem.detector, setup.seed
    whole, part = (
        LinkPatches(setup.setting, setup.sent, seed, detector, most)
        for most in (None, FEWEST)
    )  # fmt: skip
    if not whole.bits:
        return []
    spent: list[Spell] = []
    with timed(spent):
        part.film(check_variants(setup.setting, plan), setup.device, progress)
    each = spent[0].times(whole.cycles / part.cycles)
    return [StageTime.of("check on patches", whole.bits, "bits", each)]


def _stages(
    setup: FileLinkSetup,
    plan: LinkPlan,
    filmed: FirstBlocks[Viform],
    todo: Amounts,
    progress: Progress,
) -> list[StageTime]:
    blocks, spent = todo.cycles / BLOCK, setup.times
    rows = [StageTime("program", 1, "programs", PROGRAM, PROGRAM)]
    rows += [
        StageTime(name, 1, "links", spent.wall[name], spent.processor[name]) for name in spent.wall
    ]
    rows += [
        StageTime.of("air", todo.planes, "planes", filmed.light.times(blocks)),
        StageTime.of("sensor", todo.pixel_cycles, "pixel-cycles", filmed.camera.times(blocks)),
        recorder_time(todo),
        *_check_time(setup, plan, progress),
    ]
    progress.note("reading the blocks")
    received = receiver_times(setup, filmed.recorded, todo)
    arrives = len(received) > 1
    return [*rows, *received, *evaluation_times(setup, todo, arrives)]


def link_forecast(name: str, setup: FileLinkSetup, progress: Progress) -> dict[str, Any]:
    """Document of `viform plan --json` for a link."""
    survey = survey_of(setup)
    planned = survey.plan(setup.tolerance, setup.device)
    everything = survey.plan(0.0, setup.device, tier=planned.tier)
    for warning in setup.warnings():
        progress.note(warning)
    progress.note("timing a few blocks")
    filmed, todo = _film(setup, planned, everything), amounts(setup)
    document = forecast_document(
        name, planned.plan, tier=planned.tier, device=setup.device_name,
        tier_error=planned.tier_bound, speeds=filmed.speeds, pixel_cycles=setup.pixel_cycles,
        display=None, error_of=KIND, mode=setup.mode_document(), amounts=asdict(todo),
        carried={f"{key}_bps": value for key, value in asdict(carried(setup)).items()},
    )  # fmt: skip
    document["predicted"] |= stage_document(_stages(setup, planned, filmed, todo, progress))
    return document


def _rungs(setup: FileLinkSetup, survey: LinkSurvey) -> list[Rung[LinkPlan]]:
    return climb(
        ["exact"] if setup.device is None else ["exact", "fast"],
        lambda tier, tolerance: survey.plan(tolerance, setup.device, tier=tier),
        lambda plan: plan.left_out,
    )


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
    variants = {REFERENCE: Variant(REFERENCE, camera)}
    variants |= {
        rung.name: Variant(rung.tier, rung.plan.camera, rung.plan.air_effects) for rung in rungs
    }
    decided = patches.film(variants, setup.device, progress)
    air_ns, camera_ns = _plane_ns(setup, [rung.plan for rung in rungs], progress)
    full = decided[REFERENCE]
    steps, kind = list[Step](), KIND
    for rung in rungs:
        other, plan = decided[rung.name], rung.plan
        paired = compare(full.wrong, other.wrong, survey.scene.bits, (full.lead, other.lead))
        kind = paired.kind
        ns = air_ns[plan.air_effects] + camera_ns[plan.tier, plan.camera]
        steps += rung.steps(
            paired.error, ns, setup.pixel_cycles, plan.simulated, plan.left_out
        )  # fmt: skip
    reference = _reference(setup, survey, patches, full, air_ns[None])
    return _document(setup, survey, patches, full, [*steps, reference], kind)


def _reference(
    setup: FileLinkSetup, survey: LinkSurvey, patches: LinkPatches, full: Decided, air_ns: float
) -> Step:
    """Row of full physics.

    Its error is that of its own tabulated thresholds, which shifts the charge of a tick against
    them.
    """
    assert patches.plane is not None
    ns = air_ns + full.camera_ns
    wrong = reference_error(setup.setting.camera, patches.plane.numbers[:DRAWS])
    error = ber_units(survey.scene, wrong * survey.scene.threshold / survey.scene.on)
    everything = [effect.name for effect in (*survey.air_effects, *survey.camera_effects)]
    measured = Measured(error, 0.0, error)
    return Step.measured(REFERENCE, None, measured, ns, setup.pixel_cycles, everything)


def _document(
    setup: FileLinkSetup, survey: LinkSurvey, patches: LinkPatches, full: Decided,
    steps: list[Step], kind: str,
) -> dict[str, Any]:  # fmt: skip
    assert patches.plane is not None
    unit, reference = half_width(full.rate, survey.scene.bits), steps[-1]
    assert reference.error is not None
    return ladder_document(
        steps,
        {
            "tier": REFERENCE, "error": reference.error,
            "ns_per_pixel_cycle": reference.ns_per_pixel_cycle,
            "run_time_s": reference.run_time_s, "effects": reference.effects,
            "patches": len(patches.plane.tiles), "pixels": int(patches.plane.numbers.size),
            "bits": patches.bits, "bit_error_rate": full.rate, "half_width": unit,
        },
        reference.error, half_width(full.rate, patches.bits) / unit,
        scenario=setup.scenario.title, error_of=kind, device=setup.device_name,
    )  # fmt: skip


class LinkStudy:
    """Study of a link; see `Study`.

    Args:
        name: short name of the scenario.
        scenario: the scenario.
        camera: camera of [sensor], with every effect.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
    """

    def __init__(
        self, name: str, scenario: LinkScenario, camera: CameraSetting, device: str | None
    ) -> None:
        self._name, self._scenario, self._camera, self._device = name, scenario, camera, device

    def _set_up(self, progress: Progress) -> FileLinkSetup:
        return set_up_link(self._scenario, self._camera, self._device, progress)

    def forecast(self, progress: Progress) -> dict[str, Any]:
        return link_forecast(self._name, self._set_up(progress), progress)

    def ladder(self, progress: Progress) -> dict[str, Any]:
        return link_ladder(self._set_up(progress), progress)
