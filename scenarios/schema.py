"""The scenario schema: frozen, typed, complete. Unknown keys and wrong kinds of unit are refused.

A quantity is text with a unit in the file and a float in the kind's unit here. `export` gives the
whole as JSON Schema.
"""

from __future__ import annotations

import difflib
import math
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import CoreSchema, core_schema

from cosim import InputError
from cosim.units import KINDS, Kind, format_quantity, parse_quantity
from sensor import CHIPS

__all__ = ["FilmScene", "ImageSection", "LensSection", "Scenario", "SceneSection", "SensorSection",
           "StarScene", "StepScene", "WaveScene", "export", "validate"]  # fmt: skip


@dataclass(frozen=True)
class Quantity:
    """Makes a float field one that is written as text of one kind, with optional limits."""

    kind_name: str
    above: float | None = None
    least: float | None = None
    most: float | None = None

    @property
    def kind(self) -> Kind:
        return KINDS[self.kind_name]

    def read(self, value: object) -> float:
        """The number in the kind's unit; ValueError "must be ..." for anything else."""
        must = f"must be {self.kind}"
        if not isinstance(value, str):
            raise ValueError(must)
        try:
            number = parse_quantity(value, self.kind)
        except ValueError:
            raise ValueError(must) from None
        for limit in (self.least, self.most):
            if limit is not None and math.isclose(number, limit, rel_tol=1e-12):
                number = limit  # 0.38 um is 380 nm but for a rounding
        for word, limit, fine in (
            ("above", self.above, self.above is None or number > self.above),
            ("at least", self.least, self.least is None or number >= self.least),
            ("at most", self.most, self.most is None or number <= self.most),
        ):
            if not fine:
                raise ValueError(f"{must} and {word} {limit:g} {self.kind.unit}")
        return number

    def write(self, value: float) -> str:
        """Text that `read` reads back to the same float."""
        return format_quantity(value, self.kind)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.read,
            serialization=core_schema.plain_serializer_function_ser_schema(self.write),
        )

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        return {"type": "string", "description": str(self.kind), "examples": [self.kind.example]}


DAY = 86_400.0
"""Seconds; no run is longer (at 40 kHz it would be 3.5e9 cycles)."""

# An electron is the least threshold; fixed point sets the most. Outside the visible, lux say
# nothing of photons.
Time = Annotated[float, Quantity("time", least=0, most=DAY)]
Duration = Annotated[float, Quantity("time", above=0, most=DAY)]
Frequency = Annotated[float, Quantity("frequency", above=0, most=1e9)]
Illuminance = Annotated[float, Quantity("illuminance", above=0, most=1e9)]
Charge = Annotated[float, Quantity("charge", least=1, most=2e6)]
Wavelength = Annotated[float, Quantity("wavelength", least=380, most=780)]
Noise = Annotated[float, Quantity("charge", least=0, most=30_000)]
Current = Annotated[float, Quantity("current", least=0, most=1e12)]
Temperature = Annotated[float, Quantity("temperature", least=-150, most=150)]
Reflectance = Annotated[float, Field(ge=0, le=1)]
Spread = Annotated[float, Field(ge=0, le=1)]
Share = Annotated[float, Field(ge=0, le=1)]


