"""The [link] section: a file, the panel that sends it, the air, and what receives it."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from cosim import InputError
from cosim.config.quantity import Duration, Quantity, Reflectance, Section, Share, Time, placed
from link.detect.catalogue import DETECTORS
from link.mode import CELLS, CODES, LINE_CODES, PARITIES, RATES, TICKS
from sensor.sections.readout import ReadoutSection
from sensor.sections.sensor import SensorSection

Slow = Annotated[float, Quantity("time", least=0, most=0.01)]
Metres = Annotated[float, Quantity("length", above=0, most=1e11)]  # in um, as lengths are
Sides = Annotated[int, Field(ge=128, le=4640, multiple_of=32)]


class PanelSection(Section):
    """The panel that sends."""

    width: Sides = 960
    height: Sides = 960
    pitch: Metres = Field(
        default=500.0, examples=["500 um"], description="pitch of the panel's pixels"
    )
    luminance: Annotated[float, Quantity("luminance", above=0, most=1e6)] = Field(
        default=1000.0, examples=["1000 cd/m²"], description="luminance of a pixel that is on"
    )
    reflectance: Reflectance = Field(default=0.04, description="reflectance of the panel's face")
    rise: Slow = Field(default=0.0, examples=["1 us"], description="time constant of the emitter")
    decay: Slow = Field(default=0.0, examples=["1 us"], description="time constant of the emitter")
    row_scan: Share | None = Field(
        default=None,
        description="share of a tick over which its rows are driven one after another; in step "
        "with sensor.row_skew when absent",
    )
    clock_offset: Annotated[float, Field(ge=-1e5, le=1e5)] = Field(
        default=20.0,
        description="offset of the panel's clock against the camera's, parts per million",
    )
    phase: Share | None = Field(
        default=None, description="ticks by which its planes are late; by chance when absent"
    )
    fill: Annotated[float, Field(gt=0, le=1)] = 1.0


class AimSection(Section):
    """How the panel stands in the camera's view, and its lens."""

    focal_length: Metres = Field(
        default=39_000.0, examples=["39 mm"], description="focal length of the camera's lens"
    )
    on_level: Annotated[float, Field(gt=0, le=1000)] = Field(
        default=1.4,
        description="thresholds that a cell that is on brings in a tick; sets the f-number",
    )
    f_number: Annotated[float, Field(ge=0.5, le=1000)] | None = Field(
        default=None, description="chosen by on_level when absent"
    )
    focus: Metres | None = Field(
        default=None,
        examples=["2 m"],
        description="distance the lens is focused at; the panel's when absent",
    )
    blur: Annotated[float, Field(ge=0, le=100)] = Field(
        default=0.3, description="blur of the lens, standard deviation in camera pixels"
    )
    offset_x: Annotated[float, Field(ge=-1e5, le=1e5)] = Field(
        default=3.3, description="offset of the panel's centre from the sensor's, camera pixels"
    )
    offset_y: Annotated[float, Field(ge=-1e5, le=1e5)] = -2.6
    rotation: Annotated[float, Quantity("angle", least=-180, most=180)] = Field(
        default=0.3, examples=["0.3 deg"]
    )
    tilt_x: Annotated[float, Quantity("angle", least=-80, most=80)] = Field(
        default=0.5, examples=["0.5 deg"], description="tilt of the panel about its vertical"
    )
    tilt_y: Annotated[float, Quantity("angle", least=-80, most=80)] = Field(
        default=-0.4, examples=["-0.4 deg"], description="tilt of the panel about its horizontal"
    )
    vibration: Annotated[float, Field(ge=0, le=100)] = Field(
        default=0.05, description="standard deviation of the image's shift, camera pixels"
    )
    vibration_frequency: Annotated[float, Quantity("frequency", above=0, most=1e5)] = Field(
        default=30.0, examples=["30 Hz"]
    )
    occluded: Share = Field(default=0.0, description="share of the panel, from its left, hidden")
    blocked: tuple[tuple[Time, Time], ...] = Field(
        default=(),
        max_length=100,
        examples=[[["2 ms", "4 ms"]]],
        description="spans in which the whole panel is hidden, from the start of the stream, or of "
        "the link that sends a file",
    )

    @field_validator("blocked")
    @classmethod
    def _in_order(cls, spans: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        edges = [edge for span in spans for edge in span]
        if any(one >= two for one, two in pairwise(edges)):
            raise ValueError("must be spans [start, stop] in order, that do not overlap")
        return spans


class AirSection(Section):
    """What lies between panel and camera, and the light that is not the panel's."""

    ambient: Annotated[float, Quantity("illuminance", least=0, most=1e6)] = Field(
        default=500.0, examples=["500 lux"], description="falls on the panel and its surroundings"
    )
    surroundings: Reflectance = Field(default=0.18, description="reflectance around the panel")
    visibility: Metres | None = Field(
        default=None, examples=["5 km"], description="clear air when absent"
    )
    particles: Literal["kim", "kruse"] = Field(default="kim", description="law of extinction")
    structure: Annotated[float, Field(ge=0, le=1e-9)] = Field(
        default=1e-14, description="structure parameter of the refractive index, Cn2 in m^(-2/3)"
    )
    wind: Annotated[float, Field(ge=0, le=200)] = Field(
        default=1.0, description="speed of the wind across the path, m/s"
    )
    sun: Annotated[float, Quantity("illuminance", least=0, most=2e5)] = Field(
        default=0.0,
        examples=["100 klux"],
        description="illuminance of a sun near the view, on a plane that faces it",
    )
    sun_angle: Annotated[float, Quantity("angle", least=-90, most=90)] = Field(
        default=10.0,
        examples=["10 deg"],
        description="angle between the sun and the panel's centre",
    )
    glare: Share = Field(default=0.005, description="share of the lens's light spread everywhere")


class ModemSection(Section):
    """How bytes become planes. `auto` is chosen from a pilot."""

    cell: Literal[("auto", *CELLS)] = Field(  # type: ignore[valid-type]
        default="auto", description="panel pixels to a cell's side"
    )
    ticks: Literal[("auto", *TICKS)] = Field(  # type: ignore[valid-type]
        default="auto", description="panel planes to a symbol"
    )
    line: Literal[("auto", *LINE_CODES)] = Field(  # type: ignore[valid-type]
        default="auto", description="code along time; scrambled symbols have none"
    )
    code: Literal[("auto", *CODES)] = Field(  # type: ignore[valid-type]
        default="auto",
        description="code of the words; ldpc decides softly and needs scrambled symbols",
    )
    parity: Literal[("auto", *PARITIES)] = Field(  # type: ignore[valid-type]
        default="auto", description="bytes of a Reed-Solomon codeword of 255 that are parity"
    )
    rate: Literal[("auto", "adaptive", *RATES)] = Field(  # type: ignore[valid-type]
        default="auto",
        description="rate of the ldpc code, data bits to a bit sent; adaptive: of each block its "
        "own, by the phase of the clocks, only where the link sends a file",
    )
    interleave: bool = Field(default=True, description="spread each codeword over the panel")
    overhead: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.05, description="frames sent beyond the file's own, as a share of them"
    )
    detector: Literal[tuple(DETECTORS)] = "packed"  # type: ignore[valid-type]

    @field_validator("detector", mode="before")
    @classmethod
    def _known(cls, value: Any) -> Any:
        """Refuses a detector of earlier versions, with what takes its place."""
        if value == "belief-propagation":
            raise InputError(
                "link.modem.detector", "one of " + ", ".join(DETECTORS), value,
                "write packed: belief propagation is a reference of the tests alone",
            )  # fmt: skip
        return value

    @field_validator("cell", "ticks", "parity", mode="before")
    @classmethod
    def _number(cls, value: Any) -> Any:
        """`--set` gives text, which stands for a number here as it does in a plain one."""
        return int(value) if isinstance(value, str) and value.isdecimal() else value

    @field_validator("rate", mode="before")
    @classmethod
    def _share(cls, value: Any) -> Any:
        """The same for a number with a point."""
        try:
            return float(value) if isinstance(value, str) else value
        except ValueError:
            return value

    @model_validator(mode="after")
    def _has_one_code(self) -> ModemSection:
        soft = self.code == "ldpc" or self.rate != "auto"
        if soft and (self.code == "reed-solomon" or self.parity != "auto"):
            raise InputError(
                "link.modem", "one code of the words",
                f"code = {self.code}, parity = {self.parity}, rate = {self.rate}",
                "give parity for reed-solomon or rate for ldpc, not both",
            )  # fmt: skip
        if soft and self.line not in ("auto", "scrambled"):
            raise InputError(
                "link.modem.line", "scrambled with ldpc, which reads bits", self.line,
                "leave it out, or take reed-solomon",
            )  # fmt: skip
        return self


