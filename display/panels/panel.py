"""Panels: what turns a stream or a picture into light, as numbers.

Radiance is relative: 1 is the panel's white, `luminance` cd/m2 of it. A spike-continuous panel has
no frames: each pixel follows its own spikes, a plane of the stream after another.
"""

from __future__ import annotations

from dataclasses import dataclass

from cosim import PS, Clock
from display.drives import DRIVES, Drive

__all__ = ["FramePanel", "Projector", "SpikePanel", "metric_key"]


@dataclass(frozen=True)
class SpikePanel:
    """A panel that shows a spike stream without frames.

    In plane n (the cycle of the stream's clock in which the spike latched in cycle n is shown) a
    pixel is driven with x packets of light Q a cycle: the level of its drive.

    Attributes:
        shape: (height, width).
        clock: of the stream.
        white_rate: spikes a cycle shown as white.
        drive: name of the drive, of `DRIVES`.
        pulse: share of the cycle in which a drive of packets emits, at 1 / pulse times its level.
        rise, decay: s, time constants with which the emitter follows its drive,
            y' = (x - y) / rise while x > y, / decay while x < y; 0 follows at once.
        row_scan: share of a cycle over which the rows are driven one after another: row r starts
            row_scan r / height of a cycle late.
        transport: ps from the stream's latch to the panel's first row.
        fill: share of a pixel's area that emits.
        luminance: of white, cd/m2, mean over the pixel's area.
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
        """The drive itself."""
        return DRIVES[self.drive]

    @property
    def packets(self) -> bool:
        """Whether the light of a spike is a packet in its own plane."""
        return self.scheme.spikes == 0

    @property
    def share(self) -> float:
        """Share of a cycle in which the pixel is driven."""
        return self.pulse if self.packets else 1.0

    @property
    def row_delay(self) -> float:
        """Picoseconds by which the last row but one step is late: row r is r / height of it."""
        return self.row_scan * PS / self.clock.hz

    def start(self, plane: int) -> int:
        """Instant (ps) at which the first row begins to show plane `plane`: a spike of cycle n is
        latched at the end of that cycle."""
        return self.clock.edge(plane + 1) + self.transport


@dataclass(frozen=True)
class FramePanel:
    """A display of frames. Frame k is the light at instant k / rate, shown from `latency` seconds
    after it for `persistence` of the frame's time (1: a hold), at 1 / persistence times its level.

    Attributes:
        response: seconds, time constant of the pixels from one level to the next; 0 is ideal.
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
    """A projector of binary planes: each pixel is on or off for a plane, and its errors are carried
    on, so that planes add up to grey (as Lincoln et al., TVCG 22:1367, 2016, at 16 kHz).

    Attributes:
        latency: seconds from the light to the plane that shows it (80 us from motion there).
    """

    rate: Clock
    latency: float = 80e-6

    @property
    def name(self) -> str:
        return f"{self.rate.hz / 1000:g} kHz binary"


def metric_key(display: str) -> str:
    """A display's name within the name of a metric: "60 Hz" is 60hz, "16 kHz binary" projector."""
    if display.endswith(" binary"):
        return "projector"
    return display.replace(" ", "").replace(".", "_").lower()
