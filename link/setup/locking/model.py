"""Windows of a panel before a camera, at a given phase of its planes: what the loop's model films.

A strip of the panel goes through the same air and camera code as the run, as the pilots of a mode
do (`setup.pilot`). Its image does not shake, since a receiver follows it by the tags.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import PS, Block, Clock
from cosim.compute.opencl import Device
from cosim.spikes.viform import WORD, Viform
from link.line_codes import encode_line
from link.mode import Mode
from link.receiving.recording import Recording
from link.receiving.steering import centred
from link.sending import FileTransmission
from link.setting import LinkSetting
from link.setup.pilot import WIDTH, strip_of
from link.setup.truth import true_timing
from link.timing import Timing
from sensor import SpikeCamera

BEFORE: Final = 3
"""Dark ticks of the model before a window."""
_LEAST_COLUMNS: Final = 32
"""Columns of cells of the model's strip, at least."""
_DIGITS: Final = 10**12
"""Denominator of the ratio of two clocks."""
_WEYL: Final = 0x9E3779B1
"""Odd number nearest to 2^32 over the golden ratio: seeds of windows are multiples of it."""


class _Shown(FileTransmission):
    """A transmission of given bits: the training, or data of the mode's line code."""

    def __init__(self, mode: Mode, shown: npt.NDArray[np.bool_]) -> None:
        super().__init__(mode, b"0", "window")
        self._shown, self.symbols = shown, len(shown)

    def bits(self, first: int, count: int) -> npt.NDArray[np.bool_]:
        return self._shown[first : first + count]


class PhaseModel:
    """Windows of a strip of the panel.

    Args:
        setting: the link, with its own clocks.
        mode: mode of the transmission.
        device: OpenCL device, None for numba.

    Attributes:
        strip: the link of the strip.
        mode, layout: mode and layout of the strip.
        registration: registration of the strip in the image.
        slope, rows: slope and rows of the true timing in the image.
        middle: instant at which the middle row receives plane 0, ps.
        period: nominal length of a tick, ps.

    Raises:
        ValueError: if the strip has no room for a frame.
    """

    def __init__(self, setting: LinkSetting, mode: Mode, device: Device | None) -> None:
        width = min(max(WIDTH, _LEAST_COLUMNS * mode.cell), setting.optics.width)
        strip = strip_of(setting, width)
        self.strip = replace(strip, aim=replace(strip.aim, vibration=0.0))
        self.mode, self._device, self._seed = replace(mode, width=width), device, setting.air.seed
        dark = _Shown(self.mode, np.zeros((1, 1), np.bool_))
        self.layout = dark.layout
        air = self.strip.make_air(dark, 1)
        self.registration = air.truth
        timing = true_timing(self.strip, air.row_delay, mode.ticks)
        self.slope, self.rows = timing.slope, timing.rows
        self.period = PS / self.strip.camera.clock.hz
        self.middle = float(timing.start(0, timing.rows / 2)) * self.period

    def take(self, setting: LinkSetting) -> None:
        """Takes over the hidden spans and the seeds of a link."""
        strip, self._seed = self.strip, setting.air.seed
        self.strip = replace(
            strip, aim=replace(strip.aim, blocked=setting.aim.blocked),
            camera=replace(strip.camera, seed=setting.camera.seed),
        )  # fmt: skip

    def timing(self, phase: float, growth: float, slope: float) -> Timing:
        """Timing of a window of that phase, ticks, of its growth, ticks a tick, and of that slope
        over the rows, ticks."""
        period = self.mode.ticks * (1 + growth)
        return Timing(BEFORE + phase - slope / 2, period, slope, self.rows)

    def data(self, window: int, symbols: int) -> npt.NDArray[np.bool_]:
        """Random data of a window in the mode's line code, (symbols, cells)."""
        code = self.mode.code
        rng = np.random.Generator(np.random.Philox(key=(self._seed << 32) | window))
        groups = -(-symbols // code.symbols)
        values = rng.integers(0, 1 << code.bits, (groups, self.layout.cells)).astype(np.uint8)
        state = np.zeros(self.layout.cells, np.bool_)
        return encode_line(self.mode.line, values, state)[:symbols]

    def film(
        self, shown: npt.NDArray[np.bool_], phase: float, growth: float, window: int, since: int
    ) -> Recording:
        """Films a window.

        Args:
            shown: (symbols, cells) bits of the data cells.
            phase, growth: true phase at the begin, ticks, and its growth, ticks a tick.
            window: number of the window, for its random numbers.
            since: begin of the window, ps from the begin of the recording.
        """
        strip, clock = self.strip, self.strip.camera.clock
        first = strip.first_light + round((BEFORE + phase) * self.period - self.middle)
        ratio = Fraction(round((1 + growth) * _DIGITS), _DIGITS)
        rate = Fraction(clock.num, clock.den) / ratio
        seed = (strip.camera.seed + _WEYL * (window + 1)) % 2**32
        spans = ((low - since, high - since) for low, high in strip.aim.blocked)
        at = replace(
            strip, first_light=first,
            camera=replace(strip.camera, seed=seed),
            panel=replace(strip.panel, clock=Clock(rate.numerator, rate.denominator)),
            air=replace(strip.air, seed=seed),
            aim=replace(strip.aim, blocked=tuple((max(a, 0), b) for a, b in spans if b > 0)),
        )  # fmt: skip
        sent = _Shown(self.mode, shown)
        air = at.make_air(sent, sent.planes)
        pixels = SpikeCamera(at.camera, self._device, row_delay=air.row_delay)
        dark = first + at.panel.clock.edge(sent.planes)
        cycles = -(-(clock.cycle_at(dark) + 2) // WORD) * WORD
        block = Block(0, cycles)
        words = pixels.step(air.step(None, block), block).words
        recording = Recording((at.camera.chip.height, at.camera.chip.width))
        recording.add(Viform(words, cycles, clock, 0))
        return recording


def at_lock(setting: LinkSetting) -> LinkSetting:
    """A link whose clocks have the same rate, and whose planes begin with the ticks."""
    clock = setting.camera.clock
    strip = strip_of(setting)
    mode = Mode(strip.optics.width, strip.optics.height, 2, 1, "scrambled", 16)
    air = strip.make_air(_Shown(mode, np.zeros((1, 1), np.bool_)), 1)
    timing = true_timing(strip, air.row_delay, 1)
    late = centred(float(timing.start(0, timing.rows / 2)))
    first = setting.first_light - round(late * PS / clock.hz)
    return replace(setting, first_light=first, panel=replace(setting.panel, clock=clock))
