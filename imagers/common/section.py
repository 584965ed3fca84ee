"""Base of the [imager] sections of a scenario; each kind of imager derives its section."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from cosim.config.quantity import Section, Time

__all__ = ["Device", "First", "ImagerLens", "ImagerSection", "Side", "Writes"]

Side = Annotated[int, Field(ge=1, le=4096)]
First = Annotated[int, Field(ge=0, le=4095)]
Device = Annotated[int, Field(ge=0, lt=2**32)]
Writes = Annotated[
    tuple[tuple[Time, str, Annotated[int, Field(ge=0, lt=2**32)]], ...],
    Field(
        max_length=1000,
        description='register writes over the serial line: ["5 ms", "register", value], the value '
        "in the register's own unit",
        examples=[[["5 ms", "exposure", 100]]],
    ),
]
"""(instant at which the write has arrived, register name, value) of each write."""


class ImagerLens(Section):
    """The ideal lens in front of an imager."""

    f_number: Annotated[float, Field(ge=0.5, le=1000)]
    transmission: Annotated[float, Field(gt=0, le=1)] = 0.9
    magnification: Annotated[float, Field(ge=0, le=100)] = 0.0


class ImagerSection(Section):
    """The [imager] section of every kind of imager.

    Attributes:
        kind: name of the imager in the catalogue.
    """

    kind: str
