"""The scenario schema: what it refuses and how it says so, what it exports, what it keeps."""

from __future__ import annotations

import copy
import json
import math
import tomllib
from collections.abc import Iterator
from typing import Any, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, WrapValidator

from cosim import InputError
from cosim.config.quantity import Quantity
from cosim.config.toml import to_toml
from scenarios.assemble.schema.export import export
from scenarios.assemble.schema.loading import load, shipped
from scenarios.assemble.schema.messages import _sections, validate
from scenarios.assemble.schema.scenario import AnyScenario, Scenario
from sensor.sections.sensor import SensorSection

GOOD: dict[str, Any] = {
    "title": "A clip",
    "duration": "64 ms",
    "scene": {"kind": "film", "illuminance": "700 lux"},
    "sensor": {"clock": "40 kHz", "threshold": "1000 e"},
}

TIME, CLOCK = "a time such as '64 ms'", "a frequency such as '40 kHz'"
LUX, CHARGE = "an illuminance such as '700 lux'", "a charge such as '1000 e'"
NM = "a wavelength such as '555 nm'"
SCHEMA = "see `viform list --keys`"


def changed(key: str, value: object) -> dict[str, Any]:
    """GOOD with one key set, or taken out where the value is None."""
    data = copy.deepcopy(GOOD)
    *sections, last = key.split(".")
    node = data
    for section in sections:
        node = node.setdefault(section, {})
    if value is None:
        del node[last]
    else:
        node[last] = value
    return data


