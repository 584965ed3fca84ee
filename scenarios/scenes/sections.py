"""The [scene] section: one class a kind of scene."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from pydantic import Field, field_validator

from cosim.config.quantity import Frequency, Illuminance, Quantity, Reflectance, Section, Time

__all__ = [
    "FilmScene", "SceneSection", "ShockwaveScene", "StarScene", "StepScene", "SunAndStarsScene",
    "TargetScene", "WaveScene", "scene_keys",
]  # fmt: skip


class FilmScene(Section):
    """A clip or an image that PyAV opens; without a path a built-in moving scene."""

    kind: Literal["film"] = "film"
    path: str | None = Field(
        default=None, description="clip or image; the built-in scene when absent"
    )
    drawn: Literal["workshop", "chart"] = Field(
        default="workshop", description="built-in moving scene when there is no path"
    )
    start: Time = 0.0
    frame_rate: Frequency | None = Field(
        default=None, examples=["240 Hz"], description="overrides the clip's own"
    )
    illuminance: Illuminance = Field(description="falls on the scene; clip white reflects all")


class WaveScene(Section):
    """A person waves an arm (Huang 2022, figures 3 to 5)."""

    kind: Literal["wave"]
    illuminance: Illuminance
    rate: Annotated[float, Quantity("frequency", least=0, most=6)] = Field(
        default=3.0, examples=["3 Hz"], description="waves a second"
    )


class ShockwaveScene(Section):
    """A shock wave forms on a model as a quiet wind tunnel starts (Huang 2022, figure 6)."""

    kind: Literal["shockwave"]
    illuminance: Illuminance = Field(
        description="of the schlieren bench's lamp; white is all of it"
    )
    mach: Annotated[float, Field(ge=4, le=7)] = Field(default=6.0, description="of the nozzle")
    model: Literal["wedge", "sphere"] = "wedge"
    angle: Annotated[float, Quantity("angle", least=2, most=45)] = Field(
        default=15.0, description="half angle of a wedge"
    )
    radius: Annotated[float, Quantity("length", least=1250, most=15_625)] = Field(
        default=10_000.0, examples=["10 mm"], description="of a sphere"
    )
    start: Time = Field(
        default=0.002, examples=["2 ms"], description="instant at which the nozzle begins to flow"
    )
    chamber: Annotated[float, Quantity("pressure", above=0, most=1e6)] | None = Field(
        default=None,
        description="pressure in the test section before; 0.85 of what would stop it when absent",
    )
    knife: Annotated[float, Quantity("angle", least=-90, most=90)] = Field(
        default=45.0,
        examples=["45 deg"],
        description="direction of the gradient that is seen, against the flow",
    )


class StarScene(Section):
    """A rotating Siemens star in a ring of grey steps."""

    kind: Literal["star"]
    illuminance: Illuminance
    spokes: Annotated[int, Field(ge=2, le=360)] = 36
    rotation: Annotated[float, Quantity("frequency", least=0, most=1000)] = Field(
        default=4.0, examples=["4 Hz"], description="revolutions a second"
    )


class StepScene(Section):
    """A grey wedge whose light steps from one level to another at one instant."""

    kind: Literal["step"]
    illuminance: Illuminance
    before: Reflectance = 0.1
    after: Reflectance = 0.9
    at: Time = Field(default=0.032, examples=["32 ms"], description="instant of the step")


class SunAndStarsScene(Section):
    """The sun and stars down to the darkest, as discs of known light (Huang 2022, section 4.5)."""

    kind: Literal["sun-and-stars"]
    illuminance: Illuminance = Field(description="of the sun's disc")
    dimmest: Illuminance = Field(
        default=1e-6, examples=["1e-6 lux"], description="of the dimmest star"
    )
    background: Annotated[float, Quantity("illuminance", least=0, most=1e9)] = Field(
        default=0.0, examples=["0.001 lux"], description="between the stars"
    )


class TargetScene(Section):
    """A test chart that does not move, under light that changes."""

    kind: Literal["target"]
    illuminance: Illuminance
    chart: Literal["night", "bars", "landolt", "steps", "discs"] = Field(
        default="night", description="night: bars, rings and steps on one sheet; discs: light spots"
    )
    contrast: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="reflectances are pulled towards the sheet's grey by it"
    )
    path: str | None = Field(default=None, description="a picture in the chart's place")
    course: tuple[tuple[Time, Annotated[float, Field(ge=0, le=1e12)]], ...] = Field(
        default=((0.0, 1.0),),
        min_length=1,
        max_length=1000,
        description="factor of all light: [time, factor] in order, linear between, constant "
        "outside; two at one time are a jump",
        examples=[[["0 ms", 1], ["500 ms", 1e4]]],
        json_schema_extra={"default": [["0 s", 1.0]]},
    )

    @field_validator("course")
    @classmethod
    def _in_order(cls, course: tuple[tuple[float, float], ...]) -> Any:
        times = [time for time, _ in course]
        if times != sorted(times):
            raise ValueError("must be knots in order of time")
        return course


SceneSection = Annotated[
    FilmScene | WaveScene | ShockwaveScene | StarScene | StepScene | SunAndStarsScene | TargetScene,
    Field(discriminator="kind"),
]


def scene_keys(kind: str) -> frozenset[str] | None:
    """Keys of one kind of scene; None where there is no such kind."""
    for scene in get_args(get_args(SceneSection)[0]):
        if kind in get_args(scene.model_fields["kind"].annotation):
            return frozenset(scene.model_fields)
    return None
