"""What a run needs to know of one kind of imager: how it is made, what it can meet, what is worth
saying of its frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from cosim.frames import Frame
from cosim.run.result import Latency, Metric
from rtl_model.imagers.imager import Imager
from rtl_model.imagers.run.view import View
from sensor.imagers import PixelModel

__all__ = ["Expected", "Machine", "Taken", "saturation", "take"]


@dataclass(frozen=True)
class Expected:
    """What a run is expected to meet, known before it: exposure of a pixel in lx s and the exposure
    time in s, least and most, and the number of frames."""

    lux_seconds: tuple[float, float]
    seconds: tuple[float, float]
    frames: int


@dataclass(frozen=True, eq=False)
class Taken:
    """What is kept of a frame once it is on disk. ready, begin, end: ps, of the last row's readout
    and of the first row's exposure. mean, noise: of all its values, DN. full: share of pixels at
    full scale. least, most: DN. shape: of its values."""

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
        """Exposure of the first row."""
        return (self.end - self.begin) * 1e-12


def take(frame: Frame) -> Taken:
    """The figures of a frame."""
    values: npt.NDArray[np.uint16] = frame.values
    return Taken(
        frame.number, frame.ready, int(frame.begin[0]), int(frame.end[0]), float(values.mean()),
        float(values.std()), float((values == frame.full_scale).mean()), int(values.min()),
        int(values.max()), (values.shape[0], values.shape[1]), dict(frame.state),
    )  # fmt: skip


def saturation(taken: Sequence[Taken]) -> dict[str, Metric]:
    """Share of a frame's pixels that read the largest value there is: of the last frame, and of the
    frame that has most."""
    return {
        "saturated": Metric(taken[-1].full, "1"),
        "saturated_most": Metric(max(t.full for t in taken), "1"),
    }


class Machine(Protocol):
    """One kind of imager as a scenario asks for it. shape: of its plane, which light falls on.
    registers: what its kind can be told, for messages."""

    @property
    def shape(self) -> tuple[int, int]: ...

    def make(self) -> Imager:
        """One that has just been switched on, with the scenario's register writes on their way.
        Raises InputError for a register that it has not."""
        ...

    def models(self, pixels: PixelModel) -> Sequence[PixelModel]:
        """The pixels in every setting that the run gives them: what one of these needs is kept."""
        ...

    def expected(self, view: View, stop: int) -> Expected: ...

    def metrics(self, taken: Sequence[Taken], view: View, imager: Any) -> dict[str, Metric]: ...

    def latency(self, taken: Sequence[Taken], view: View) -> list[Latency]: ...
