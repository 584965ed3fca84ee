"""An asynchronous camera before its run, and what is left of the run for its report."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim import Events, Lens, Light, seconds_to_ps
from cosim.light.source import Source, Target
from cosim.run.machine import Run
from sensor.asynchronous.core import EventCamera
from sensor.asynchronous.model import EventModel, Firings
from sensor.asynchronous.plan.check import Checked, View
from sensor.asynchronous.plan.plan import EventPlan
from sensor.asynchronous.readout.recover import Recovered
from sensor.asynchronous.readout.shots import EventShot
from sensor.latched.setting import CameraSetting
from sensor.sections.sensor import SensorSection


@dataclass(frozen=True, eq=False)
class EventSpec:
    """An asynchronous camera before a scene.

    Attributes:
        name, title: short and long name of the scenario.
        toml: the resolved scenario.
        inputs: the same without its title, which decides nothing of the result.
        tolerance: relative error allowed.
        section: section of the sensor, as the user wrote it.
        setting: chip, light and device.
        camera: the pixels and their way out.
        lens: lens in front of the chip.
        relay: map from the scene's light to what each pixel receives.
        illuminance: illuminance of the scene, lux; white reflects all of it.
        source: scene.
        duration: duration of the run, s.
        instants: cycles whose images are made; none for a scene of targets.
        notes: what the user must know before the run, the scene's own notes aside.
    """

    name: str
    title: str
    toml: str
    inputs: str
    tolerance: float
    section: SensorSection
    setting: CameraSetting
    camera: EventCamera
    lens: Lens
    relay: Callable[[Light], Light]
    illuminance: float
    source: Source
    duration: float
    instants: list[int]
    notes: list[str]

    @property
    def shape(self) -> tuple[int, int]:
        return self.camera.shape

    @property
    def model(self) -> EventModel:
        """Rules of a pixel."""
        return self.camera.model

    @property
    def stop(self) -> int:
        """End of the run, ps."""
        return seconds_to_ps(self.duration)

    @property
    def cycles(self) -> int:
        """Cycles of sensor.clock, the last one begun."""
        return self.setting.clock.cycle_at(self.stop - 1) + 1

    @property
    def targets(self) -> list[Target]:
        """Regions of known light; none in most scenes."""
        return list(getattr(self.source, "targets", []))

    @property
    def mean_dark(self) -> float:
        """Mean dark current, electrons/s."""
        return 0.0 if self.setting.pattern is None else self.setting.pattern.dark


@dataclass(frozen=True, eq=False)
class EventStart:
    """A camera with the light that its run begins with.

    Attributes:
        spec: camera and scene.
        view: the array under that light.
    """

    spec: EventSpec
    view: View

    @classmethod
    def under(cls, spec: EventSpec, light: Light, until: int) -> EventStart:
        """light: on the pixels. until: ps up to which it is known."""
        return cls(spec, spec.camera.view(light, until))

    def plan(self, tolerance: float) -> EventPlan:
        """The plan of the whole run, from the light that it begins with."""
        return self.spec.camera.plan(self.view, self.spec.stop, tolerance)

    @property
    def cycles(self) -> int:
        """Cycles of sensor.clock as far as the light is known, the last one begun."""
        return max(self.spec.setting.clock.cycle_at(self.view.until - 1) + 1, 1)


@dataclass(frozen=True, eq=False)
class EventViews:
    """What is made of a recording.

    Attributes:
        sent: firings that crossed the channel.
        events: the same as the file has them.
        delay: delay of each event in the channel, ps; None without a channel.
        recovered: light of each target.
        shots: images at the instants.
    """

    sent: Firings
    events: Events
    delay: npt.NDArray[np.int64] | None
    recovered: list[Recovered]
    shots: list[EventShot]


@dataclass(frozen=True, eq=False)
class EventRun:
    """A judged run, as its page reads it.

    Attributes:
        run: result, wall times and notes.
        spec: camera and scene.
        checked: the plan that was run, and its error.
        views: what was made of the recording.
    """

    run: Run
    spec: EventSpec
    checked: Checked
    views: EventViews
