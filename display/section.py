"""The section [display]: the panel that shows the stream, the reference displays, the observer."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, ValidationInfo

from cosim import Clock, InputError, seconds_to_ps
from cosim.config.amounts import at_least
from cosim.config.quantity import Choice, Quantity, Section, Share
from cosim.spikes.viform import Words
from display.drives import DRIVES
from display.observe.observers import CameraPlane, FixedEye, PursuingEye
from display.observe.views import Observer
from display.panels.panel import FramePanel, Projector, SpikePanel, fit_words
from display.panels.tone import Law, Tone
from display.render.kinds import RendererKind
from display.setting import DisplaySetting

OBSERVERS = ("eye", "pursuit", "camera")
"""Names of the observers of a display."""
# The upper limit up to which the renderer is accurate to 1e-6 of white.
Slow = Annotated[float, Quantity("time", least=0, most=0.01)]
FrameRate = Annotated[float, Quantity("frequency", least=1, most=20e3)]
PlaneRate = Annotated[float, Quantity("frequency", least=100, most=100e3, none=True)]
SLOWEST = 100.0
"""Clock of a panel's planes at least, Hz: within a plane, the displays beside it show frames, and
cameras film them; up to 1000 for each plane of the fastest."""
PlaneClock = Annotated[float, Quantity("frequency", least=SLOWEST, most=1e6)]
Size = Annotated[int, Field(ge=1, le=8192)]


_LENGTH = Quantity("length", above=0, most=1e10)


def _per_degree(value: object, info: ValidationInfo) -> object:
    """Pixels per degree of a distance that is a length: 2 d tan(1/2 degree) / pitch."""
    if not isinstance(value, str) or not value.strip()[-1:].isalpha():  # no unit
        return value
    pitch = info.data.get("pitch")
    if pitch is None:
        raise ValueError(
            "must be pixels per degree, or with display.pitch a length such as '60 cm'"
        )
    return 2 * _LENGTH.read(value) * math.tan(math.radians(0.5)) / pitch


Distance = Annotated[
    float,
    Field(ge=1, le=1000),
    BeforeValidator(_per_degree, json_schema_input_type=float | Annotated[float, _LENGTH]),
]


def check_planes(hertz: float) -> None:
    """Raises InputError for a stream whose planes are too slow for a panel. hertz: its clock."""
    if hertz < SLOWEST:
        raise InputError(
            "sensor.clock", f"at least {SLOWEST:g} Hz with a display", f"{hertz:g} Hz",
            "raise it, or leave display out",
        )  # fmt: skip


class DisplaySection(Section):
    """A spike-continuous panel, the reference displays, and their observer."""

    sink: str | None = Field(
        default=None,
        description="serial:PORT[,BAUD] or udp:HOST[:PORT], as in sensor.source: a board displays "
        "the planes, and no light is rendered",
    )
    clock: PlaneClock | None = Field(
        default=None,
        examples=["40 kHz"],
        description="planes a second for the frames of an [imager], by default 40 kHz; a stream "
        "has a clock of its own",
    )
    drive: Annotated[str, Choice(DRIVES)] = Field(
        default="causal", description="rule by which a pixel converts its spikes to light"
    )
    observer: Literal[OBSERVERS] = Field(  # type: ignore[valid-type]
        default="eye", description="observer whose radiance the reported error refers to"
    )
    width: Size | None = Field(
        default=None, description="width of the panel; by default that of the stream"
    )
    height: Size | None = Field(
        default=None, description="height of the panel; by default that of the stream"
    )
    fit: Literal["exact", "nearest", "centre"] = Field(
        default="exact",
        description="treatment of a stream of another size: exact refuses it; nearest shows the "
        "spikes of the nearest pixel; centre crops it or adds a dark frame",
    )
    luminance: Annotated[float, Quantity("luminance", above=0, most=1e6)] = Field(
        default=300.0, description="luminance of white"
    )
    tone: Law = Field(
        default="none",
        description="law of tone mapping between the values of asynchronous or continuous pixels "
        "and the panel, for white of more than a spike a cycle; none refuses it",
    )
    peak: Annotated[float, Quantity("luminance", above=0, most=1e6)] | None = Field(
        default=None,
        examples=["1000 cd/m2"],
        description="luminance of a pixel that fires in every cycle, with tone; by default that of "
        "white",
    )
    tone_decades: Annotated[float, Field(gt=0, le=15)] = Field(
        default=8.0, description="decades of light below white that log and reinhard compress"
    )
    pulse: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="share of a cycle in which the impulse drive emits a packet"
    )
    rise: Slow = Field(
        default=0.0, examples=["1 us"], description="time constant of the emitter, rising"
    )
    decay: Slow = Field(
        default=0.0, examples=["1 us"], description="time constant of the emitter, falling"
    )
    row_scan: Share = Field(
        default=1.0, description="share of a cycle in which the rows are driven one after another"
    )
    transport: Annotated[float, Quantity("time", least=0, most=1.0)] = Field(
        default=1e-6,
        examples=["1 us"],
        description="delay from the output of the chip to the panel",
    )
    fill: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="share of a pixel's area that emits"
    )
    pitch: Annotated[float, Quantity("length", above=0, most=1e5)] | None = Field(
        default=None,
        examples=["250 um"],
        description="pitch of the panel's pixels, for a distance that is a length",
    )
    distance: Distance = Field(
        default=60.0,
        examples=[60.0],
        description="viewing distance: pixels per degree of visual angle, or a length with pitch",
    )
    pursuit: Annotated[float, Quantity("speed", least=-1e6, most=1e6)] | None = Field(
        default=None,
        description="speed of the pursuing eye along the rows; by default that of the scene",
    )
    exposure: Annotated[float, Quantity("time", above=0, most=86_400)] = Field(
        default=1e-3,
        examples=["1 ms"],
        description="exposure of the camera that records the display",
    )
    beside: tuple[FrameRate, ...] = Field(
        default=(60.0, 120.0, 240.0, 1000.0),
        max_length=8,
        examples=[["60 Hz", "120 Hz"]],
        description="frame rates of the reference displays",
    )
    persistence: Annotated[float, Field(gt=0, le=1)] = Field(
        default=1.0, description="share of a frame in which the frame displays emit"
    )
    response: Annotated[float, Quantity("time", least=0, most=1)] = Field(
        default=0.0,
        examples=["2 ms"],
        description="time constant of the pixels of the frame displays",
    )
    projector: PlaneRate = Field(
        default=16e3,
        examples=["16 kHz"],
        description="binary planes per second of the reference projector; none for no projector",
    )
    colour: Literal["as-camera", "matrix"] | None = Field(
        default=None,
        description="colour of the panel; as-camera: a pixel of the panel emits the colour of the "
        "camera's filter in its place (sensor.colour); matrix: every pixel emits three primaries, "
        "which a matrix mixes from the camera's colours; without it the panel has one colour",
    )
    renderer: RendererKind = Field(
        default="auto",
        description="gl: shaders; opencl: kernels, faster on a processor; auto: opencl if GL is "
        "software, else gl; numpy: the golden model, exact and slow",
    )

    @property
    def mapped(self) -> Tone | None:
        """The tone mapping; None without one. Raises InputError for keys that a law does not have,
        which would change nothing."""
        plain = type(self).model_fields["tone_decades"].default
        if self.tone_decades != plain and self.tone not in ("log", "reinhard"):
            raise InputError(
                "display.tone_decades", "given with display.tone = log or reinhard alone",
                f"{self.tone_decades:g}", "write --set display.tone=log, or leave it out",
            )  # fmt: skip
        if self.tone == "none":
            if self.peak is not None:
                raise InputError(
                    "display.peak", "given with display.tone alone", f"{self.peak:g} cd/m2",
                    "write --set display.tone=clip, or leave it out",
                )  # fmt: skip
            return None
        return Tone(self.tone, self.luminance, self.peak or self.luminance, self.tone_decades)

    def panel(
        self, stream: tuple[int, int], clock: Clock, row_skew: float, white_rate: float
    ) -> SpikePanel:
        """The spike-continuous panel that shows a stream.

        Args:
            stream: (height, width) of the stream.
            clock: clock of the stream.
            row_skew: share of a cycle over which the camera samples its rows.
            white_rate: spike rate of white, spikes a cycle.

        Raises:
            InputError: the panel does not fit the stream, or shows rows before they are sampled, or
                white is brighter than a spike a cycle.
        """
        if white_rate > 1:
            raise InputError(
                "white in front of a display", "at most a spike a cycle",
                f"{white_rate:.3g} spikes a cycle",
                "close the lens (sensor.lens.f_number), dim the scene or raise sensor.threshold",
            )  # fmt: skip
        tone = self.mapped
        luminance = self.luminance if tone is None else tone.white * tone.peak
        check_planes(clock.hz)
        shape = self.height or stream[0], self.width or stream[1]
        if self.fit == "exact" and shape != stream:
            raise InputError(
                "display.width and display.height",
                f"the stream's {stream[1]} x {stream[0]}",
                f"{shape[1]} x {shape[0]}",
                "leave them out"  # colours need a pixel for each of the camera
                + (", or set display.fit=nearest or centre" if self.colour is None else ""),
            )
        if self.row_scan < row_skew:
            raise InputError(
                "display.row_scan",
                f"at least sensor.row_skew, {at_least(row_skew)}",
                f"{self.row_scan:g}: rows would be shown before they are sampled",
                "raise it",
            )
        return SpikePanel(
            shape, clock, white_rate, self.drive, self.pulse, self.rise, self.decay, self.row_scan,
            seconds_to_ps(self.transport), self.fill, luminance,
        )  # fmt: skip

    def reference_panels(self) -> list[FramePanel | Projector]:
        """The frame displays and the projector with which the panel is compared."""
        panels: list[FramePanel | Projector] = [
            FramePanel(Clock.from_hz(rate), self.persistence, self.response) for rate in self.beside
        ]
        if self.projector > 0:
            panels.append(Projector(Clock.from_hz(self.projector)))
        return panels

    def observers(
        self, instants: Sequence[int], end: int, velocity: float
    ) -> dict[str, FixedEye | PursuingEye | CameraPlane]:
        """All observers by their names in the section.

        Args:
            instants: instants of the images, ps.
            end: end of the run, ps.
            velocity: velocity of the pursuing eye along the rows, pixels/s.
        """
        eye = FixedEye(tuple(instants), self.luminance, 0, end)
        return {
            "eye": eye,
            "pursuit": PursuingEye(eye, (0.0, velocity)),
            "camera": CameraPlane(tuple(instants), seconds_to_ps(self.exposure)),
        }

    def seen_by(
        self, names: Iterable[str], clock: Clock, instants: Sequence[int], cycles: int,
        velocity: float,
    ) -> dict[str, Observer]:  # fmt: skip
        """Observers by their names in the section, in its order, for a stream from cycle 0 on.

        Args:
            names: names of the observers.
            clock: clock of the stream.
            instants: cycles of the images.
            cycles: length of the stream.
            velocity: velocity of the pursuing eye along the rows, pixels/s.
        """
        at, asked = [clock.middle(n) for n in instants], set(names)
        known = self.observers(at, clock.edge(cycles), velocity)
        return {name: observer for name, observer in known.items() if name in asked}

    def on_panel(self, velocity: float, stream: tuple[int, int], panel: SpikePanel) -> float:
        """A velocity in pixels of the stream, (height, width), as one in pixels of the panel."""
        # If the panel shows the whole picture with other pixels, the speed in pixels differs.
        return velocity * (panel.shape[1] / stream[1] if self.fit == "nearest" else 1.0)

    def mapping(
        self, stream: tuple[int, int], panel: SpikePanel
    ) -> Callable[[Words], Words] | None:
        """Maps words of a stream, (height, width), to words of the panel; None for equal sizes."""
        return None if panel.shape == stream else fit_words(self.fit, stream, panel.shape)

    def setting(
        self, panel: SpikePanel, instants: Sequence[int], cycles: int, velocity: float = 0.0
    ) -> DisplaySetting:
        """The display with every effect, for the observer whose error is reported.

        The light ends with the last row of the last plane. If the response of the eye were cut off
        within a plane, this would count as an error of the spans of planes.

        Args:
            panel: result of the method `panel`.
            instants: cycles of the images.
            cycles: length of the run, cycles.
            velocity: velocity of the pursuing eye along the rows, pixels/s.
        """
        at = [panel.clock.middle(n) for n in instants]
        end = panel.start(cycles) + round(panel.row_delay)
        return DisplaySetting(panel, self.observers(at, end, velocity)[self.observer])
