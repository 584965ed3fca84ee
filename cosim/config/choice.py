"""A field whose value is a name of a catalogue."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from pydantic import GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticKnownError, core_schema


@dataclass(frozen=True)
class Choice:
    """Annotation of a text field. It is equivalent to `typing.Literal` of the names of a catalogue,
    but reads them when a value is checked, so the catalogue may grow after the schema exists.

    Attributes:
        names: names of the catalogue, or a dictionary by name.
    """

    names: Iterable[str]

    def read(self, value: object) -> str:
        """The name. Raises pydantic's literal_error for anything else."""
        names = list(self.names)
        if isinstance(value, str) and value in names:
            return value
        quoted = [repr(name) for name in names]
        expected = " or ".join(filter(None, [", ".join(quoted[:-1]), quoted[-1]]))
        raise PydanticKnownError("literal_error", {"expected": expected})

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.read)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"enum": list(self.names), "type": "string"}
