"""A run made ready: everything that can be refused is, before anything is written."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace

from cosim import InputError, seconds_to_ps
from cosim.compute.opencl import Device, open_device
from cosim.light.lens import Lens
from cosim.light.source import Source
from cosim.run.inputs import digest
from cosim.run.result import viform_version
from display import DisplaySetting
from scenarios.assemble.boards import BoardCamera, Boards, refuse_boards
from scenarios.assemble.camera import camera_setting, choose_lens, lens_notes
from scenarios.assemble.display import display_of
from scenarios.assemble.glass import Glass, follow, make_glass, short_of
from scenarios.assemble.loading import to_toml
from scenarios.assemble.planning import Look, RunPlan, look, plan_run
from scenarios.assemble.readout import resized
from scenarios.assemble.scenario import Scenario
from scenarios.assemble.verifier import ARITHMETIC, Verifier
from scenarios.scenes import make_source
from sensor import CameraSetting, SpikeCamera

__all__ = [
    "Prepared", "again", "choose_device", "identity", "look_at", "look_through", "prepare",
    "prepare_camera", "scene_source",
]  # fmt: skip


def identity(scenario: Scenario, plan: RunPlan, glass: Glass | None) -> str:
    """Text that names a run's inputs: the scenario, what is left out of it, the program's version,
    what draws its display, and the clip's content."""
    text = to_toml(scenario.model_copy(update={"title": ""})) + viform_version() + plan.tier
    text += "" if glass is None else glass.identity()
    for name, tiles in plan.plan.kept.items():
        text += name + hashlib.sha256(tiles.tobytes()).hexdigest()
    path = getattr(scenario.scene, "path", None)
    text += (digest(path) or "") if path is not None else ""
    return hashlib.sha256(text.encode()).hexdigest()


