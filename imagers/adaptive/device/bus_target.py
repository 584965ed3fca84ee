"""The sequencer with its registers under constant light, for a serial line; no pixels, no noise."""

from __future__ import annotations

from imagers.adaptive.device.controller import Controller
from imagers.adaptive.device.registers import DEFAULT_SHAPE
from imagers.adaptive.device.statistics import Statistics
from imagers.adaptive.device.timing import Timing
from imagers.adaptive.pixels import CmosSetting
from imagers.common.register_file import RegisterFile

__all__ = ["SteadySequencer", "bus_target"]


class SteadySequencer:
    """The sequencer; see `BusTarget`.

    Args:
        timing: timing of the array.
        lux: constant illuminance on every pixel.
        setting: setting of the signal chain; None for the default.
    """

    def __init__(self, timing: Timing, lux: float = 100.0, setting: CmosSetting | None = None):
        self._core = Controller(timing)
        self._lux, self._setting = lux, setting or CmosSetting()

    @property
    def registers(self) -> RegisterFile:
        return self._core.registers

    def advance(self, clock: int) -> None:
        """Runs all edges before a clock."""
        core = self._core
        if clock > 0:
            core.begin()
        while core.frame.start < clock:
            if core.opened is None:
                core.open()
            if core.frame.start + core.timing.deciding >= clock:
                return
            core.close(self._statistics())

    def reset(self, clock: int) -> None:
        """Restarts at a clock."""
        self._core.restart(clock)
        self._core.begin()

    def _statistics(self) -> Statistics:
        seconds = self._core.frame.exposure / self._core.timing.clock.hz
        value, saturated = self._setting.value(self._lux, seconds)
        opened = self._core.opened
        pixels = opened.window.size if opened is not None else 0
        if pixels == 0:
            return Statistics(0, None)
        return Statistics(pixels, None) if saturated else Statistics(0, value)


def bus_target() -> SteadySequencer:
    """The sensor of `viform board virtual`: 256 x 256 pixels (assumed) at 100 frames/s, 100 lx."""
    return SteadySequencer(Timing.of(*DEFAULT_SHAPE))