def message(data: dict[str, Any]) -> str:
    with pytest.raises(InputError) as caught:
        validate(data)
    text = str(caught.value)
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("key", "value", "must"),
    [
        ("sensor.clock", "40 lux", CLOCK),
        ("sensor.clock", "40 bit/s", CLOCK),
        ("sensor.clock", "40", CLOCK),
        ("sensor.clock", "kHz", CLOCK),
        ("sensor.clock", "", CLOCK),
        ("sensor.clock", 40000, CLOCK),
        ("sensor.clock", True, CLOCK),
        ("sensor.clock", "0 Hz", f"{CLOCK} and above 0 Hz"),
        ("sensor.clock", "2 GHz", f"{CLOCK} and at most 1e+09 Hz"),
        ("sensor.threshold", "-5 e", f"{CHARGE} and at least 1 e"),
        ("sensor.threshold", "0.5 e", f"{CHARGE} and at least 1 e"),
        ("sensor.threshold", "1000 V", CHARGE),
        ("sensor.wavelength", "900 nm", f"{NM} and at most 780 nm"),
        ("sensor.wavelength", "555", NM),
        ("scene.illuminance", "700 cd/m2", LUX),
        ("scene.illuminance", "700 cd/m^2", LUX),
        ("scene.illuminance", "700 W/m^2", LUX),
        ("scene.illuminance", "0 lux", f"{LUX} and above 0 lux"),
        ("scene.illuminance", "1e300 lux", f"{LUX} and at most 1e+09 lux"),
        ("scene.illuminance", "1e-300 lux", f"{LUX} and of a size of 1e-30 lux or more"),
        ("scene.start", "1e-320 s", f"{TIME} and of a size of 1e-30 s or more"),
        ("scene.start", "-1 ms", f"{TIME} and at least 0 s"),
        ("scene.start", "1 yr", TIME),
        ("duration", "5 px", TIME),
        ("duration", "nan s", TIME),
        ("duration", "inf s", TIME),
        ("duration", "1e999 s", TIME),
        ("duration", math.nan, TIME),
        ("duration", "0 s", f"{TIME} and above 0 s"),
        ("duration", "1e300 s", f"{TIME} and at most 86400 s"),
    ],
)
def test_a_wrong_quantity_is_told_what_must_be_what_was_given_and_what_to_write(key, value, must):
    example = must.split("'")[1]
    expected = f"{key} must be {must}, not {value!r}; write --set {key}='{example}'"
    assert message(changed(key, value)) == expected


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("tolerance", math.nan, f"tolerance must be a finite number, not nan; {SCHEMA}"),
        ("tolerance", math.inf, f"tolerance must be a finite number, not inf; {SCHEMA}"),
        ("tolerance", "much", f"tolerance must be a number, not 'much'; {SCHEMA}"),
        ("tolerance", -1e-3, f"tolerance must be at least 0, not -0.001; {SCHEMA}"),
        ("tolerance", 2, f"tolerance must be at most 1, not 2; {SCHEMA}"),
        ("seed", -1, f"seed must be at least 0, not -1; {SCHEMA}"),
        ("seed", 2**32, f"seed must be below 4294967296, not 4294967296; {SCHEMA}"),
        ("seed", 1.5, f"seed must be a whole number, not 1.5; {SCHEMA}"),
        ("seed", "one", f"seed must be a whole number, not 'one'; {SCHEMA}"),
        ("title", 5, "title must be text, not 5; write --set title='A clip at 40 kHz'"),
        ("title", None, "title must be given, not absent; write --set title='A clip at 40 kHz'"),
        ("duration", None, "duration must be given, not absent; write --set duration='64 ms'"),
        ("sensor.threshold", None,
         "sensor.threshold must be given, not absent; write --set sensor.threshold='1000 e'"),
        ("scene.illuminance", None,
         "scene.illuminance must be given, not absent; write --set scene.illuminance='700 lux'"),
        ("scene.kind", None, "scene.kind must be given, not absent; write --set scene.kind='film'"),
        ("scene", None, f"scene must be given, not absent; {SCHEMA}"),
        ("sensor", None, f"sensor must be given, not absent; {SCHEMA}"),
        ("scene", "film", f"scene must be a section, not 'film'; {SCHEMA}"),
        ("sensor", 7, f"sensor must be a section, not 7; {SCHEMA}"),
        ("sensor.lens", [1], f"sensor.lens must be a section, not [1]; {SCHEMA}"),
        ("scene.kind", "fil",
         "scene.kind must be one of 'film', 'wave', 'shockwave', 'star', 'step', 'sun-and-stars', "
         "'target', 'objects', not 'fil'; "
         "choose one"),
        ("sensor.chip", "spikethree",
         "sensor.chip must be 'spiketwo', 'spikeone', 'spikeone-450x200' or 'spikeasync', not "
         "'spikethree'; "
         "write --set sensor.chip='spiketwo'"),
        ("sensor.lens.f_number", 0.1,
         f"sensor.lens.f_number must be at least 0.5, not 0.1; {SCHEMA}"),
        ("sensor.quantum_efficiency", 1e-320,
         "sensor.quantum_efficiency must be of a size of 1e-30 or more, not 1e-320; write --set "
         "sensor.quantum_efficiency=0.7"),
        ("sensor.drift", 1e-40,
         f"sensor.drift must be of a size of 1e-30 or more, not 1e-40; {SCHEMA}"),
        ("sensor.lens.white_rate", 0, f"sensor.lens.white_rate must be above 0, not 0; {SCHEMA}"),
        ("image.at", 3, "image.at must be a list such as [100, 200], not 3; "
         "write --set image.at='[100, 200]'"),
        ("sensor.writes", [100],
         'sensor.writes.0 must be a section such as {"cycle": 400, "threshold_level": 8}, not 100; '
         + SCHEMA),
        ("sensor.duplicated_rows", [100, 200],
         f"sensor.duplicated_rows.0 must be a list such as [0, 2], not 100; {SCHEMA}"),
        ("image.at", [1, -2], f"image.at.1 must be at least 0, not -2; {SCHEMA}"),
        ("image.window", 0, f"image.window must be at least 1, not 0; {SCHEMA}"),
        ("sensor.treshold", "5 e",
         "sensor.treshold must be a key that is known, not an unknown key; did you mean "
             "sensor.threshold?"),
        ("scene.ilumminance", "5 lux",
         "scene.ilumminance must be a key that is known, not an unknown key; did you mean "
             "scene.illuminance?"),
        ("sensor.lens.fnumber", 2,
         "sensor.lens.fnumber must be a key that is known, not an unknown key; did you mean "
             "sensor.lens.f_number?"),
        ("dispaly", {},
         "dispaly must be a key that is known, not an unknown key; did you mean display?"),
        ("display", {"beside": 60},
         'display.beside must be a list such as ["60 Hz", "120 Hz"], not 60; '
         """write --set display.beside='["60 Hz", "120 Hz"]'"""),
        ("display", {"projector": "off"},
         "display.projector must be a frequency such as '16 kHz', or none, not 'off'; write --set "
         "display.projector='16 kHz'"),
        ("receiver", {},
         "receiver must be one of title, duration, tolerance, draws, seed, scene, sensor, readout, "
         "display, camera, image, code, link, not an unknown key; remove it"),
    ],
)  # fmt: skip
def test_every_other_wrong_input_is_one_line_with_the_mend(key, value, expected):
    assert message(changed(key, value)) == expected


