"""The schemas of the kinds of scenarios, and their catalogue."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, reduce
from operator import or_
from typing import Annotated, Any, Final, Literal

from pydantic import Field, create_model, model_validator

from cosim import InputError
from cosim.config.amounts import at_most
from cosim.config.quantity import Duration, Section, placed
from display.camera.section import FramesSection
from display.section import SLOWEST, DisplaySection, check_planes
from imagers.catalogue import IMAGERS
from imagers.common.kind import ImagerLens, ImagerSection
from link.section import LinkScenario, LinkSection
from rtl_model.bringup.machine.section import BoardSection
from scenarios.assemble.schema.order import Data, is_recording
from scenarios.scenes.catalogue import SceneSection
from sensor.codec.packets.section import CodeSection
from sensor.sections.readout import ReadoutSection
from sensor.sections.recorded import RecordedSection
from sensor.sections.sensor import SensorSection

_DISPLAY: Any = Field(
    default=None, description="the display that shows the stream; none by default"
)
_CAMERA: Any = Field(default=None, description="the camera that films the display; none by default")
_CODE: Any = Field(default=None, description="code of the stream on a link; layered when absent")
_LINK: Any = Field(default=None, description="link that carries the coded stream; none by default")


class SpikesSection(Section):
    """A latched spike camera before the panel. Its lens is ideal: one of its pixels sees one pixel
    of the panel, whatever the size of the chip."""

    kind: Literal["spikes"]
    sensor: Annotated[SensorSection, placed("camera.sensor")] = Field(
        description="the chip; its lens is before the panel"
    )


CameraSection = Annotated[FramesSection | SpikesSection, Field(discriminator="kind")]
"""The section [camera], of either kind."""


class ImageSection(Section):
    """The instants and the window of the images that a run reconstructs."""

    # The images of an instant take 40 MB of memory and 1 MB of the report; with a display, 100 MB.
    at: tuple[Annotated[int, Field(ge=0)], ...] = Field(
        default=(),
        examples=[[100, 200]],
        max_length=25,
        description="cycles of the instants; an empty list selects five evenly spaced cycles",
    )
    window: Annotated[int, Field(ge=1)] = 41
    placing: Literal["centred", "preceding"] = Field(
        default="centred",
        description="place of the window: around the instant, or up to it, as in Huang 2022 "
        "(3.3.1)",
    )
    floor: Annotated[float, Field(ge=0, le=1)] | None = Field(
        default=None,
        description="lower limit of the rate, spikes a cycle, to which errors are relative; by "
        "default one spike in the window",
    )

    @property
    def preceding(self) -> bool:
        return self.placing == "preceding"


class _Linked(Section):
    """A scenario whose stream may cross a link."""

    @model_validator(mode="before")
    @classmethod
    def _coded(cls, data: Any) -> Any:
        """A link has a code."""
        if isinstance(data, dict) and data.get("link") is not None and data.get("code") is None:
            return data | {"code": {}}
        return data


class Scenario(_Linked):
    """A spike camera before a scene, and the link and the display that its stream drives."""

    title: str = Field(examples=["A clip at 40 kHz"])
    duration: Duration
    tolerance: Annotated[float, Field(ge=0, le=1)] = 1e-3
    draws: Literal["each", "bank"] = Field(
        default="bank",
        description="draws of the noise of latched pixels: each for one for each spike, as in full "
        "physics; bank for a bank of thresholds where the tolerance allows it, which is faster and "
        "has other noise of the same law",
    )
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    scene: SceneSection
    sensor: SensorSection
    readout: ReadoutSection | None = Field(
        default=None,
        description="the digital readout of the chip to its host; without one, every plane arrives",
    )
    display: DisplaySection | None = _DISPLAY
    camera: CameraSection | None = _CAMERA
    image: ImageSection = ImageSection()
    code: CodeSection | None = _CODE
    link: LinkSection | None = _LINK

    @model_validator(mode="after")
    def _shows_planes(self) -> Scenario:
        if self.display is None:
            return self
        rows = self.sensor.own_chip.height
        if (self.sensor.row_time or 0.0) * rows * SLOWEST > 1 + 1e-9:  # no clock would fit
            raise InputError(
                "sensor.row_time", f"at most {at_most(1 / (SLOWEST * rows))} s with a display: "
                f"{rows} rows within a plane of {SLOWEST:g} Hz", f"{self.sensor.row_time:g} s",
                "lower it, or leave display out",
            )  # fmt: skip
        check_planes(self.sensor.clock)  # before a duration is asked for that has such a cycle
        return self

    @model_validator(mode="after")
    def _films_no_panel(self) -> Scenario:
        if self.sensor.clock_steering is not None:
            raise InputError(
                "sensor.clock_steering", "absent with a [scene], which has no planes to lock to",
                str(self.sensor.clock_steering).lower(),
                "leave it out; that of a link's camera is link.sensor.clock_steering",
            )  # fmt: skip
        return self


class RecordingScenario(_Linked):
    """A recorded stream in the place of a chip, and the link and the display that it drives."""

    title: str = Field(examples=["A recording is shown"])
    duration: Duration | None = Field(
        default=None, description="the first part of the stream; by default all of it"
    )
    seed: Annotated[int, Field(ge=0, lt=2**32)] = Field(
        default=1, description="seed of the noise of [link] and [camera]"
    )
    sensor: RecordedSection
    display: DisplaySection | None = _DISPLAY
    camera: CameraSection | None = _CAMERA
    image: ImageSection = ImageSection()
    code: CodeSection | None = _CODE
    link: LinkSection | None = _LINK


class ImagerScenario(_Linked):
    """A scene before an imager other than a spike camera."""

    title: str = Field(examples=["An EMCCD in a dark room"])
    duration: Duration
    tolerance: Annotated[float, Field(ge=0, le=1)] = 1e-2
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    scene: SceneSection
    imager: ImagerSection
    lens: ImagerLens | None = Field(
        default=None,
        description="lens before the chip; without one, the illuminance of the scene falls on the "
        "pixels unchanged",
    )
    display: DisplaySection | None = Field(
        default=None,
        description="the display that shows the frames, as spikes; none by default",
    )
    camera: CameraSection | None = _CAMERA
    image: ImageSection | None = Field(
        default=None, description="the instants at which the display and the link are seen"
    )
    code: CodeSection | None = _CODE
    link: LinkSection | None = _LINK


class BoardScenario(Section):
    """The bring-up of a board, without a scene; the board contains the sensor."""

    title: str = Field(examples=["A board is brought up"])
    seed: Annotated[int, Field(ge=0, lt=2**32)] = Field(
        default=1, description="seed of the captured image"
    )
    board: BoardSection = BoardSection()


StreamScenario = Scenario | ImagerScenario | RecordingScenario
"""Scenarios whose stream may have a link, a display or a board behind it."""

AnyScenario = StreamScenario | LinkScenario | BoardScenario


def imager_scenario() -> type[ImagerScenario]:
    """The schema of a scenario with an [imager]: its section is one of those in the catalogue of
    imagers, selected by `kind`."""
    return _with_sections(tuple(kind.section for kind in IMAGERS.values()))


@cache
def _with_sections(sections: tuple[type[ImagerSection], ...]) -> type[ImagerScenario]:
    one: Any = Annotated[reduce(or_, sections), Field(discriminator="kind")]
    return create_model(
        "ImagerScenario", __base__=ImagerScenario, __doc__=ImagerScenario.__doc__, imager=(one, ...)
    )


@dataclass(frozen=True)
class ScenarioKind:
    """A kind of scenario.

    Attributes:
        name: name in the list of keys.
        words: name in messages, such as "a board".
        scenario: class of its scenarios.
        selected: whether it is the kind of these data, which `order.check_order` accepts.
        schema: returns the schema, where sections of a catalogue complete the class.
    """

    name: str
    words: str
    scenario: type[AnyScenario]
    selected: Callable[[Data], bool]
    schema: Callable[[], type[AnyScenario]] | None = None

    def whole(self) -> type[AnyScenario]:
        """The schema of its scenarios."""
        return self.scenario if self.schema is None else self.schema()


KINDS: Final[list[ScenarioKind]] = [
    ScenarioKind("camera", "a spike camera", Scenario, lambda data: True),
    ScenarioKind(
        "link", "a link", LinkScenario, lambda data: "link" in data and "scene" not in data
    ),
    ScenarioKind("board", "a board", BoardScenario, lambda data: "board" in data),
    ScenarioKind(
        "imager", "another imager", ImagerScenario, lambda data: "imager" in data, imager_scenario
    ),
    ScenarioKind("recording", "a recorded stream", RecordingScenario, is_recording),
]
"""The kinds in the order of the exported schema. The last one that is selected is that of a
scenario."""


def kind_of_data(data: Data) -> ScenarioKind:
    """The kind of scenario of these data."""
    return next(kind for kind in reversed(KINDS) if kind.selected(data))


def kind_of(scenario: AnyScenario) -> ScenarioKind:
    """The kind of a scenario."""
    return next(kind for kind in KINDS if isinstance(scenario, kind.scenario))
