"""Parameters of the panels that convert a stream or a picture to light.

Radiance is relative: 1 is the white of the panel, with `luminance` cd/m2. A spike-continuous panel
has no frames: each pixel follows its own spikes, plane by plane of the stream, which may have
another size than the panel. Its emitters may relax within a part of a plane.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from cosim import PS, Clock
from display.drives import DRIVES, Drive

Words = npt.NDArray[np.uint32]
LEVELS = 2**31 - 256
"""Number of steps of a stored level, whose maximum is 1 / pulse packets a cycle. An integer sums
changes that a float32 level would lose. With a time constant of n cycles, a level settles within n
/ 2 steps of its drive: the error is below 1e-6 of white up to 10 ms at any white rate above
0.05."""
Fit = Literal["exact", "nearest", "centre"]


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
        dark: planes from which on an interval is dark current's: a pixel is dark from then on, and
            the interval gives no rate. 0 for none. With packets, the spike is left out of the
            stream.
        residues: whether planes of charges come beside the spikes: a packet is then what they have
            not shown of it.
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
    dark: int = 0
    residues: bool = False

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
        drive = DRIVES[self.drive]
        return drive.residue or drive if self.residues else drive

    @property
    def packets(self) -> bool:
        """Whether the light of a spike is a packet in its own plane."""
        return DRIVES[self.drive].spikes == 0

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


def fit_words(
    fit: Fit, stream: tuple[int, int], panel: tuple[int, int]
) -> Callable[[Words], Words]:
    """The function from words of a stream, (words, *stream) uint32, to words of a panel, (words,
    *panel). For equal sizes it returns its argument.

    Args:
        fit: "exact" requires equal sizes; "nearest" shows the spikes of the nearest pixel of the
            stream; "centre" crops the stream or adds a dark frame.
        stream, panel: (height, width), pixels.

    Raises:
        ValueError: `fit` is "exact" and the sizes differ.
    """
    if stream == panel:
        return lambda words: words
    if fit == "exact":
        raise ValueError(f"the panel must be of the stream's {stream} pixels, not {panel}")
    if fit == "nearest":
        rows, columns = (_nearest(*sizes) for sizes in zip(panel, stream, strict=True))

        def nearest(words: Words) -> Words:
            return np.ascontiguousarray(words[:, rows[:, None], columns])

        return nearest
    (on_y, of_y), (on_x, of_x) = (_centred(*s) for s in zip(panel, stream, strict=True))

    def centre(words: Words) -> Words:
        if (on_y, on_x) == (slice(0, panel[0]), slice(0, panel[1])):
            return np.ascontiguousarray(words[:, of_y, of_x])
        framed = np.zeros((len(words), *panel), np.uint32)
        framed[:, on_y, on_x] = words[:, of_y, of_x]
        return framed

    return centre


def _nearest(panel: int, stream: int) -> npt.NDArray[np.intp]:
    """For each panel pixel, the pixel of the stream that contains its centre; both cover the same
    picture."""
    return ((2 * np.arange(panel) + 1) * stream // (2 * panel)).astype(np.intp)


def _centred(panel: int, stream: int) -> tuple[slice, slice]:
    """The part of the panel that shows the centre of the stream, and that part of the stream; an
    odd remainder is at the right and at the bottom."""
    size = min(panel, stream)
    on, of = (panel - size) // 2, (stream - size) // 2
    return slice(on, on + size), slice(of, of + size)


def slow(panel: SpikePanel) -> bool:
    """Whether the emitter has a time constant."""
    return panel.rise > 0 or panel.decay > 0


def relaxation(constant: float, share: float, panel: SpikePanel) -> tuple[float, float, float]:
    """The coefficients (a, b, c) of a part of a plane under constant drive x, from the level y: the
    light is a x + b y, packets, and the level changes by c (x - y).

    y' = (x - y) / T, in cycles, gives b = T (1 - e^(-share / T)), a = share - b, c = b / T.

    Args:
        constant: time constant of the emitter, s.
        share: length of the part, planes.
        panel: the panel, for its clock.
    """
    if constant == 0:
        return share, 0.0, 1.0
    planes = constant * panel.clock.hz
    gone = -math.expm1(-share / planes)
    return share - planes * gone, planes * gone, gone