class LinkSection(Section):
    """A file crosses the room as light."""

    file: str | None = Field(default=None, description="random bytes when absent")
    size: Annotated[int, Field(ge=1, le=1_000_000_000)] = Field(
        default=4_000_000, description="size of the random bytes"
    )
    join: Time = Field(
        default=0.0,
        examples=["3 ms"],
        description="time from the start of the stream until the receiver begins to listen; only "
        "where the link carries one",
    )
    distance: Metres = Field(
        default=2e6, examples=["2 m"], description="distance from the panel to the lens"
    )
    sensor: Annotated[SensorSection | None, placed("link.sensor")] = Field(
        default=None,
        description="camera of a link that carries a stream; when absent, the chip of [sensor] "
        "with a hard reset, or a spiketwo for a source without a chip",
    )
    loop: str | None = Field(
        default=None,
        description="serial:PORT[,BAUD] or udp:HOST[:PORT], as in sensor.source: the panel's "
        "planes go through a board's display and must come back bit for bit",
    )
    panel: PanelSection = PanelSection()
    aim: AimSection = AimSection()
    air: AirSection = AirSection()
    modem: ModemSection = ModemSection()


class LinkScenario(Section):
    """A file crosses a link: no scene but the panel's."""

    title: str = Field(examples=["A file over light"])
    duration: Duration | None = Field(
        default=None, description="duration of light; as long as the file takes when absent"
    )
    tolerance: Annotated[float, Field(ge=0, le=1)] = 1e-3
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 1
    link: LinkSection
    sensor: SensorSection
    readout: ReadoutSection | None = Field(
        default=None,
        description="the digital readout of the chip to its host; without one, every plane arrives",
    )

    @model_validator(mode="after")
    def _has_one_camera(self) -> LinkScenario:
        if self.link.join:
            raise InputError(
                "link.join", "absent without a [scene]", f"{self.link.join:g} s",
                "leave it out: a file needs its whole transmission",
            )  # fmt: skip
        if self.link.sensor is not None:
            raise InputError(
                "link.sensor", "absent without a [scene]", "given",
                "give [sensor]: it is the camera of a link that sends a file",
            )  # fmt: skip
        return self
