"""The scenario schema: frozen, typed, complete. Unknown keys and wrong kinds of unit are refused.

A quantity is text with a unit in the file and a float in the kind's unit here. `export` gives the
whole as JSON Schema.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.functional_serializers import PlainSerializer
from pydantic.functional_validators import BeforeValidator
from pydantic.json_schema import WithJsonSchema

from cosim import InputError
from cosim.units import KINDS, format_quantity, parse_quantity
from sensor import CHIPS

__all__ = ["FilmScene", "ImageSection", "LensSection", "Scenario", "SceneSection", "SensorSection",
           "StarScene", "StepScene", "WaveScene", "export", "validate"]  # fmt: skip


def _quantity(
    kind_name: str,
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
) -> Any:
    """A float field that is written as text of one kind, with optional limits."""
    kind = KINDS[kind_name]

    def read(value: object) -> float:
        if not isinstance(value, str):
            raise ValueError(f"must be {kind}, not {value!r}")
        number = parse_quantity(value, kind)
        for limit, fine in (
            (f"above {above:g}" if above is not None else "", above is None or number > above),
            (f"at least {least:g}" if least is not None else "", least is None or number >= least),
            (f"at most {most:g}" if most is not None else "", most is None or number <= most),
        ):
            if not fine:
                raise ValueError(f"must be {kind} and {limit} {kind.unit}, not {value!r}")
        return number

    schema = {"type": "string", "description": str(kind), "examples": [kind.example]}
    return Annotated[
        float,
        BeforeValidator(read),
        PlainSerializer(lambda value: format_quantity(value, kind), return_type=str),
        WithJsonSchema(schema),
    ]


Time = _quantity("time", least=0)
Duration = _quantity("time", above=0)
Frequency = _quantity("frequency", above=0, most=1e9)
Illuminance = _quantity("illuminance", least=0)
Charge = _quantity("charge", above=0, most=2e6)
Wavelength = _quantity("wavelength", above=0)
Reflectance = Annotated[float, Field(ge=0, le=1)]


class Section(BaseModel):
    """Base of all sections."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class FilmScene(Section):
    """A clip or an image that PyAV opens; without a path the built-in moving scene."""

    kind: Literal["film"] = "film"
    path: str | None = Field(None, description="clip or image; the built-in scene when absent")
    start: Time = 0.0
    frame_rate: Frequency | None = Field(None, description="overrides the clip's own")
    illuminance: Illuminance = Field(description="falls on the scene; clip white reflects all of it")


class WaveScene(Section):
    """A person waves an arm (Huang 2022, figures 3 to 5)."""

    kind: Literal["wave"]
    illuminance: Illuminance
    rate: _quantity("frequency", least=0, most=6) = Field(  # type: ignore[valid-type]
        3.0, description="waves a second"
    )


class StarScene(Section):
    """A rotating Siemens star in a ring of grey steps."""

    kind: Literal["star"]
    illuminance: Illuminance
    spokes: Annotated[int, Field(ge=2, le=360)] = 36
    rotation: _quantity("frequency", least=0, most=1000) = Field(  # type: ignore[valid-type]
        25.0, description="revolutions a second"
    )


class StepScene(Section):
    """A grey wedge whose light steps from one level to another at one instant."""

    kind: Literal["step"]
    illuminance: Illuminance
    before: Reflectance = 0.1
    after: Reflectance = 0.9
    at: Time = Field(0.032, description="instant of the step")


SceneSection = Annotated[
    FilmScene | WaveScene | StarScene | StepScene, Field(discriminator="kind")
]


class LensSection(Section):
    """The lens in front of the chip."""

    f_number: Annotated[float, Field(ge=0.5, le=1000)] | None = Field(
        None, description="chosen so that white fires at white_rate when absent"
    )
    white_rate: Annotated[float, Field(gt=0, le=1)] = Field(
        0.6, description="spikes a cycle of white, for a chosen f-number"
    )
    transmission: Annotated[float, Field(gt=0, le=1)] = 0.9
    magnification: Annotated[float, Field(ge=0, le=100)] = 0.0
    psf: Literal["none", "airy"] = "none"


class SensorSection(Section):
    """The chip and how it is run."""

    chip: Literal[tuple(CHIPS)] = "spiketwo"  # type: ignore[valid-type]  # the presets' names
    clock: Frequency = 40e3
    threshold: Charge
    wavelength: Wavelength = Field(555.0, description="at which lux are counted as photons")
    lens: LensSection = LensSection()


class ImageSection(Section):
    """Which images a run makes, and from how many cycles."""

    at: tuple[Annotated[int, Field(ge=0)], ...] = Field(
        (), description="cycles of the instants; five evenly spaced ones when empty"
    )
    window: Annotated[int, Field(ge=1)] = 41


class Scenario(Section):
    """Everything that decides a run's result."""

    title: str
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


def _place(loc: tuple[int | str, ...], data: Any) -> _Place:
    """Dotted name of an error's location (without the union's tag) and its section's keys."""
    model: type[BaseModel] | None = Scenario
    names: list[str] = []
    keys: tuple[str, ...] = tuple(Scenario.model_fields)
    kinds = {"film": FilmScene, "wave": WaveScene, "star": StarScene, "step": StepScene}
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
    examples = _resolve(node).get("examples")
    return f"write --set {name}={examples[0]!r}" if examples else "see `viform list --schema`"


def _resolve(node: dict[str, Any]) -> dict[str, Any]:
    """Follows references and the first alternative; all scenes' properties at a union."""
    definitions = export()["$defs"]
    if "$ref" in node:
        return _resolve(definitions[node["$ref"].rsplit("/", 1)[1]])
    alternatives = node.get("oneOf") or node.get("anyOf")
    if alternatives:
        merged: dict[str, Any] = {"properties": {}}
        for inner in map(_resolve, alternatives):
            merged["properties"] |= inner.get("properties", {})
            merged.setdefault("examples", inner["examples"]) if "examples" in inner else None
        return merged
    return node


def _one_line(error: Any, data: Any) -> InputError:
    """The first error of a validation as what must be, what was given, how to mend it."""
    place = _place(error["loc"], data)
    given, kind = repr(error["input"]), error["type"]
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
        must, _, rest = text.removeprefix("must be ").rpartition(", not ")
        return InputError(place.name, must, rest, _example(place.name))
    if kind == "union_tag_invalid":
        wanted = error["ctx"]["expected_tags"]
        return InputError(f"{place.name}.kind", f"one of {wanted}", repr(error["ctx"]["tag"]), "choose one")
    must = text[0].lower() + text[1:]
    must = must.removeprefix("input should be ").removeprefix("a valid ")
    return InputError(place.name, must, given, _example(place.name))


def validate(data: dict[str, Any]) -> Scenario:
    """A checked scenario; raises InputError with one line about the first thing that is wrong."""
    try:
        return Scenario.model_validate(data)
    except ValidationError as exc:
        raise _one_line(exc.errors()[0], data) from None


def export() -> dict[str, Any]:
    """The scenario's JSON Schema."""
    if not _exported:
        _exported.update(Scenario.model_json_schema(mode="validation"))
    return _exported


_exported: dict[str, Any] = {}
