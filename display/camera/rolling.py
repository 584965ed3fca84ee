"""The timing of a rolling shutter before a panel, and the weights with which it integrates light.

Row r of h rows of frame k is exposed from b + k / rate + r / h readout on, for the exposure; b is
the instant of the panel's first light. Within a plane the light of a panel counts as uniform, as
for all observers, so the weight of a plane in an exposure is their overlap over the exposure.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from cosim import PS, Clock, InputError, seconds_to_ps
from cosim.config.amounts import at_least, at_most
from display.camera.section import FramesSection
from display.panels.panel import SpikePanel

Values = npt.NDArray[np.float64]
Instants = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Shutter:
    """A rolling shutter before a panel.

    Attributes:
        panel: the panel.
        planes: number of planes that the panel shows.
        shape: (rows, columns) of the camera.
        rate: frame rate.
        exposure, readout: ps.
    """

    panel: SpikePanel
    planes: int
    shape: tuple[int, int]
    rate: Clock
    exposure: int
    readout: int

    @property
    def box(self) -> tuple[int, int]:
        """Rows and columns of the panel that a pixel of the camera sees."""
        return self.panel.shape[0] // self.shape[0], self.panel.shape[1] // self.shape[1]

    @cached_property
    def light(self) -> tuple[int, int]:
        """Beginning and end of the light of the panel's first row, ps."""
        return self.panel.start(0), self.panel.start(self.planes)

    @property
    def longest(self) -> int:
        """Time from the first row's beginning to the last row's end, ps."""
        rows = self.shape[0]
        return (rows - 1) * self.readout // rows + self.exposure

    @cached_property
    def frames(self) -> int:
        """Number of frames that are complete within the light."""
        room = self.light[1] - self.light[0] - self.longest
        return 0 if room < 0 else self.rate.cycle_at(room) + 1

    def begin(self, frame: int) -> int:
        """Instant at which the first row of a frame begins, ps."""
        return self.light[0] + self.rate.edge(frame)

    def rows(self, frame: int) -> Instants:
        """Instants at which the exposure of each row of the panel begins, ps, (H,) int64: rows
        within a box begin together."""
        row = np.arange(self.panel.shape[0], dtype=np.int64) // self.box[0]
        return self.begin(frame) + row * self.readout // self.shape[0]

    def span(self, frame: int) -> tuple[int, int]:
        """Beginning and end of all light that may count for a frame, ps: its exposures, and the
        periods of a frame around them. Within the last period of the light, all of it."""
        period = round(PS / self.rate.hz)
        begin, end = self.begin(frame) - period, self.begin(frame) + self.longest + period
        return min(begin, self.light[1] - period), max(end, self.light[0] + 2 * period)

    def exposed(self, frame: int, first: int, planes: int) -> Values:
        """The weights of planes in the exposures of a frame, (H, planes); over all planes those of
        a row add up to 1."""
        begin = self.rows(frame)
        return self._overlap(begin, begin + self.exposure, first, planes) / self.exposure

    def around(self, frame: int, first: int, planes: int) -> Values:
        """The same for the period of a frame around the middle of each exposure, moved as far as
        the light of the panel makes it necessary."""
        delay = self._delay().astype(np.int64)
        period = min(round(PS / self.rate.hz), self.light[1] - self.light[0])
        middle = self.rows(frame) + self.exposure // 2
        begin = np.clip(middle - period // 2, self.light[0] + delay, self.light[1] + delay - period)
        end = begin + period
        return self._overlap(begin, end, first, planes) / (end - begin)[:, None]

    def _delay(self) -> Values:
        """Delay of each row of the panel, ps, (H,)."""
        rows = self.panel.shape[0]
        return np.floor(np.arange(rows) * self.panel.row_delay / rows)

    def _overlap(self, begin: Instants, end: Instants, first: int, planes: int) -> Values:
        """Time in ps that each plane of each row shares with begin to end, (H, planes)."""
        edges = np.array([self.panel.start(n) for n in range(first, first + planes + 1)], np.int64)
        at = edges + self._delay().astype(np.int64)[:, None]
        shared = np.minimum(at[:, 1:], end[:, None]) - np.maximum(at[:, :-1], begin[:, None])
        return np.maximum(shared, 0).astype(np.float64)


def make_shutter(
    section: FramesSection, panel: SpikePanel, planes: int, recorded: bool = False
) -> Shutter:
    """The shutter of a section [camera].

    Args:
        section: the section.
        panel: panel that is filmed.
        planes: number of planes that the panel shows.
        recorded: whether they are a recording, which cannot be lengthened.

    Raises:
        InputError: a size does not divide that of the panel, or no frame fits into the light.
    """
    shape = section.height or panel.shape[0], section.width or panel.shape[1]
    for name, mine, whole in zip(("height", "width"), shape, panel.shape, strict=True):
        if whole % mine:
            raise InputError(
                f"camera.{name}",
                f"a divisor of the panel's {whole}",
                str(mine),
                f"write {max(n for n in range(1, min(mine, whole) + 1) if whole % n == 0)}",
            )
    shutter = Shutter(
        panel, planes, shape, Clock.from_hz(section.frame_rate), seconds_to_ps(section.exposure),
        seconds_to_ps(section.readout),
    )  # fmt: skip
    if not shutter.frames:
        has = shutter.light[1] - shutter.light[0]
        if recorded:
            late = shutter.longest - shutter.exposure
            key, most = ("exposure", has - late) if late < has else ("readout", has // 2)
            raise InputError(
                f"camera.{key}", f"at most {at_most(most / 1e9)} ms with "
                f"{has / 1e9:.4g} ms of the recording, for a frame of the camera",
                f"{getattr(shutter, key) / 1e9:.4g} ms", "shorten it, or show more of it",
            )  # fmt: skip
        whole = panel.clock.cycle_at(shutter.longest - 1) + 1  # a run has whole planes
        need = panel.clock.edge(whole)
        raise InputError(
            "duration", f"at least {at_least(need / 1e9)} ms, a frame of the camera",
            f"{has / 1e9:.4g} ms", "lengthen it, or shorten camera.exposure and camera.readout",
        )  # fmt: skip
    return shutter
