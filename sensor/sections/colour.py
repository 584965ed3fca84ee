"""[sensor.colour]: the filter array of a chip."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Quantity, Section


class ColourSection(Section):
    """Colour filters on the pixels. Neither chip has any: their curves are assumed."""

    filter: Literal["rggb", "bggr", "grbg", "gbrg"] = Field(
        default="rggb", description="colours of rows 0 and 1, columns 0 and 1"
    )
    depth: Annotated[float, Quantity("length", above=0, most=1000)] = Field(
        default=3.0,
        examples=["3 um"],
        description="depth of the silicon that collects charge; with its absorption it is the "
        "quantum efficiency by wavelength",
    )
