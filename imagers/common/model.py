"""An imager with the settings of a scenario: construction, foreseen exposures, metrics.

`View` is the light on its plane, `Imager` the device itself: registers in, frames out. A `Judge`
knows its controller: the decision on a frame, whether the omitted effects could change it, and the
decision under full physics.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from cosim import InputError, seconds_to_ps
from cosim.errors import quote
from cosim.frames import Frame
from cosim.run.result import Latency, Metric, latency_rows
from imagers.common.scenery import Scenery
from sensor.frame_pixels import Exposed, PixelModel

Values = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class View:
    """A scene as the plane of an imager receives it.

    Attributes:
        scenery: the light.
        gain: illuminance on the plane for an exitance of 1 lux, lux.
        least, most: (H, W) limits of the illuminance on the plane during the run, lux, float64.
        certain: whether these limits are proven.
        chart: (H, W) reflectance of a static scene, float64; None for a moving one.
        notes: notes about the scene for the user.
        degraded: reasons for which the run does not show the scene as asked.
        chart_name: name of a computed chart; "" for any other scene.
        metrics: figures of the scene for the result.
    """

    scenery: Scenery
    gain: float
    least: Values
    most: Values
    certain: bool
    chart: Values | None
    notes: list[str] = field(default_factory=list)
    degraded: list[str] = field(default_factory=list)
    chart_name: str = ""
    metrics: dict[str, Metric] = field(default_factory=dict)


class Imager(Protocol):
    """A whole imager. Time is integer picoseconds from power-on.

    Attributes:
        name: name of its kind in the catalogue.
        pixels: the physics of its pixels.
    """

    name: str

    @property
    def pixels(self) -> PixelModel: ...

    def write(self, register: str, value: int, at: int | None = None) -> None:
        """Writes a register at an instant, ps; None for now. When the value takes effect depends on
        the register (`Design.updates`). Raises InputError, see `write_instant`."""
        ...

    def read(self, register: str) -> int:
        """The present value of a register."""
        ...

    def film(
        self, scene: Scenery, until: int, *, seed: int, kept: frozenset[str],
        trace: Path | None = None,
    ) -> Iterator[Frame]:  # fmt: skip
        """Yields the frames that are ready from now to the instant `until`.

        Args:
            scene: light on the plane.
            until: end, ps.
            seed: seed of the temporal noise.
            kept: names of the effects that are computed.
            trace: file for the signals of the sequencer during the first frames, .fst or .vcd.
        """
        ...


class Judge(Protocol):
    """Judges the decisions of one imager's controller, frame by frame."""

    def decides(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        """Whether a later exposure depends on this frame. Called for every frame."""
        ...

    def close(self, rows: Exposed, pixels: PixelModel, frame: Frame) -> bool:
        """Whether the omitted effects could move the statistic across a decision threshold."""
        ...

    def chosen(self, frame: Frame) -> int:
        """The exposure that the run has chosen."""
        ...

    def in_full(self, rows: Exposed, pixels: PixelModel) -> int:
        """The exposure that full physics chooses, from the same light and random numbers."""
        ...

    def exposure(self, frame: Frame) -> float:
        """The exposure of the frame itself, in the same unit."""
        ...


class JudgeBase:
    """Base of the judges.

    Args:
        imager: imager that films.
        full, kept: names of all effects, and of those that the run keeps.
        seed: seed of the temporal noise.
    """

    def __init__(self, imager: Any, full: frozenset[str], kept: frozenset[str], seed: int) -> None:
        self._imager, self._full, self._kept, self._seed = imager, full, kept, seed


def write_all(imager: Imager, writes: Sequence[tuple[float, str, int]]) -> None:
    """Schedules all writes before the imager films.

    Args:
        imager: imager at power-on.
        writes: (instant in s, register name, value) of each write.

    Raises InputError that names `imager.writes` for a write that the imager refuses: an unknown or
    read-only register, or a value that does not fit. (A serial line would drop or truncate such a
    write silently, because the hardware cannot refuse it.)
    """
    for n, (seconds, register, value) in enumerate(writes):
        try:
            imager.write(register, value, seconds_to_ps(seconds))
        except InputError as exc:
            which = "its register" if exc.what == "register" else f"{exc.what} to be"
            given = quote([f"{seconds:g} s", register, value])  # holds the register
            given += "" if exc.what == "register" else f" ({exc.actual})"
            raise InputError(
                f"imager.writes.{n}", f"a write that the imager takes, {which} {exc.must}",
                given, exc.remedy,
            ) from exc  # fmt: skip


@dataclass(frozen=True)
class ExposureRange:
    """Limits of the exposures of a run, known before it starts.

    Attributes:
        lux_seconds: least and largest exposure of a pixel, lx s.
        seconds: shortest and longest exposure time, s.
        frames: number of frames.
    """

    lux_seconds: tuple[float, float]
    seconds: tuple[float, float]
    frames: int


@dataclass(frozen=True, eq=False)
class FrameFigures:
    """The figures of a frame that stay in memory; its values are on disk.

    Attributes:
        number: frame number.
        ready: end of the last row's readout, ps.
        begin, end: begin and end of the first row's exposure, ps.
        mean, spread: mean and standard deviation of all values, DN.
        full: share of pixels at full scale.
        least, most: smallest and largest value, DN.
        shape: rows and columns of values.
        state: figures of the controllers, by name.
    """

    number: int
    ready: int
    begin: int
    end: int
    mean: float
    spread: float
    full: float
    least: int
    most: int
    shape: tuple[int, int]
    state: dict[str, float] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        """Exposure time of the first row, s."""
        return (self.end - self.begin) * 1e-12


def measure_frame(frame: Frame) -> FrameFigures:
    """The figures of a frame."""
    values: npt.NDArray[np.uint16] = frame.values
    return FrameFigures(
        frame.number, frame.ready, int(frame.begin[0]), int(frame.end[0]), float(values.mean()),
        float(values.std()), float((values == frame.full_scale).mean()), int(values.min()),
        int(values.max()), (values.shape[0], values.shape[1]), dict(frame.state),
    )  # fmt: skip


def read_latency(frames: Sequence[FrameFigures]) -> list[Latency]:
    """Time from an exposure's beginning to the last pixel of its frame; [] without frames."""
    spans = np.array([frame.ready - frame.begin for frame in frames], np.int64)
    return latency_rows("exposure's beginning to the frame read", spans)


def saturation(frames: Sequence[FrameFigures]) -> dict[str, Metric]:
    """Share of pixels at the largest value: in the last frame, and in the frame with the largest
    share."""
    return {
        "saturated": Metric(frames[-1].full, "1"),
        "saturated_most": Metric(max(frame.full for frame in frames), "1"),
    }


class ImagerModel(ABC):
    """One imager of a scenario.

    Attributes:
        shape: rows and columns of the plane that light falls on.
    """

    @property
    @abstractmethod
    def shape(self) -> tuple[int, int]: ...

    @abstractmethod
    def make(self) -> Imager:
        """The imager at power-on, with the register writes of the scenario scheduled. Raises
        InputError for a write that it refuses."""

    @abstractmethod
    def exposures(self, view: View, stop: int) -> ExposureRange:
        """Limits of the exposures until `stop`, ps."""

    def settings(self, pixels: PixelModel) -> Sequence[PixelModel]:
        """The pixels in every setting of the run. An effect is kept if one setting needs it."""
        return [pixels]

    def metrics(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> dict[str, Metric]:
        """Metrics of the run; `imager` has the state at its end."""
        return {}

    def latency(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> list[Latency]:
        """Latencies within the simulated imager; `imager` has the state at its end."""
        return []

    def faults(self, imager: Any) -> list[str]:
        """Why the imager at the end of a run has not done what its settings ask, a line each; they
        make the outcome "degraded"."""
        return []

    def notes(self, frames: Sequence[FrameFigures]) -> list[str]:
        """What the user should know of the frames of a run, a line each."""
        return []

    def picture(self, values: npt.NDArray[np.uint16], bits: int) -> npt.NDArray[np.uint8]:
        """The 8-bit picture of a frame, (H, W): linear, with full scale as white."""
        return np.rint(values / (((1 << bits) - 1) / 255)).astype(np.uint8)

    def levels(
        self, values: npt.NDArray[np.uint16], bits: int, white: float
    ) -> tuple[npt.NDArray[np.int64], int]:
        """Values in proportion to light, for a display that shows a frame, and the value that is
        white there: the digital numbers themselves, with full scale as white.

        Args:
            values: values of a frame, (rows, W), DN.
            bits: number of bits of a value.
            white: illuminance of the scene's white on the plane, lux.
        """
        return values.astype(np.int64), (1 << bits) - 1

    def first_row(self, state: Mapping[str, float]) -> int:
        """Row of the plane at which a frame with these figures of the controllers begins."""
        return 0

    def judge(
        self, imager: Any, full: frozenset[str], kept: frozenset[str], seed: int
    ) -> Judge | None:
        """The judge of the controller's decisions; None if no frame affects a later exposure.

        Args:
            imager: imager that films.
            full, kept: names of all effects, and of those that the run keeps.
            seed: seed of the temporal noise.
        """
        return None
