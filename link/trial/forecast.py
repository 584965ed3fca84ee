"""The document of `viform plan` for a link: its plan, what a run takes and carries, and its run
time on this device."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

from cosim import BLOCK, Block, Viform
from cosim.light.light import PlaneMap
from cosim.plan.forecast import Speeds, forecast_document
from cosim.run.progress import Progress
from link.setup.setup import FileLinkSetup
from link.trial.amounts import Amounts, amounts, carried
from link.trial.check import KIND, check_variants
from link.trial.patches import FEWEST, LinkPatches
from link.trial.plan import LinkPlan
from link.trial.planned import is_checked, survey_of
from link.trial.stages import (
    PROGRAM,
    Spell,
    StageTime,
    evaluation_times,
    receiver_times,
    recorder_time,
    stage_document,
    timed,
)
from sensor import SpikeCamera
from sensor.latched.fine_tiles import PatchCamera

BLOCKS: Final = 4
"""Blocks at the start of the run that are timed. The first warms up; of the others that show data
throughout the fastest counts, since other load of the machine only adds time."""


@dataclass(frozen=True)
class _Filmed:
    """The first blocks of a run.

    Attributes:
        speeds: speeds of light and cameras.
        air, sensor: time of the fastest block, of BLOCK cycles.
        recorded: spikes of the blocks.
    """

    speeds: Speeds
    air: Spell
    sensor: Spell
    recorded: list[Viform]


def _film(setup: FileLinkSetup, plan: LinkPlan, everything: LinkPlan) -> _Filmed:
    """Films the first blocks.

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
    plane = LinkPatches(setting, setup.sent, setup.seed).plane
    reference, cut = None, None
    if plane is not None:
        reference = PatchCamera(setting.camera, plane, "reference", row_delay=air.row_delay)
        cut = PlaneMap(plane.cut, None)
    light_spent: list[Spell] = []
    spent: list[list[Spell]] = [[] for _ in cameras]
    full: list[Spell] = []
    recorded: list[Viform] = []
    dark = setting.first_light + setting.panel.clock.edge(setup.sent.planes)
    # A block that the end of the data cuts would look cheap; the first ones have it if all are cut.
    whole = min(max(setting.camera.clock.cycle_at(dark) // BLOCK, 2), BLOCKS)
    for start in range(0, whole * BLOCK, BLOCK):
        block = Block(start, BLOCK)
        with timed(light_spent):
            light = air.step(None, block)
        # The order alternates: the first camera to read new light pays for loading it into cache.
        for n, camera in list(enumerate(cameras))[:: -1 if start // BLOCK % 2 else 1]:
            with timed(spent[n]):
                spikes = camera.step(light, block)
            if n == 0:
                recorded.append(spikes)
        if reference is not None and cut is not None:
            patches = cut(light)
            with timed(full):
                reference.step(patches, start, BLOCK)
    pixels = chip.height * chip.width
    planned, every, light_ns = (
        _fastest(each).wall * 1e9 / (BLOCK * pixels) for each in (spent[0], spent[-1], light_spent)
    )
    full_ns = None
    if plane is not None:
        full_ns = _fastest(full).wall * 1e9 / (BLOCK * plane.numbers.size)
    return _Filmed(
        Speeds(planned, max(planned, every), full_ns, light_ns),
        _fastest(light_spent), _fastest(spent[0]), recorded,
    )  # fmt: skip


def _fastest(spent: list[Spell]) -> Spell:
    """Least times of the blocks after the first one."""
    return Spell(min(one.wall for one in spent[1:]), min(one.processor for one in spent[1:]))


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
    setup: FileLinkSetup, plan: LinkPlan, filmed: _Filmed, todo: Amounts, progress: Progress
) -> list[StageTime]:
    blocks, spent = todo.cycles / BLOCK, setup.times
    rows = [StageTime("program", 1, "programs", PROGRAM, PROGRAM)]
    rows += [
        StageTime(name, 1, "links", spent.wall[name], spent.processor[name]) for name in spent.wall
    ]
    rows += [
        StageTime.of("air", todo.planes, "planes", filmed.air.times(blocks)),
        StageTime.of("sensor", todo.pixel_cycles, "pixel-cycles", filmed.sensor.times(blocks)),
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
