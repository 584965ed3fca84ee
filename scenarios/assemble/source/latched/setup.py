"""Sets up the latched camera of a scenario, with its lens and scene: checked, not yet planned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from cosim import InputError, seconds_to_ps
from cosim.compute.opencl import Device, choose_device
from cosim.light.lens import Lens
from cosim.light.mosaic import Mosaic
from cosim.light.source import Source
from cosim.plan.error import required
from cosim.plan.paired import Span, windows
from display import DisplaySetting
from display.chain.pursuit import Pursuit, pursuit_of
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.instants import choose_windows
from scenarios.assemble.lens import LensChoice, choose_lens, choose_mosaic
from scenarios.assemble.pixel_kinds import says_more
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.latched.dim import check_dim
from scenarios.assemble.source.latched.plan import RunPlan, plan_run
from scenarios.scenes.drawing.analytic import NeutralSource
from scenarios.scenes.kinds.grid import SceneGrid
from sensor import CameraSetting
from sensor.latched.stages import LensStage, SceneStage
from sensor.latched.survey import SceneSurvey, survey_scene


@dataclass(frozen=True, eq=False)
class CameraSetup:
    """A latched camera, its lens and its scene.

    Attributes:
        scenario: the simulated part of the user's scenario, without boards.
        setting: the camera with every effect.
        choice: the lens and its exposure.
        cycles: length of the run, cycles of the latch clock.
        instants: cycles whose images are reconstructed and evaluated.
        device: OpenCL device, None for the compiled form on the processor.
    """

    scenario: Scenario
    setting: CameraSetting
    choice: LensChoice
    cycles: int
    instants: list[int]
    device: Device | None

    @property
    def lens(self) -> Lens:
        return self.choice.lens

    @property
    def white_rate(self) -> float:
        """Spike rate of the scene's white, spikes a cycle."""
        return self.choice.white_rate

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) of the chip."""
        return self.setting.chip.height, self.setting.chip.width

    @property
    def device_name(self) -> str:
        return "numba on this processor" if self.device is None else self.device.name

    @property
    def end(self) -> int:
        """End of the run, ps."""
        return self.setting.clock.edge(self.cycles)

    def source(self) -> Source:
        """The scene on the pixels of the chip. A source can be used for one pass only."""
        scene, aligned = self.scenario.scene, self.setting.reach == (0, 0)
        grid = SceneGrid(self.shape, self.setting.clock, self.cycles, aligned, self.mosaic)
        source = scene.source(grid)
        if self.mosaic is None or getattr(source, "coloured", False):
            return source
        return NeutralSource(source, self.mosaic)

    @cached_property
    def mosaic(self) -> Mosaic | None:
        """The filter array on the pixels."""
        return choose_mosaic(self.scenario)

    def stages(self, source: Source) -> dict[str, Any]:
        """Scene and lens, by name."""
        return {
            "scene": SceneStage(source, self.setting.reach),
            "lens": LensStage(self.lens, self.setting.chip.pitch),
        }

    @cached_property
    def survey(self) -> SceneSurvey:
        """Survey of the scene for the plan."""
        relay, image = self.lens.relay(self.setting.chip.pitch), self.scenario.image
        floor = 1 / image.window if image.floor is None else image.floor  # a spike in the window
        return survey_scene(self.setting, self.source(), relay, self.cycles, image.window, floor)

    @cached_property
    def spans(self) -> list[Span]:
        """Windows of the images, within the run."""
        image = self.scenario.image
        return windows(self.instants, image.window, self.cycles, preceding=image.preceding)

    @cached_property
    def pursuit(self) -> Pursuit:
        """Motion that the pursuing eye of the display follows."""
        section = self.scenario.display
        if section is None:
            return Pursuit(0.0, "")
        return pursuit_of(self.source(), self.end, section.pursuit)

    @property
    def says_more(self) -> bool:
        """Whether the chip says more than its spikes to what stands behind it."""
        return bool(says_more(self.scenario))

    @cached_property
    def display(self) -> DisplaySetting | None:
        """The display with every effect, None without one, and for a chip that says more than its
        spikes, whose patches the check does not show. Raises InputError for a panel that cannot
        show the stream."""
        section = self.scenario.display
        if section is None:
            return None
        if section.colour is not None and self.mosaic is None:
            raise InputError(
                "display.colour", "given with sensor.colour alone", section.colour,
                "write --set sensor.colour.filter=rggb, or leave it out",
            )  # fmt: skip
        if section.colour is not None and section.fit != "exact":
            raise InputError(
                "display.fit", "exact with display.colour", section.fit,
                "write --set display.fit=exact, or leave display.colour out",
            )  # fmt: skip
        clock, skew = self.setting.clock, self.setting.row_skew
        panel = section.panel(self.shape, clock, skew, self.white_rate)
        setting = section.setting(panel, self.instants, self.cycles, self.pursuit.velocity)
        return None if self.says_more else setting

    def plan(self, tolerance: float, **choice: Any) -> RunPlan:
        """Plans the run. `choice` holds the arguments `forced` and `tier` of `plan_run`."""
        return plan_run(
            self.survey, self.setting, tolerance, self.spans, self.device, display=self.display,
            draws=self.scenario.draws, **choice,
        )  # fmt: skip

    def plan_keeping(self, tolerance: float, reinstated: Sequence[str]) -> RunPlan:
        """Plans the run with effects that a check has reinstated; `ARITHMETIC` among them means
        the exact tier."""
        forced, tier = required(reinstated)
        return self.plan(tolerance, forced=forced, tier=tier)


def set_up_camera(
    scenario: Scenario, device: str | None, size: tuple[int, int] | None = None
) -> CameraSetup:
    """Checks the camera of a scenario and chooses its lens.

    Args:
        scenario: scenario without boards.
        device: number or part of the name of an OpenCL device, "numba", or None for the default.
        size: (rows, columns) of the board that replaces the chip, None without one.

    Raises:
        InputError: the camera, lens, duration or device cannot be simulated.
    """
    setting = camera_setting(scenario, *(size or ()))
    choice = choose_lens(scenario, setting)
    cycles = setting.clock.cycles_in(seconds_to_ps(scenario.duration))
    instants = choose_windows(scenario, cycles)  # refuses a run of no cycle
    late = [write.cycle for write in setting.writes if write.cycle >= cycles]
    if late:
        raise InputError(
            "sensor.writes", f"at cycles below {cycles}, the end of the run", f"at {late[0]}",
            "lengthen duration or drop it",
        )  # fmt: skip
    check_dim(scenario.sensor, setting, cycles)
    return CameraSetup(scenario, setting, choice, cycles, instants, choose_device(device))