def test_a_key_of_another_kind_of_scene_is_refused():
    said = message(changed("scene", {"kind": "star", "illuminance": "1 lux", "path": "a.mp4"}))
    assert said == (
        "scene.path must be given with scene.kind = film, not with another kind; set "
        "scene.kind=film, or remove it"
    )
    # of a film there is no contrast: another kind would only move the refusal
    section = {"kind": "target", "illuminance": "1 lux", "contrast": 0.5, "frame_rate": "1 Hz"}
    said = message(changed("scene", section))
    assert said == (
        "scene.frame_rate must be given with scene.kind = film, not with another kind; remove it"
    )
    said = message(changed("scene", {"kind": "star", "illuminance": "1 lux", "foo": 1}))
    assert said.startswith("scene.foo must be one of kind, illuminance, spokes, rotation, not")


def test_a_section_without_its_kind_is_told_the_one_that_has_its_keys():
    data = changed("camera", {"sensor": {"threshold": "1000 e"}}) | {"display": {}}
    said = message(data)
    assert said == "camera.kind must be given, not absent; write --set camera.kind='spikes'"


def test_a_long_wrong_value_is_not_repeated_whole():
    assert len(message(changed("title", list(range(10_000))))) < 200
    assert "thousands of digits" in message(changed("title", 10**5000))


def test_defaults_are_those_of_the_design():
    scenario = validate(GOOD)
    assert (scenario.seed, scenario.tolerance, scenario.image.window) == (1, 1e-3, 41)
    assert (scenario.sensor.chip, scenario.sensor.lens.white_rate) == ("spiketwo", 0.6)
    assert scenario.sensor.lens.f_number is None
    assert scenario.duration == 0.064
    assert scenario.sensor.clock == 40_000


def test_a_scenario_is_frozen():
    with pytest.raises(ValueError, match="frozen"):
        validate(GOOD).seed = 2


# JSON Schema (draft 2020-12), as far as the export goes.

TYPES = {
    "string": str, "array": list, "object": dict, "null": type(None), "boolean": bool,
    "integer": int, "number": (int, float),
}  # fmt: skip
LIMITS = {
    "minimum": lambda x, limit: x >= limit,
    "maximum": lambda x, limit: x <= limit,
    "exclusiveMinimum": lambda x, limit: x > limit,
    "exclusiveMaximum": lambda x, limit: x < limit,
    "maxItems": lambda x, limit: len(x) <= limit,
    "minItems": lambda x, limit: len(x) >= limit,
    "multipleOf": lambda x, unit: x % unit == 0,
}
SAID_ONLY = {"title", "description", "default", "examples", "$defs", "discriminator", "quantity"}


def faults(node: dict[str, Any], data: Any, at: str = "") -> Iterator[str]:
    """Places where data breaks the schema."""
    known = {"$ref", "type", "properties", "required", "additionalProperties", "oneOf", "anyOf"}
    known |= {"const", "enum", "items", "prefixItems", *LIMITS, *SAID_ONLY}
    assert set(node) <= known, f"a keyword that this check does not know: {set(node) - known}"
    if "$ref" in node:
        root, defs, name = node["$ref"].split("/")
        assert (root, defs) == ("#", "$defs")
        yield from faults(export()["$defs"][name], data, at)
    if "type" in node and (
        not isinstance(data, TYPES[node["type"]])
        or (isinstance(data, bool) and node["type"] != "boolean")
    ):
        yield f"{at} is no {node['type']}"
        return
    if "const" in node and data != node["const"]:
        yield f"{at} is not {node['const']}"
    if "enum" in node and data not in node["enum"]:
        yield f"{at} is not of {node['enum']}"
    for word, holds in LIMITS.items():
        if word in node and not holds(data, node[word]):
            yield f"{at} breaks {word}"
    for word, fits in (("oneOf", lambda n: n == 1), ("anyOf", lambda n: n >= 1)):
        if word in node and not fits(sum(not [*faults(n, data, at)] for n in node[word])):
            yield f"{at} fits not {word}"
    for i, part in enumerate(node.get("prefixItems", ())):
        if isinstance(data, list) and i < len(data):
            yield from faults(part, data[i], f"{at}.{i}")
    if isinstance(data, list) and "items" in node:
        for i, item in enumerate(data):
            yield from faults(node["items"], item, f"{at}.{i}")
    if isinstance(data, dict):
        properties = node.get("properties", {})
        for key, value in data.items():
            if key in properties:
                yield from faults(properties[key], value, f"{at}.{key}")
            elif node.get("additionalProperties") is False:
                yield f"{at}.{key} is unknown"
        yield from (f"{at}.{key} is absent" for key in set(node.get("required", ())) - set(data))