class Section(BaseModel):
    """Base of all sections."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class FilmScene(Section):
    """A clip or an image that PyAV opens; without a path the built-in moving scene."""

    kind: Literal["film"] = "film"
    path: str | None = Field(
        default=None, description="clip or image; the built-in scene when absent"
    )
    start: Time = 0.0
    frame_rate: Frequency | None = Field(default=None, description="overrides the clip's own")
    illuminance: Illuminance = Field(description="falls on the scene; clip white reflects all")


class WaveScene(Section):
    """A person waves an arm (Huang 2022, figures 3 to 5)."""

    kind: Literal["wave"]
    illuminance: Illuminance
    rate: Annotated[float, Quantity("frequency", least=0, most=6)] = Field(
        default=3.0, description="waves a second"
    )


class StarScene(Section):
    """A rotating Siemens star in a ring of grey steps."""

    kind: Literal["star"]
    illuminance: Illuminance
    spokes: Annotated[int, Field(ge=2, le=360)] = 36
    rotation: Annotated[float, Quantity("frequency", least=0, most=1000)] = Field(
        default=4.0, description="revolutions a second"
    )


class StepScene(Section):
    """A grey wedge whose light steps from one level to another at one instant."""

    kind: Literal["step"]
    illuminance: Illuminance
    before: Reflectance = 0.1
    after: Reflectance = 0.9
    at: Time = Field(default=0.032, description="instant of the step")


SceneSection = Annotated[FilmScene | WaveScene | StarScene | StepScene, Field(discriminator="kind")]


class LensSection(Section):
    """The lens in front of the chip."""

    f_number: Annotated[float, Field(ge=0.5, le=1000)] | None = Field(
        default=None, description="chosen so that white fires at white_rate when absent"
    )
    white_rate: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.6, description="spikes a cycle of white, for a chosen f-number"
    )
    transmission: Annotated[float, Field(gt=0, le=1)] = 0.9
    magnification: Annotated[float, Field(ge=0, le=100)] = 0.0
    psf: Literal["none", "airy"] = "none"


class PatternSection(Section):
    """What differs from pixel to pixel of one device and stays. Nothing of it is published for the
    chips here: every size is the user's own."""

    device_seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    prnu: Spread = Field(default=0.0, description="spread of the light's gain, relative")
    threshold_fpn: Spread = Field(default=0.0, description="spread of the threshold, relative")
    dark_current: Current = Field(default=0.0, description="mean, at 25 degC")
    dsnu: Spread = Field(default=0.0, description="spread of the dark current, relative to it")
    temperature: Temperature = Field(default=25.0, description="dark current doubles every 6.5 K")
    hot_pixels: Share = Field(default=0.0, description="share of pixels")
    hot_current: Current = Field(default=0.0, description="that a hot pixel has on top")
    dead_pixels: Share = Field(default=0.0, description="share of pixels that see no light")


class SensorSection(Section):
    """The chip and how it is run."""

    chip: Literal[tuple(CHIPS)] = "spiketwo"  # type: ignore[valid-type]  # the presets' names
    clock: Frequency = 40e3
    threshold: Charge
    wavelength: Wavelength = Field(default=555.0, description="at which lux are counted as photons")
    reset: Literal["residual", "hard", "subtract"] = Field(
        default="residual", description="what becomes of charge beyond the threshold at a spike"
    )
    threshold_noise: Noise = Field(default=0.0, description="standard deviation, of each spike")
    dead_time: Time = Field(default=0.0, description="after each spike; at most a cycle")
    lens: LensSection = LensSection()
    pattern: PatternSection | None = None


class ImageSection(Section):
    """Which images a run makes, and from how many cycles."""

    # An instant's images take 40 MB of memory and 1 MB of the report.
    at: tuple[Annotated[int, Field(ge=0)], ...] = Field(
        default=(),
        max_length=25,
        description="cycles of the instants; five evenly spaced ones when empty",
    )
    window: Annotated[int, Field(ge=1)] = 41


class Scenario(Section):
    """Everything that decides a run's result."""

    title: str = Field(examples=["A clip at 40 kHz"])
    duration: Duration
    tolerance: Annotated[float, Field(ge=0, le=1)] = 1e-3
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    scene: SceneSection
    sensor: SensorSection
    image: ImageSection = ImageSection()


@dataclass(frozen=True)
class _Place:
    """A key of the schema: its dotted name and the section it belongs to."""

    name: str
    keys: tuple[str, ...]


def _place(loc: tuple[int | str, ...]) -> _Place:
    """Dotted name of an error's location (without the union's tag) and its section's keys."""
    model: type[BaseModel] | None = Scenario
    names: list[str] = []
    keys: tuple[str, ...] = tuple(Scenario.model_fields)
    kinds: dict[str, type[BaseModel]] = {
        "film": FilmScene, "wave": WaveScene, "star": StarScene, "step": StepScene,
    }  # fmt: skip
    for part in loc:
        if names == ["scene"] and part in kinds and model is None:
            model = kinds[str(part)]
            keys = tuple(model.model_fields)
            continue
        names.append(str(part))
        field = model.model_fields.get(str(part)) if model is not None else None
        if model is not None:
            keys = tuple(model.model_fields)
        inner = field.annotation if field is not None else None
        model = inner if isinstance(inner, type) and issubclass(inner, BaseModel) else None
    return _Place(".".join(names), keys)


