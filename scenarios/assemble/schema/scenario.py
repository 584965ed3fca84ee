"""A whole scenario, and its JSON Schema."""

from __future__ import annotations

from functools import cache, reduce
from operator import or_
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, create_model

from cosim.config.quantity import Duration, Section
from display.section import DisplaySection
from link.section import LinkScenario
from rtl_model.bringup.machine.section import BoardSection
from rtl_model.imagers.catalogue import IMAGERS
from rtl_model.imagers.interface.section import ImagerLens, ImagerSection
from scenarios.scenes.catalogue import SceneSection
from sensor.sections.sensor import SensorSection

__all__ = [
    "AnyScenario",
    "BoardScenario",
    "ImageSection",
    "ImagerScenario",
    "LinkScenario",
    "Scenario",
    "export",
    "imager_scenario",
]


class ImageSection(Section):
    """Which images a run makes, and from how many cycles."""

    # An instant's images take 40 MB of memory and 1 MB of the report; with a display, 100 MB.
    at: tuple[Annotated[int, Field(ge=0)], ...] = Field(
        default=(),
        max_length=25,
        description="cycles of the instants; five evenly spaced ones when empty",
    )
    window: Annotated[int, Field(ge=1)] = 41
    floor: Annotated[float, Field(ge=0, le=1)] | None = Field(
        default=None,
        description="spikes a cycle below which an error counts as if the rate were this; one in "
        "the window when absent",
    )


class Scenario(Section):
    """Everything that decides a run's result."""

    title: str = Field(examples=["A clip at 40 kHz"])
    duration: Duration
    tolerance: Annotated[float, Field(ge=0, le=1)] = 1e-3
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    scene: SceneSection
    sensor: SensorSection
    display: DisplaySection | None = Field(
        default=None, description="what shows the stream; none when absent"
    )
    image: ImageSection = ImageSection()


class ImagerScenario(Section):
    """A scene before an imager that is no spike camera."""

    title: str = Field(examples=["An EMCCD in a dark room"])
    duration: Duration
    tolerance: Annotated[float, Field(ge=0, le=1)] = 1e-2
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    scene: SceneSection
    imager: ImagerSection
    lens: ImagerLens | None = Field(
        default=None, description="none when absent: the scene's light falls on the pixels as it is"
    )


class BoardScenario(Section):
    """A board is brought up: no scene, no sensor but the board's."""

    title: str = Field(examples=["A board is brought up"])
    seed: Annotated[int, Field(ge=0, lt=2**32)] = Field(
        default=1, description="of the image that is captured"
    )
    board: BoardSection = BoardSection()


AnyScenario = Scenario | LinkScenario | BoardScenario | ImagerScenario


def imager_scenario() -> type[ImagerScenario]:
    """The class that a scenario with an [imager] is checked with: its section is that of one of the
    imagers in the catalogue, by `kind`."""
    return _with_sections(tuple(kind.section for kind in IMAGERS.values()))


@cache
def _with_sections(sections: tuple[type[ImagerSection], ...]) -> type[ImagerScenario]:
    one: Any = Annotated[reduce(or_, sections), Field(discriminator="kind")]
    return create_model(
        "ImagerScenario", __base__=ImagerScenario, __doc__=ImagerScenario.__doc__, imager=(one, ...)
    )


def export() -> dict[str, Any]:
    """JSON Schema of any scenario: one with a scene, of a link, of a board, or of an imager."""
    return _export(imager_scenario())


@cache
def _export(imager: type[ImagerScenario]) -> dict[str, Any]:
    kinds: Any = Scenario | LinkScenario | BoardScenario | imager
    whole: TypeAdapter[Any] = TypeAdapter(kinds)
    return whole.json_schema(mode="validation")