@pytest.mark.parametrize("name", sorted(shipped()))
def test_a_shipped_scenario_fits_the_exported_json_schema(name):
    assert [*faults(export(), tomllib.loads(shipped()[name]))] == []


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("dispaly", {}), ("sensor.treshold", "5 e"), ("duration", None), ("duration", 5),
        ("scene.kind", "fil"), ("sensor.chip", "spikethree"), ("tolerance", 2), ("seed", 1.5),
        ("image.at", [1, -2]), ("image.window", 0), ("scene", "film"), ("sensor.lens.psf", "x"),
    ],
)  # fmt: skip
def test_the_exported_json_schema_refuses_what_the_program_refuses(key, value):
    assert [*faults(export(), GOOD)] == []
    assert [*faults(export(), changed(key, value))] != []
    message(changed(key, value))


def test_the_json_schema_says_of_every_quantity_how_to_write_it():
    sensor = export()["$defs"]["SensorSection"]["properties"]
    assert sensor["clock"]["type"] == "string"
    assert sensor["clock"]["examples"] == ["40 kHz"]
    assert json.loads(json.dumps(export(), allow_nan=False)) == export()


def quantities(section: type[BaseModel]) -> Iterator[tuple[str, Any, Quantity]]:
    """Every quantity of a section and of those below it: name, field, what reads it."""
    for name, field in section.model_fields.items():
        pending: list[Any] = [*field.metadata, field.annotation]
        while pending:
            part = pending.pop()
            if isinstance(part, Quantity):
                yield f"{section.__name__}.{name}", field, part
            elif isinstance(part, type) and issubclass(part, BaseModel):
                yield from quantities(part)
            else:
                pending += [*get_args(part), *getattr(part, "__metadata__", ())]


EXAMPLES = {
    name: (field, reader)
    for whole in get_args(AnyScenario) for name, field, reader in quantities(whole)
}  # fmt: skip


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_of_a_key_is_one_that_the_key_takes_and_of_its_size(name):
    field, reader = EXAMPLES[name]
    section, _, key = name.rpartition(".")
    node = export()["$defs"][section]["properties"][key]
    alternatives = node.get("anyOf", [node])
    examples = node.get("examples") or alternatives[0].get("examples")
    if examples is None or not isinstance(examples[0], str):
        return  # a list of quantities
    value = reader.read(examples[0])  # within the key's limits
    default = field.default
    if reader.kind_name != "temperature" and isinstance(default, float) and default:
        assert 0.5 <= value / default <= 2


@pytest.mark.parametrize(
    ("name", "key", "example"),
    [
        ("light-link", "link.distance", "2 m"),
        ("light-link", "link.air.visibility", "5 km"),
        ("light-link", "link.panel.pitch", "500 um"),
        ("glass", "display.exposure", "1 ms"),
        ("film", "scene.frame_rate", "240 Hz"),
        ("ebaps-night", "imager.high_voltage", "-1500 V"),
    ],
)
def test_the_hint_is_a_value_for_that_key(name, key, example):
    with pytest.raises(InputError) as caught:
        load(name, [f"{key}=banana"])
    said = str(caught.value)
    assert f" such as '{example}'" in said
    assert said.endswith(f"not 'banana'; write --set {key}='{example}'")


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        (["sensor.pattern.hot_pixels=0.01"],
         "sensor.pattern.hot_current must be above 0 with hot_pixels = 0.01, which are those that "
         "have it, not 0 e/s; write --set sensor.pattern.hot_current='100000 e/s', or leave "
         "hot_pixels out"),
        (["sensor.pattern.dsnu=0.3"],
         "sensor.pattern.dark_current must be above 0 with dsnu = 0.3, which is a share of it, not "
         "0 e/s; write --set sensor.pattern.dark_current='100 e/s', or leave dsnu out"),
        (["sensor.pattern.dsnu=0.3", "sensor.pattern.dark_current=0 e/s", "sensor.preset=silicon"],
         "sensor.pattern.dark_current must be above 0 with dsnu = 0.3, which is a share of it, not "
         "0 e/s; write --set sensor.pattern.dark_current='100 e/s', or leave dsnu out"),
    ],
)  # fmt: skip
def test_a_key_of_the_device_that_would_do_nothing_is_refused(sets, said):
    with pytest.raises(InputError) as caught:
        load("film", sets)
    assert str(caught.value) == said