def _instants(scenario: Scenario, cycles: int) -> list[int]:
    """Cycles whose images are made and judged; five evenly spaced ones unless given."""
    window = scenario.image.window
    if window % 2 == 0:
        raise InputError("image.window", "odd", str(window), f"set {window + 1}")
    if cycles < window:
        raise InputError(
            "duration", f"at least image.window = {window} cycles", f"{cycles} cycles",
            "lengthen it or shorten image.window",
        )  # fmt: skip
    at = scenario.image.at or tuple(cycles * (2 * i + 1) // 10 for i in range(5))
    late = [n for n in at if n >= cycles]
    if late:
        raise InputError(
            "image.at", f"cycles below {cycles}", f"{late[0]}", "lengthen duration or drop it"
        )
    return list(at)


def choose_device(wanted: str | None) -> Device | None:
    """The OpenCL device asked for; None for "numba", the compiled form on this processor."""
    return None if wanted is not None and wanted.lower() == "numba" else open_device(wanted)


@dataclass(frozen=True)
class Prepared:
    """A checked run: everything that can be refused has been. verifier: None where a board makes
    the spikes, which are what they are."""

    name: str
    scenario: Scenario
    setting: CameraSetting
    cycles: int
    instants: list[int]
    lens: Lens
    white_rate: float
    source: Source
    device: Device | None
    plan: RunPlan
    camera: SpikeCamera | BoardCamera
    verifier: Verifier | None
    glass: Glass | None
    notes: list[str]
    boards: Boards


def prepare_camera(
    scenario: Scenario, device: str | None, size: tuple[int, int] | None = None
) -> tuple[CameraSetting, int, list[int], Lens, float, Device | None]:
    """Setting, cycles, instants, lens, rate of white and device of a checked scenario. size: rows
    and columns of a board in the chip's place."""
    refuse_boards(scenario)
    setting = camera_setting(scenario)
    if size is not None:
        setting = resized(setting, size[1], size[0])
    cycles = setting.clock.cycles_in(seconds_to_ps(scenario.duration))
    instants = _instants(scenario, cycles)
    lens = choose_lens(scenario, setting)
    # A chosen f-number's rounding must not show in the white that was asked for.
    white_rate = (
        setting.rate(scenario.scene.illuminance * lens.gain)
        if scenario.sensor.lens.f_number is not None
        else scenario.sensor.lens.white_rate
    )
    return setting, cycles, instants, lens, white_rate, choose_device(device)


def scene_source(scenario: Scenario, setting: CameraSetting, cycles: int) -> Source:
    """The scene on the chip's pixels."""
    chip = setting.chip
    return make_source(
        scenario.scene, (chip.height, chip.width), setting.clock, cycles, setting.reach == (0, 0)
    )


def look_at(scenario: Scenario, setting: CameraSetting, lens: Lens, cycles: int) -> Look:
    """What the plan reads of the scene."""
    source = scene_source(scenario, setting, cycles)
    return look(scenario, setting, source, lens.relay(setting.chip.pitch), cycles)


def look_through(
    scenario: Scenario, setting: CameraSetting, white_rate: float, instants: list[int], cycles: int
) -> tuple[DisplaySetting | None, tuple[float, str]]:
    """The display with everything, None where there is none; what the pursuing eye follows, pixels
    a second, and where that is from."""
    if scenario.display is None:
        return None, (0.0, "")
    source = scene_source(scenario, setting, cycles)
    pursuit = follow(scenario, source, setting.clock.edge(cycles))
    return display_of(scenario, setting, white_rate, instants, cycles, pursuit[0]), pursuit


def prepare(name: str, whole: Scenario, device: str | None, boards: Boards) -> Prepared:
    """Everything of the run, checked."""
    scenario = boards.simulated(whole)
    setting, cycles, instants, lens, white_rate, opened = prepare_camera(
        scenario, device, boards.size
    )
    source = scene_source(scenario, setting, cycles)
    seen = look_at(scenario, setting, lens, cycles)
    notes = lens_notes(scenario, lens, white_rate)
    display, pursuit = look_through(scenario, setting, white_rate, instants, cycles)
    plan = plan_run(seen, setting, scenario.tolerance, instants, opened, display=display)
    glass = None
    if plan.display is not None:
        notes += [pursuit[1], *short_of(plan.display.panel.luminance, cycles / setting.clock.hz)]
        glass = make_glass(
            scenario, setting, cycles, instants, plan.display, pursuit, source.points()
        )
    camera, verifier = _planned(plan, setting, scenario, opened, boards, cycles)
    notes += boards.notes(camera)
    return Prepared(
        name, whole, setting, cycles, instants, lens, white_rate, source, opened, plan, camera,
        verifier, glass, notes, boards,
    )  # fmt: skip


def _planned(
    plan: RunPlan, setting: CameraSetting, scenario: Scenario, device: Device | None,
    boards: Boards, cycles: int,
) -> tuple[SpikeCamera | BoardCamera, Verifier | None]:  # fmt: skip
    """The camera as planned and the stage that checks it."""
    made = boards.camera(setting, plan.look.scene, cycles)
    if made is not None:
        return made, None
    camera = SpikeCamera(plan.setting, device, tier=plan.tier, flags=plan.flags)
    return camera, plan.verifier(setting, scenario.seed, device)


def again(run: Prepared, forced: list[str]) -> Prepared:
    """The run with these effects kept."""
    scenario, setting = run.scenario, run.setting
    plan = plan_run(
        run.plan.look, setting, scenario.tolerance, run.instants, run.device,
        forced=[name for name in forced if name != ARITHMETIC],
        tier="exact" if ARITHMETIC in forced else None, display=run.plan.full_display,
    )  # fmt: skip
    camera, verifier = _planned(plan, setting, scenario, run.device, run.boards, run.cycles)
    source = scene_source(scenario, setting, run.cycles)
    glass = run.glass
    if glass is not None and plan.display is not None:
        glass.close()
        glass = make_glass(
            scenario, setting, run.cycles, run.instants, plan.display,
            (glass.velocity, glass.told), glass.points,
        )  # fmt: skip
    return replace(run, plan=plan, camera=camera, verifier=verifier, source=source, glass=glass)