def _example(name: str) -> str:
    """An instruction that shows what to write for a key."""
    node: dict[str, Any] = export()
    for part in name.split("."):
        node = _resolve(node).get("properties", {}).get(part, {})
    found = _resolve(node)
    examples = found.get("examples") or found.get("enum") or [found.get("const")]
    known = examples[0] is not None
    return f"write --set {name}={examples[0]!r}" if known else "see `viform list --schema`"


def _resolve(node: dict[str, Any]) -> dict[str, Any]:
    """Follows references and the first alternative; all scenes' properties at a union."""
    definitions = export()["$defs"]
    if "$ref" in node:
        return _resolve(definitions[node["$ref"].rsplit("/", 1)[1]])
    alternatives = node.get("oneOf") or node.get("anyOf")
    if alternatives:
        merged: dict[str, Any] = {"properties": {}}
        for inner in map(_resolve, alternatives):
            merged["properties"] = inner.get("properties", {}) | merged["properties"]
            if "examples" in inner:
                merged.setdefault("examples", inner["examples"])
        return merged
    return node


_MUST = {
    "model_type": "a section",
    "model_attributes_type": "a section",
    "tuple_type": "a list such as [100, 200]",
    "string_type": "text",
    "string_unicode": "text in UTF-8",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number of fewer digits",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "finite_number": "a finite number",
    "greater_than": "above {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "less_than": "below {lt}",
    "less_than_equal": "at most {le:g}",
    "literal_error": "{expected}",
}
"""What a key must be, by pydantic's type of error; the braces are filled from its context."""

_LONGEST = 80
"""Characters of a wrong value that a message repeats."""


def _shown(value: object) -> str:
    """A wrong value as a message repeats it."""
    try:
        text = repr(value)
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a number of thousands of digits"
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _one_line(error: Any) -> InputError:
    """The first error of a validation as what must be, what was given, how to mend it."""
    place = _place(error["loc"])
    given, kind = _shown(error["input"]), error["type"]
    if kind == "extra_forbidden":
        key = place.name.rsplit(".", 1)[-1]
        near = difflib.get_close_matches(key, place.keys, 1)
        section = place.name.rpartition(".")[0]
        mend = f"did you mean {f'{section}.' if section else ''}{near[0]}?" if near else "remove it"
        return InputError(place.name, f"one of {', '.join(place.keys)}", "an unknown key", mend)
    if kind in ("missing", "union_tag_not_found"):
        name = f"{place.name}.kind" if kind == "union_tag_not_found" else place.name
        return InputError(name, "given", "absent", _example(name))
    text = error["msg"].removeprefix("Value error, ").strip()
    if text.startswith("must be "):
        return InputError(place.name, text.removeprefix("must be "), given, _example(place.name))
    if kind == "union_tag_invalid":
        wanted, tag = error["ctx"]["expected_tags"], _shown(error["ctx"]["tag"])
        return InputError(f"{place.name}.kind", f"one of {wanted}", tag, "choose one")
    must = _MUST[kind].format(**error.get("ctx", {})) if kind in _MUST else text.lower()
    return InputError(place.name, must, given, _example(place.name))


def validate(data: dict[str, Any]) -> Scenario:
    """A checked scenario; raises InputError with one line about the first thing that is wrong."""
    try:
        return Scenario.model_validate(data)
    except ValidationError as exc:
        raise _one_line(exc.errors()[0]) from None


def export() -> dict[str, Any]:
    """The scenario's JSON Schema."""
    if not _exported:
        _exported.update(Scenario.model_json_schema(mode="validation"))
    return _exported


_exported: dict[str, Any] = {}
