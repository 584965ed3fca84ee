"""An imager as a scenario sets it: how it is built, what it may meet, what its frames say."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.frames import Frame
from cosim.run.result import Latency, Metric
from rtl_model.imagers.interface.imager import Imager
from rtl_model.imagers.interface.judge import Judge
from rtl_model.imagers.interface.view import View
from sensor.imagers import PixelModel

__all__ = ["ExposureRange", "FrameFigures", "ImagerModel", "measure_frame", "saturation"]


@dataclass(frozen=True)
class ExposureRange:
    """What a run may meet, known before it.

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
    """What stays in memory of a frame that is on disk.

    Attributes:
        number: of the frame.
        ready: end of the last row's readout, ps.
        begin, end: of the first row's exposure, ps.
        mean, spread: of all values, DN.
        full: share of pixels at full scale.
        least, most: values, DN.
        shape: rows and columns of values.
        state: figures of the imager's controllers.
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
        """Exposure time of the first row."""
        return (self.end - self.begin) * 1e-12


def measure_frame(frame: Frame) -> FrameFigures:
    """The figures of a frame."""
    values: npt.NDArray[np.uint16] = frame.values
    return FrameFigures(
        frame.number, frame.ready, int(frame.begin[0]), int(frame.end[0]), float(values.mean()),
        float(values.std()), float((values == frame.full_scale).mean()), int(values.min()),
        int(values.max()), (values.shape[0], values.shape[1]), dict(frame.state),
    )  # fmt: skip


def saturation(frames: Sequence[FrameFigures]) -> dict[str, Metric]:
    """Share of a frame's pixels at the largest value: of the last frame, and of the frame that has
    most."""
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
        """An imager that has just been switched on, the scenario's register writes on their way.
        Raises InputError for a register that it does not have."""

    @abstractmethod
    def exposures(self, view: View, stop: int) -> ExposureRange:
        """What the run may meet until `stop`, ps."""

    def settings(self, pixels: PixelModel) -> Sequence[PixelModel]:
        """The pixels in every setting of the run; an effect that one of them needs is kept."""
        return [pixels]

    def metrics(self, frames: Sequence[FrameFigures], view: View, imager: Any) -> dict[str, Metric]:
        """Figures of the run. imager: as it stands after the run."""
        return {}

    def latency(self, frames: Sequence[FrameFigures], view: View) -> list[Latency]:
        """Delays in the simulated imager."""
        return []

    def judge(
        self, imager: Any, full: frozenset[str], kept: frozenset[str], seed: int
    ) -> Judge | None:
        """The judge of the controller's decisions; None if no frame decides anything.

        Args:
            imager: that films.
            full, kept: all effects, and those that the run keeps.
            seed: of the temporal noise.
        """
        return None
