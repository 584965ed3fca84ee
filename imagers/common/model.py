"""An imager with the settings of a scenario: construction, foreseen exposures, metrics."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.frames import Frame
from cosim.run.result import Latency, Metric, latency_rows
from imagers.common.imager import Imager
from imagers.common.judge import Judge
from imagers.common.view import View
from sensor.frame_pixels import PixelModel

__all__ = [
    "ExposureRange",
    "FrameFigures",
    "ImagerModel",
    "measure_frame",
    "read_latency",
    "saturation",
]


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
        begin, end: of the first row's exposure, ps.
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
    """From an exposure's beginning to the last pixel of its frame; [] without frames."""
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
            bits: of a value.
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
            imager: that films.
            full, kept: names of all effects, and of those that the run keeps.
            seed: seed of the temporal noise.
        """
        return None
