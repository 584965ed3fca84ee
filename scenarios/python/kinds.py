"""The camera of a scenario in memory, by the kind of its pixels: how it is made, filmed and opened.

The modules of a kind are imported where its camera is made: compiled pixels take long to load.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cosim import Clock, InputError, seconds_to_ps
from cosim.compute.opencl import shared_device
from cosim.errors import quote
from cosim.light.lens import Lens
from cosim.light.source import Source
from cosim.plan.paired import Span
from scenarios.assemble.called import called_camera
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.lens import LensChoice, make_relay
from scenarios.assemble.pixel_kinds import refuse_device
from scenarios.assemble.schema.scenario import Scenario
from sensor.latched.setting import CameraSetting

Frames = Callable[["np.float32 | None"], Source]
"""Gives frames as the light of a scene, or, with the gain of a lens, as the light behind it."""


class PixelKind(ABC):
    """How a camera with pixels of a kind is called. Its lengths are cycles of sensor.clock.

    Attributes:
        setting: chip, light and device.
    """

    def __init__(self, scenario: Scenario, setting: CameraSetting) -> None:
        self._scenario, self.setting = scenario, setting

    @abstractmethod
    def make(self, device: str | None, tier: Any) -> Any:
        """The camera. Raises InputError for a device or a tier that it cannot have."""

    @property
    def least(self) -> Clock:
        """The clock of which a length must have a period."""
        return self.setting.clock

    def length(self, seconds: float) -> int:
        """A length in the unit in which the camera films; 0 for one that is too short."""
        return self.setting.clock.cycles_in(seconds_to_ps(seconds))

    def cycles(self, length: int) -> int:
        """Cycles of sensor.clock in a length, the last one begun."""
        return length

    @abstractmethod
    def film(
        self, core: Any, frames: Frames, lens: Lens, length: int, number: int, check: bool,
        spans: Sequence[Span] | None,
    ) -> Any:  # fmt: skip
        """What call `number` of a camera gives. spans: see `LatchedCamera.film`."""

    @abstractmethod
    def open(self, core: Any, most: float, frames: Clock, lens: Lens, number: int) -> Any:
        """A live camera. most: lux of the brightest light."""

    def notes(self, choice: LensChoice) -> list[str]:
        """What a user must know of the lens and of the pixels."""
        return choice.notes

    def stated(self, lens: Lens, white_rate: float) -> dict[str, float]:
        """What the result says of the scene's white."""
        return {"white_rate": white_rate}


class _Latched(PixelKind):
    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario, camera_setting(scenario))

    def make(self, device: str | None, tier: Any) -> Any:
        return called_camera(self._scenario, self.setting, shared_device(device), tier)

    def film(
        self, core: Any, frames: Frames, lens: Lens, length: int, number: int, check: bool,
        spans: Sequence[Span] | None,
    ) -> Any:  # fmt: skip
        relay = lens.relay(self.setting.chip.pitch)
        behind = None if relay.gain is None else lambda: frames(relay.gain)
        return core.film(lambda: frames(None), relay, length, number, spans, behind, check=check)

    def open(self, core: Any, most: float, frames: Clock, lens: Lens, number: int) -> Any:
        return core.open(most, frames, lens.relay(self.setting.chip.pitch), number)


class _Unlatched(PixelKind):
    """A camera without a latch, which has one tier and runs on the processor."""

    _camera: Any

    def make(self, device: str | None, tier: Any) -> Any:
        pixel = self._scenario.sensor.pixel
        refuse_device(pixel, device)
        if tier is not None:
            raise InputError(
                "tier", f"absent with pixel = {pixel}, which has one", quote(tier),
                "leave it out",
            )  # fmt: skip
        return self._camera

    def film(
        self, core: Any, frames: Frames, lens: Lens, length: int, number: int, check: bool,
        spans: Sequence[Span] | None,
    ) -> Any:  # fmt: skip
        relay = make_relay(lens, self.setting)
        return core.film(frames(None), relay, length, number, check=check)

    def open(self, core: Any, most: float, frames: Clock, lens: Lens, number: int) -> Any:
        return core.open(most, frames, make_relay(lens, self.setting), number)


class _Asynchronous(_Unlatched):
    """An asynchronous camera; its lengths are picoseconds."""

    def __init__(self, scenario: Scenario) -> None:
        from scenarios.assemble.source.asynchronous import event_setting
        from sensor.asynchronous.setting import event_camera

        super().__init__(scenario, event_setting(scenario))
        self._camera = event_camera(scenario.sensor, self.setting, scenario.tolerance)

    @property
    def least(self) -> Clock:
        clock: Clock = self._camera.model.clock
        return clock

    def length(self, seconds: float) -> int:
        ps = seconds_to_ps(seconds)
        return ps if ps >= self._camera.model.tick else 0

    def cycles(self, length: int) -> int:
        return self.setting.clock.cycle_at(length - 1) + 1

    def notes(self, choice: LensChoice) -> list[str]:
        # These pixels do not saturate: of the lens's notes only the chosen f-number applies.
        return choice.notes[:1] if self._scenario.sensor.lens.f_number is None else []


class _Continuous(_Unlatched):
    def __init__(self, scenario: Scenario) -> None:
        from scenarios.assemble.source.continuous import continuous_chip
        from sensor.continuous.run import intensity_camera
        from sensor.sections.unlatched import ContinuousSection

        super().__init__(scenario, continuous_chip(scenario))
        section = scenario.sensor.continuous or ContinuousSection()
        image = scenario.image
        self._camera = intensity_camera(
            section, self.setting, scenario.tolerance, image.window, image.floor
        )

    def notes(self, choice: LensChoice) -> list[str]:
        from sensor.continuous.shots import notes_of

        white, setting = self._white(choice.lens), self._camera.setting
        return notes_of(self._scenario.sensor, self.setting, setting, choice.lens, white)

    def stated(self, lens: Lens, white_rate: float) -> dict[str, float]:
        return super().stated(lens, white_rate) | {"white": self._white(lens)}

    def _white(self, lens: Lens) -> float:
        """Photocurrent of white, electrons a second."""
        per_lux: float = self._camera.setting.electrons_per_lux
        return self._scenario.scene.illuminance * lens.gain * per_lux


def kind_of(scenario: Scenario) -> PixelKind:
    """How the camera of a scenario is called. Raises InputError for one that cannot be."""
    kinds: dict[str, Callable[[Scenario], PixelKind]] = {
        "latched": _Latched, "asynchronous": _Asynchronous, "continuous": _Continuous,
    }  # fmt: skip
    return kinds[scenario.sensor.pixel](scenario)