@pytest.mark.parametrize(
    ("name", "sets", "said"),
    [
        ("film", ["sensor.clock_steering=true"],
         "sensor.clock_steering must be absent with a [scene], which has no planes to lock to, not "
         "true; leave it out; that of a link's camera is link.sensor.clock_steering"),
        ("light-link", ["sensor.clock_steering=true", "sensor.chip=spikeone"],
         "sensor.clock_steering must be true only for a chip whose board can steer it (spiketwo), "
         "not true for spikeone; leave it out"),
    ],
)  # fmt: skip
def test_a_clock_that_cannot_be_steered_is_refused(name, sets, said):
    with pytest.raises(InputError) as caught:
        load(name, sets)
    assert str(caught.value) == said
    assert load("light-link", ["sensor.clock_steering=false"])[1].sensor.clock_steering is False


def test_an_example_of_a_list_is_written_as_the_command_line_reads_it() -> None:
    with pytest.raises(InputError) as caught:
        load("glass-over-light", ["link.aim.blocked=1"])
    assert str(caught.value).endswith("""; write --set link.aim.blocked='[["2 ms", "4 ms"]]'""")
    load("glass-over-light", ['link.aim.blocked=[["2 ms", "4 ms"]]'])


def test_the_preset_has_no_share_of_a_current_that_is_taken_out_of_it():
    none = ["sensor.pattern.dark_current=0 e/s", "sensor.pattern.warm_current=0 A"]
    _, loaded = load("film", ["sensor.preset=silicon", *none])
    pattern = loaded.sensor.pattern
    assert (pattern.dsnu, pattern.warm_pixels) == (0, 0) and pattern.prnu > 0
    _, loaded = load("film", ["sensor.preset=silicon"])
    assert loaded.sensor.pattern.dsnu > 0 and loaded.sensor.pattern.warm_pixels > 0


def quantity(unit: str, least: float, most: float) -> st.SearchStrategy[str]:
    return numbers(least, most).map(lambda x: f"{x!r} {unit}")


def numbers(least: float, most: float) -> st.SearchStrategy[float]:
    return st.floats(least, most).map(lambda x: x if x > 1e-20 else 0.0)


SCENES = st.one_of(
    st.fixed_dictionaries(
        {"kind": st.just("film"), "illuminance": quantity("klx", 1e-3, 1e5)},
        optional={
            "path": st.text(st.characters(codec="utf-8"), max_size=20),
            "start": quantity("min", 0, 60),
            "frame_rate": quantity("Hz", 1e-3, 1e5),
        },
    ),
    st.fixed_dictionaries(
        {"kind": st.just("star"), "illuminance": quantity("lux", 1, 1e6)},
        optional={"spokes": st.integers(2, 360), "rotation": quantity("1/s", 0, 1000)},
    ),
    st.fixed_dictionaries(
        {"kind": st.just("step"), "illuminance": quantity("lm/m^2", 1, 1e6)},
        optional={"before": numbers(0, 1), "at": quantity("us", 0, 1e6)},
    ),
)
SCENARIOS = st.fixed_dictionaries(
    {
        "title": st.text(st.characters(codec="utf-8"), max_size=30),
        "duration": quantity("ms", 1e-6, 1e6),
        "scene": SCENES,
        "sensor": st.fixed_dictionaries(
            {"threshold": quantity("e", 1, 2e6)},
            optional={
                "clock": quantity("MHz", 1e-6, 100),
                "wavelength": quantity("um", 0.38, 0.78),
                "lens": st.fixed_dictionaries({}, optional={"f_number": st.floats(0.5, 1000)}),
            },
        ),
    },
    optional={
        "tolerance": numbers(0, 1),
        "image": st.fixed_dictionaries({"at": st.lists(st.integers(0, 10**6), max_size=3)}),
    },
)


