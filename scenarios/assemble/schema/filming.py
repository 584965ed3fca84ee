"""The section [camera]: what films the display."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Section, placed
from display.camera.section import FramesSection
from sensor.sections.sensor import SensorSection


class SpikesSection(Section):
    """A latched spike camera before the panel. Its lens is ideal: one of its pixels sees one pixel
    of the panel, whatever the size of the chip."""

    kind: Literal["spikes"]
    sensor: Annotated[SensorSection, placed("camera.sensor")] = Field(
        description="the chip; its lens is before the panel"
    )


CameraSection = Annotated[FramesSection | SpikesSection, Field(discriminator="kind")]
"""The section [camera], of either kind."""
