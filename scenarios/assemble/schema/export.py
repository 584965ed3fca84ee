"""The JSON Schema of scenarios."""

from __future__ import annotations

from contextlib import suppress
from functools import cache, reduce
from operator import or_
from typing import Any

from pydantic import BaseModel, TypeAdapter
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import SchemaError, SchemaSerializer

from cosim.config.quantity import Quantity
from cosim.config.units import readable_quantity
from scenarios.assemble.schema.scenario import KINDS, AnyScenario


class _AsWritten(GenerateJsonSchema):
    """A JSON Schema whose defaults are what a scenario would have: quantities as text."""

    def default_schema(self, schema: Any) -> dict[str, Any]:
        default = schema.get("default")
        if default is not None and not isinstance(default, BaseModel):
            with suppress(SchemaError):  # a reference to a section: its default is written already
                text = SchemaSerializer(schema["schema"]).to_python(default, mode="json")
                schema = {**schema, "default": text}
        node = super().default_schema(schema)
        if "quantity" in node and isinstance(node["default"], str):
            quantity = Quantity(node["quantity"]["kind"], none=node["quantity"]["none"])
            value = quantity.read(node["default"])
            if value or not quantity.none:
                node["default"] = readable_quantity(value, quantity.kind)
        return node


def export() -> dict[str, Any]:
    """The JSON Schema of all kinds of scenarios. A key that is a quantity has the entry `quantity`:
    its kind, its limits as text, and whether "none" is accepted."""
    return _export(tuple(kind.whole() for kind in KINDS))


@cache
def _export(kinds: tuple[type[AnyScenario], ...]) -> dict[str, Any]:
    whole: TypeAdapter[Any] = TypeAdapter(reduce(or_, kinds))
    return whole.json_schema(mode="validation", schema_generator=_AsWritten)
