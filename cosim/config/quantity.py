"""Quantities as text with a unit, and the base of every section."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    field_validator,
)
from pydantic_core import CoreSchema, PydanticKnownError, core_schema

from cosim.config.units import (
    KINDS,
    Kind,
    format_quantity,
    parse_quantity,
    readable_quantity,
)
from cosim.errors import section_at

DAY = 86_400.0
"""Longest run in seconds (3.5e9 cycles at 40 kHz)."""
FASTEST = 1e9
"""Highest frequency of a clock, Hz."""
LEAST = 1e-30
"""Least size of a number that is not 0, in the unit of its key: below what any machine has, and far
from where a square or an inverse leaves the range of float64."""


def fits(number: float) -> bool:
    """Whether a number is 0 or of a size with which can be calculated."""
    return number == 0 or abs(number) >= LEAST


Reflectance = Annotated[float, Field(ge=0, le=1)]
Spread = Annotated[float, Field(ge=0, le=1)]
Share = Annotated[float, Field(ge=0, le=1)]


@dataclass(frozen=True)
class Quantity:
    """Annotation of a float field that is written as text with a unit.

    Attributes:
        kind_name: name of the kind of quantity, see `KINDS`.
        above: exclusive lower limit, None for none.
        least, most: inclusive limits, None for none.
        none: whether the text "none" is accepted as 0.
    """

    kind_name: str
    above: float | None = None
    least: float | None = None
    most: float | None = None
    none: bool = False

    @property
    def kind(self) -> Kind:
        """The kind of quantity."""
        return KINDS[self.kind_name]

    def read(self, value: object) -> float:
        """The number in the unit of the kind. Raises ValueError "must be ..." for any other
        value."""
        must, other = f"must be {self.kind}", ", or none" if self.none else ""
        if self.none and value == "none":
            return 0.0
        if not isinstance(value, str):
            raise ValueError(must + other)
        try:
            number = parse_quantity(value, self.kind)
        except ValueError:
            raise ValueError(must + other) from None
        for limit in (self.least, self.most):
            if limit is not None and math.isclose(number, limit, rel_tol=1e-12):
                number = limit  # 0.38 um is 380 nm up to rounding
        for word, limit, fine in (
            ("above", self.above, self.above is None or number > self.above),
            ("at least", self.least, self.least is None or number >= self.least),
            ("at most", self.most, self.most is None or number <= self.most),
        ):
            if not fine:
                raise ValueError(f"{must} and {word} {limit:g} {self.kind.unit}{other}")
        if not fits(number):
            least = f"of a size of {LEAST:g} {self.kind.unit} or more"
            raise ValueError(f"{must} and {least}{other}")
        return number

    def write(self, value: float) -> str:
        """Text from which `read` returns the same float."""
        return "none" if self.none and value == 0 else format_quantity(value, self.kind)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.read,
            serialization=core_schema.plain_serializer_function_ser_schema(self.write),
        )

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        limits = {"exclusiveMinimum": self.above, "minimum": self.least, "maximum": self.most}
        known = {
            word: readable_quantity(x, self.kind) for word, x in limits.items() if x is not None
        }
        return {
            "type": "string", "description": str(self.kind), "examples": [self.kind.example],
            "quantity": {"kind": self.kind_name, "none": self.none, **known},
        }  # fmt: skip


# The least threshold is an electron, and fixed point limits the highest. Outside the visible range,
# lux do not determine photons.
Time = Annotated[float, Quantity("time", least=0, most=DAY)]

Duration = Annotated[float, Quantity("time", above=0, most=DAY)]

Frequency = Annotated[float, Quantity("frequency", above=0, most=FASTEST)]

Illuminance = Annotated[float, Quantity("illuminance", above=0, most=1e9)]

Charge = Annotated[float, Quantity("charge", least=1, most=2e6)]

Wavelength = Annotated[float, Quantity("wavelength", least=380, most=780)]

Noise = Annotated[float, Quantity("charge", least=0, most=30_000)]

Capacitance = Annotated[float, Quantity("capacitance", above=0, most=1e6)]

Current = Annotated[float, Quantity("current", least=0, most=1e12)]

Temperature = Annotated[float, Quantity("temperature", least=-150, most=150)]


def placed(path: str, home: str = "sensor") -> WrapValidator:
    """Annotation of a field with a section whose refusals name it at `home`: they name `path`."""

    def read(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        with section_at(path, home):
            return handler(value)

    return WrapValidator(read)


class Section(BaseModel):
    """Base of all sections."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*")
    @classmethod
    def _fits(cls, value: Any) -> Any:
        if isinstance(value, float) and not fits(value):
            raise ValueError(f"must be of a size of {LEAST:g} or more")
        return value


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