@given(SCENARIOS)
def test_a_scenario_written_as_toml_reads_back_the_same(data):
    scenario = validate(data)
    again = validate(tomllib.loads(to_toml(scenario)))
    assert again == scenario
    assert isinstance(again, Scenario)
    assert to_toml(again) == to_toml(scenario)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({}, "the scenario must be a title and sections such as [scene] and [sensor], not empty"),
        ({"kind": "film"}, "kind must be one of title, duration, "),
        ({"scene": {"kind": "filme"}}, "scene.kind must be one of 'film', "),
    ],
)
def test_what_is_wrong_is_said_before_what_is_missing(data: dict[str, Any], said: str) -> None:
    assert message(data).startswith(said)


def glass(**display: Any) -> dict[str, Any]:
    return {**GOOD, "display": display}


def test_a_viewing_distance_is_a_length_with_the_pitch() -> None:
    per_degree = validate(glass(pitch="250 um", distance="60 cm")).display.distance
    assert per_degree == pytest.approx(2 * 0.6 * math.tan(math.pi / 360) / 250e-6)
    assert validate(glass(distance=40)).display.distance == 40
    said = (
        "display.distance must be pixels per degree, or with display.pitch a length such as '60 cm'"
    )
    assert message(glass(distance="60 cm")).startswith(said)
    assert "display.distance must be at most 1000" in message(
        glass(pitch="250 um", distance="2 km")
    )


_NESTED = {
    "link.sensor": ("glass-over-light", []),
    "camera.sensor": ("glass", ["camera.kind=spikes"]),
}
"""Scenarios with a chip in another section than [sensor]."""


@pytest.mark.parametrize("path", _NESTED)
@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("pattern.dsnu=0.1", "{0}.pattern.dark_current must be above 0 with dsnu = 0.1, which is a "
         "share of it, not 0 e/s; write --set {0}.pattern.dark_current='100 e/s', or leave dsnu "
         "out"),
        ("row_time=100 ms", "{0}.clock must be at most 0.01 Hz for 1000 rows of 1e+08 ns to fit in "
         "a cycle, not 40000 Hz; lower it, or {0}.row_time"),
        ("duplicated_rows=[[0, 0]]", "{0}.duplicated_rows must be pairs"),
        ("preset=none.toml", "{0}.preset must be ideal, silicon, or a TOML file"),
    ],
)  # fmt: skip
def test_a_refusal_names_the_key_of_a_nested_section_as_it_was_written(path, key, said):
    scenario, sets = _NESTED[path]
    with pytest.raises(InputError) as refused:
        load(scenario, [*sets, f"{path}.threshold=1000 e", f"{path}.{key}"])
    assert str(refused.value).startswith(said.format(path))


def test_every_section_that_stands_in_several_places_is_placed():
    """Refusals of its own rules name one place: `placed` gives them the others."""
    places: dict[type[BaseModel], list[tuple[str, bool]]] = {}

    def walk(section: type[BaseModel], path: str, placed: bool) -> None:
        for name, field in section.model_fields.items():
            own = placed or any(isinstance(each, WrapValidator) for each in field.metadata)
            inside = own or any(
                "WrapValidator" in repr(each) for each in get_args(field.annotation)
            )
            for inner in _sections(field.annotation):
                places.setdefault(inner, []).append((f"{path}{name}", inside))
                walk(inner, f"{path}{name}.", inside)

    walk(Scenario, "", False)
    several = {one: found for one, found in places.items() if len({p for p, _ in found}) > 1}
    assert SensorSection in several
    for found in several.values():
        assert sum(not placed for _, placed in found) <= 1, found


def test_a_key_without_its_section_is_told_where_it_is():
    with pytest.raises(InputError, match=r"did you mean sensor\.width or display\.width\?$"):
        load("film", ["width=64"])
    with pytest.raises(InputError, match=r"did you mean scene\.illuminance\?$"):
        load("film", ["illuminance=64 lux"])
