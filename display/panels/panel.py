"""Parameters of the panels that convert a stream or a picture to light.

Radiance is relative: 1 is the white of the panel, with `luminance` cd/m2. A spike-continuous panel
has no frames: each pixel follows its own spikes, plane by plane of the stream.
"""

from __future__ import annotations

from dataclasses import dataclass

from cosim import PS, Clock
from display.drives import DRIVES, Drive


@dataclass(frozen=True)
class SpikePanel:
    """A panel that shows a stream of spikes without frames.

    Plane n is the cycle of the stream's clock in which the panel shows the spikes latched in cycle
    n. In each plane, a pixel is driven with x packets of light Q a cycle, the level of its drive.

    Attributes:
        shape: (height, width), pixels.
        clock: clock of the stream.
        white_rate: spike rate of white, spikes a cycle.
        drive: name of the drive in `DRIVES`.
        pulse: share of the cycle in which a drive of packets emits, at 1 / pulse times its level.
        rise, decay: time constants of the emitter, s: y' = (x - y) / rise for x > y, (x - y) /
            decay for x < y; 0 for none.
        row_scan: share of a cycle over which the rows are driven one after another: row r is
            delayed by row_scan r / height of a cycle.
        transport: delay from the latch of the stream to the first row of the panel, ps.
        fill: share of the pixel area that emits.
        luminance: luminance of white, mean over the pixel area, cd/m2.
    """

    shape: tuple[int, int]
    clock: Clock
    white_rate: float
    drive: str = "causal"
    pulse: float = 1.0
    rise: float = 0.0
    decay: float = 0.0
    row_scan: float = 1.0
    transport: int = 0
    fill: float = 1.0
    luminance: float = 300.0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("white_rate", 0.0, 1.0), ("pulse", 0.0, 1.0), ("fill", 0.0, 1.0),
        ):  # fmt: skip
            if not low < getattr(self, name) <= high:
                raise ValueError(
                    f"{name} must be above {low} and at most {high}, not {getattr(self, name)}"
                )
        if not 0 <= self.row_scan <= 1:
            raise ValueError(f"row_scan must be 0 to 1, not {self.row_scan}")
        if self.drive not in DRIVES:
            raise ValueError(f"drive must be one of {', '.join(DRIVES)}, not {self.drive}")
        if min(self.rise, self.decay, self.transport) < 0:
            raise ValueError("rise, decay and transport must not be negative")

    @property
    def scheme(self) -> Drive:
        """The drive."""
        return DRIVES[self.drive]

    @property
    def packets(self) -> bool:
        """Whether the light of a spike is a packet in its own plane."""
        return self.scheme.spikes == 0

    @property
    def share(self) -> float:
        """Share of a cycle in which a pixel is driven."""
        return self.pulse if self.packets else 1.0

    @property
    def row_delay(self) -> float:
        """Delay of the end of the row scan, ps: row r is delayed by r / height of it."""
        return self.row_scan * PS / self.clock.hz

    def start(self, plane: int) -> int:
        """Instant at which the first row starts to show plane `plane`, ps: a spike of cycle n is
        latched at the end of that cycle."""
        return self.clock.edge(plane + 1) + self.transport


@dataclass(frozen=True)
class FramePanel:
    """A display of frames. Frame k is the light at the instant k / rate.

    Attributes:
        rate: frame rate.
        persistence: share of the frame in which it is shown, at 1 / persistence times its level; 1
            for sample-and-hold.
        response: time constant of the pixels, s; 0 for ideal pixels.
        latency: delay from the instant of the light to the start of its frame, s.
    """

    rate: Clock
    persistence: float = 1.0
    response: float = 0.0
    latency: float = 0.0

    @property
    def name(self) -> str:
        return f"{self.rate.hz:g} Hz"


@dataclass(frozen=True)
class Projector:
    """A projector of binary planes: each pixel is on or off in a plane, and its error is carried to
    the next plane, so that planes average to grey (Lincoln et al., TVCG 22:1367, 2016, at 16 kHz).

    Attributes:
        rate: rate of the planes.
        latency: delay from the light to the plane that shows it, s (80 us from motion in that
            paper).
    """

    rate: Clock
    latency: float = 80e-6

    @property
    def name(self) -> str:
        return f"{self.rate.hz / 1000:g} kHz binary"


def metric_key(display: str) -> str:
    """The name of a display in names of metrics: "60hz" for "60 Hz", "projector" for "16 kHz
    binary"."""
    if display.endswith(" binary"):
        return "projector"
    return display.replace(" ", "").replace(".", "_").lower()
