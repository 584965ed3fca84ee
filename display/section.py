"""The [display] section: the panel that shows the stream, what stands beside it, who looks."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cosim.config.quantity import Quantity, Section, Share, Time

__all__ = ["DRIVES", "OBSERVERS", "DisplaySection"]

DRIVES = ("impulse", "hold", "causal")
"""Those of the display, which need not be loaded to read a scenario."""

OBSERVERS = ("eye", "pursuit", "camera")
"""Who looks at a display."""
# The renderer keeps 1e-6 of white up to this.
Slow = Annotated[float, Quantity("time", least=0, most=0.01)]
FrameRate = Annotated[float, Quantity("frequency", least=1, most=20e3)]
PlaneRate = Annotated[float, Quantity("frequency", least=100, most=100e3, none=True)]
Size = Annotated[int, Field(ge=1, le=8192)]


class DisplaySection(Section):
    """A spike-continuous panel, the panels beside it, and their observer."""

    sink: str | None = Field(
        default=None,
        description="serial:PORT or serial:PORT,BAUD: a board shows the planes, and no light is "
        "rendered; PORT as in sensor.source",
    )
    drive: Literal[DRIVES] = Field(  # type: ignore[valid-type]
        default="causal", description="how a pixel makes light of its spikes"
    )
    observer: Literal[OBSERVERS] = Field(  # type: ignore[valid-type]
        default="eye", description="through whom the error is told"
    )
    width: Size | None = Field(default=None, description="of the panel; the stream's when absent")
    height: Size | None = Field(default=None, description="of the panel; the stream's when absent")
    fit: Literal["exact", "nearest", "centre"] = Field(
        default="exact",
        description="of a stream of another size: refused, each pixel shows the nearest one's "
        "spikes, or the middle is cut or framed by dark",
    )
    luminance: Annotated[float, Quantity("luminance", above=0, most=1e6)] = Field(
        default=300.0, description="of white"
    )
    pulse: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="share of a cycle in which impulse emits a packet"
    )
    rise: Slow = Field(default=0.0, examples=["1 us"], description="time constant of the emitter")
    decay: Slow = Field(default=0.0, examples=["1 us"], description="time constant of the emitter")
    row_scan: Share = Field(
        default=1.0, description="share of a cycle in which the rows are driven one after another"
    )
    transport: Time = Field(
        default=1e-6, examples=["1 us"], description="from the chip's output to the panel"
    )
    fill: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="share of a pixel's area that emits"
    )
    distance: Annotated[float, Field(ge=1, le=1000)] = Field(
        default=60.0, description="pixels to a degree of the eye's view"
    )
    pursuit: Annotated[float, Quantity("speed", least=-1e6, most=1e6)] | None = Field(
        default=None, description="of the pursuing eye along the rows; the scene's when absent"
    )
    exposure: Annotated[float, Quantity("time", above=0, most=86_400)] = Field(
        default=1e-3, examples=["1 ms"], description="of the camera that films the display"
    )
    beside: tuple[FrameRate, ...] = Field(
        default=(60.0, 120.0, 240.0, 1000.0), max_length=8, description="frame displays beside it"
    )
    persistence: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="share of a frame in which the frame displays emit"
    )
    response: Annotated[float, Quantity("time", least=0, most=1)] = Field(
        default=0.0, examples=["2 ms"], description="time constant of the frame displays' pixels"
    )
    projector: PlaneRate = Field(
        default=16e3,
        examples=["16 kHz"],
        description="binary planes a second of the projector beside it; none for no projector",
    )
    renderer: Literal["gl", "numpy"] = Field(
        default="gl", description="numpy: the golden model, exact and slow"
    )
