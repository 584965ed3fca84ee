"""Keys of scenarios: all of them, with defaults that the schema itself accepts, and their page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from scenarios.assemble.schema.export import export
from scenarios.assemble.schema.keys import Key, keys, table
from scenarios.assemble.schema.scenario import KINDS
from tests.scenarios.assemble.schema.test_schema import faults

ROOT = Path(__file__).parents[4]
DEFAULTS = [
    (section, name, node)
    for section, schema in export()["$defs"].items()
    for name, node in schema.get("properties", {}).items()
    if "default" in node
]


@pytest.mark.parametrize(
    ("section", "name", "node"), DEFAULTS, ids=[f"{s}.{n}" for s, n, _ in DEFAULTS]
)
def test_a_default_is_what_a_scenario_could_have(section: str, name: str, node: Any) -> None:
    assert [*faults(node, node["default"])] == []


def sections(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [one for part in get_args(annotation) for one in sections(part)]


def names(model: type[BaseModel], at: str = "") -> set[str]:
    """Names of the keys of a model, from its fields."""
    found = set()
    for name, field in model.model_fields.items():
        inner, items = sections(field.annotation), "tuple" in str(field.annotation)
        found |= {at + name} if items or not inner else set()
        for section in inner:
            found |= names(section, f"{at}{name}{'[]' if items else ''}.")
    return found


def test_every_key_is_listed() -> None:
    assert {key.name for key in keys()} == set().union(*(names(kind.whole()) for kind in KINDS))


def key(name: str, kind: str | None = None) -> Key:
    (found,) = (k for k in keys() if k.name == name and (kind is None or kind in k.of))
    return found


def test_a_line_has_unit_default_and_range() -> None:
    assert str(key("link.distance")) == (
        "link.distance: a length such as '2 m', above 0 um, at most 100 km; default \"2 m\"; "
        "distance from the panel to the lens"
    )
    assert str(key("scene.at")) == (
        "scene.at (step): a time such as '32 ms', at least 0 s, at most 86.4 ks; "
        'default "32 ms"; instant of the step'
    )
    assert str(key("seed", "board")).endswith("default 1; seed of the captured image")
    assert key("sensor.threshold").default is None
    assert json.loads(key("display.projector").default or "") == "16 kHz"


def test_the_page_of_keys_is_generated() -> None:
    assert (ROOT / "docs" / "keys.md").read_text("utf-8") == table()
