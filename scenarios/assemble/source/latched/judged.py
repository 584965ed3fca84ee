"""The data of a latched camera's run for the pages of the report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cosim.files import ZarrStream
from cosim.light.lens import Lens
from cosim.light.mosaic import Mosaic
from cosim.light.source import Source
from cosim.plan.error import Finding
from cosim.run.machine import Run
from cosim.run.result import Result
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.latched.plan import RunPlan
from sensor import CameraSetting
from sensor.codec.size import Sizes
from sensor.latched.check.law import BankChange
from sensor.reconstruct.shots import Shot


@dataclass(frozen=True, eq=False)
class LatchedRun:
    """An evaluated run of a latched camera.

    Attributes:
        run: result, wall times and notes.
        scenario: scenario of the user.
        setting, lens, white_rate, instants, source: camera and scene; see `CameraSetup`.
        plan: effects of the simulated camera, tile by tile.
        stream: recorded stream.
        shots: images at the instants; empty before a display.
        sizes: sizes of the stream in several codes, None before a display.
        mosaic: filter array on the pixels; None for none.
        bank: what thresholds from the bank change; None where that was not measured.
    """

    run: Run
    scenario: Scenario
    setting: CameraSetting
    lens: Lens
    white_rate: float
    instants: list[int]
    source: Source
    plan: RunPlan
    stream: ZarrStream
    shots: list[Shot]
    sizes: Sizes | None
    mosaic: Mosaic | None = None
    bank: BankChange | None = None

    @property
    def folder(self) -> Path:
        return self.run.folder

    @property
    def result(self) -> Result:
        return self.run.result

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time of each stage, s."""
        return self.run.seconds

    @property
    def began(self) -> float:
        """time.perf_counter() at the start of the command."""
        return self.run.began

    @property
    def reinstated(self) -> list[Finding]:
        """Findings that led to another recording."""
        return self.run.reinstated
