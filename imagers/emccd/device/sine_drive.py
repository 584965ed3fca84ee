"""The high-voltage clock RPhi2HV: a sine, the loop that holds its peak, and the digital
potentiometer that sets the peak.

Document 003: a high-frequency transformer makes the sine, a peak detector captures its maximum, and
a resistor network feeds this back to the front end; the potentiometer in the network sets the peak.
It prints neither frequency nor circuit. The sine has one crest a pixel clock, since every pixel
passes one stage a clock. It swings from a trough to its peak, and the charge drops from the gate
before it when R1 falls: the gain follows the mean of the sine over this transfer.

The loop, once a crest, with period T (y: amplifier times transformer, A: peak, D: detector):

    y += (W - l D - y)(1 - exp(-T/t_a)), within 0 and the top
    A += ((1 + x) y - A)(1 - exp(-T/t_q)),  t_q = Q/(pi f)
    D  = D exp(-T/t_d), and c (A - D) more where A exceeds it

With e = c/(1 - (1 - c) exp(-T/t_d)) the detector rests at D = e A. l = L/e and W = (1 + L) V make
the peak V of the step where the transformer is as calibrated; a drift x of it moves the peak by
x/(1 + L (1 + x)) of V. V falls as the feedback rises, so 1 + L is proportional to 1/V. The time
constant is t_a/(1 + L).

The potentiometer has 256 steps and is configured over SPI. The document names no chip. The word,
the edges and the wiper at power-on are those of a common one of 256 steps (MCP41xxx data sheet): 16
bits, the most significant first, a command byte and a data byte. A bit is taken at the rising edge
of the clock, and the wiper moves when the chip select rises. A word of another length, or with
another command, moves nothing. Clock rate: assumed.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim import InputError
from imagers.common.trace import Signal
from imagers.emccd.pixels import HighVoltage
from imagers.emccd.pixels.multiplication import GAIN_STEPS

Values = npt.NDArray[np.float64]
_CALIBRATED: Final = 25.0
"""degC of the transformer at the calibration (assumed)."""
_GATE: Final = 3.0
"""V of the gate RPhiDC before the multiplication (assumed)."""
_GAP: Final = 2.0
"""um between that gate's well and the next (assumed)."""
_HEADROOM: Final = 1.5
"""Largest y over the largest peak (assumed)."""
_EXACT: Final = 1e-9
"""V within which the peak counts as its steady state."""
_State = tuple[float, float, float]
"""y, A, D in V."""
_BITS: Final = 16
_WRITE: Final = 0x11
"""Command byte: C1 C0 = 01, write; P0 = 1, the only potentiometer."""
_CARES: Final = 0x31
"""Bits of the command byte that the chip looks at."""
_MIDDLE: Final = 0x80
_HALF: Final = 5
"""System clocks of half a period of SPI: 1 MHz at 10 MHz; assumed."""
SPI_SIGNALS: Final = (Signal("spi_select", before=1), Signal("spi_clock"), Signal("spi_data"))
"""Chip select (low while a word passes), clock (low at rest), data."""


@dataclass(frozen=True)
class DriveSettings:
    """Settings of drive and loop; all assumed.

    Attributes:
        phase: phase of the crest after the fall of R1, degrees.
        trough: trough of the sine, V.
        transfer: time in which the charge drops, s, half of it before the fall's middle.
        loop_gain: L at the largest peak.
        response: time constant t_a/(1 + L) at the largest peak, s.
        quality: Q of the tuned transformer.
        attack: c, share of its distance by which the detector rises at a crest.
        droop: t_d, s.
        drift: drift of the transformer, 1/K.
        ripple: ripple of the amplifier's supply, relative amplitude.
        ripple_frequency: Hz.
    """

    phase: float = 0.0
    trough: float = 0.0
    transfer: float = 10e-9
    loop_gain: float = 200.0
    response: float = 20e-6
    quality: float = 20.0
    attack: float = 0.5
    droop: float = 100e-6
    drift: float = -2e-3
    ripple: float = 1e-4
    ripple_frequency: float = 100e3


@dataclass(frozen=True)
class SineDrive:
    """The drive of one camera.

    Attributes:
        voltage: peak and gain of each step.
        settings: settings of drive and loop.
        hertz: pixel clock, and frequency of the sine.
        celsius: temperature of the transformer.
    """

    voltage: HighVoltage = field(default_factory=HighVoltage)
    settings: DriveSettings = field(default_factory=DriveSettings)
    hertz: int = 10_000_000
    celsius: float = _CALIBRATED

    def __post_init__(self) -> None:
        """Raises InputError for a loop that does not work."""
        if self.strength <= 0.1:
            raise InputError(
                "imager.drive.drift", "that of a transformer that keeps a tenth of its strength",
                f"{self.settings.drift:g} a kelvin at {self.celsius:g} degC", "lessen it",
            )  # fmt: skip
        if max(abs(self.poles(step)).max() for step in (0, GAIN_STEPS - 1)) >= 1:
            raise InputError(
                "imager.drive.response", "long enough for a loop that settles",
                f"{self.settings.response:g} s with a transformer of Q = {self.settings.quality:g}",
                "lengthen it, or lower the quality",
            )  # fmt: skip

    @property
    def strength(self) -> float:
        """1 + x: strength of the transformer, 1 at calibration."""
        return 1.0 + self.settings.drift * (self.celsius - _CALIBRATED)

    @property
    def tank(self) -> float:
        """t_q = Q/(pi f): time constant of the envelope of a tuned circuit, s."""
        return self.settings.quality / (math.pi * self.hertz)

    @property
    def droop(self) -> float:
        """exp(-T/t_d): what the detector keeps in a period."""
        return math.exp(-1.0 / (self.hertz * self.settings.droop))

    @property
    def efficiency(self) -> float:
        """e: detector over peak, at rest."""
        c = self.settings.attack
        return c / (1.0 - (1.0 - c) * self.droop)

    def loop_gain(self, step: int) -> float:
        """L at a step."""
        return (1.0 + self.settings.loop_gain) * self.voltage.peak[1] / self.voltage.volts(step) - 1

    def _loop(self, step: int) -> _Loop:
        s, gain = self.settings, self.loop_gain(step)
        amplifier = s.response * (1.0 + s.loop_gain)
        return _Loop(
            (1.0 + gain) * self.voltage.volts(step), gain / self.efficiency,
            _HEADROOM * self.voltage.peak[1], self.strength, s.attack, self.droop,
            -math.expm1(-1.0 / (self.hertz * amplifier)),
            -math.expm1(-1.0 / (self.hertz * self.tank)),
        )  # fmt: skip

    def steady(self, step: int) -> float:
        """Peak at rest, V: V (1 + x/(1 + L (1 + x))), unless the amplifier is at its top."""
        x = self.strength - 1.0
        peak = self.voltage.volts(step) * (1.0 + x / (1.0 + self.loop_gain(step) * (1.0 + x)))
        return min(peak, self.strength * _HEADROOM * self.voltage.peak[1])

    def resting(self, step: int) -> tuple[float, float, float]:
        """y, A and D at rest, V."""
        peak = self.steady(step)
        return peak / self.strength, peak, self.efficiency * peak

    def poles(self, step: int) -> npt.NDArray[np.complex128]:
        """(3,) eigenvalues of a period, while every crest charges the detector and nothing
        clips."""
        k = self._loop(step)
        y = np.array([1 - k.amplifier, 0.0, -k.amplifier * k.feedback])
        peak = np.array([0.0, 1 - k.tank, 0.0]) + k.tank * k.strength * y
        held = np.array([0.0, 0.0, (1 - k.attack) * k.decay]) + k.attack * peak
        return np.linalg.eigvals(np.stack([y, peak, held])).astype(np.complex128)

    def settling(self, start: float, step: int, within: float) -> float:
        """Time, s, in which the slowest pole takes the peak from `start` to within so many V."""
        slowest = float(abs(self.poles(step)).max())
        return math.log(abs(start - self.steady(step)) / within) / -math.log(slowest) / self.hertz

    def ripple(self, step: int) -> float:
        """Amplitude of the peak's ripple at rest, V, from the transfer function of the loop."""
        k, s = self._loop(step), self.settings
        z = cmath.exp(2j * math.pi * s.ripple_frequency / self.hertz)
        forward = k.tank * z / (z - 1 + k.tank)
        back = k.amplifier * k.feedback * k.strength / (z - 1 + k.amplifier)
        detector = k.attack * z / (z - (1 - k.attack) * k.decay)
        y = self.resting(step)[0]
        return s.ripple * y * abs(forward / (1 + forward * back * detector))

    def transfer_mean(self, peak: float, phase: float | None = None) -> float:
        """Mean of the sine over the transfer time w, V: B + (A - B)(1 + cos(phase) sinc(w f))/2 for
        trough B; in the drive's phase when None."""
        s = self.settings
        degrees = s.phase if phase is None else phase
        wave = math.cos(math.radians(degrees)) * float(np.sinc(s.transfer * self.hertz))
        return s.trough + (peak - s.trough) * (1.0 + wave) / 2

    def field(self, peak: float) -> float:
        """Mean field in the gap during the transfer, V/um."""
        return (self.transfer_mean(peak) - _GATE) / _GAP

    def at_transfer(self, peak: float) -> float:
        """Peak of a sine in phase with the same mean over the transfer's fall, V: the printed peaks
        give the printed gains in phase."""
        return peak - (self.transfer_mean(peak, 0.0) - self.transfer_mean(peak))

    def gain(self, step: int, kelvin: float | None = None) -> float:
        """Mean gain at rest."""
        return self.voltage.gain_at(self.at_transfer(self.steady(step)), kelvin)

    def course(self, start: int, step: int, periods: int, *, ripple: bool = False) -> Values:
        """(periods, 3) y, A and D after each period, V, from rest at a step to another one."""
        wave = np.zeros(periods)
        if ripple:
            turn = 2 * math.pi * self.settings.ripple_frequency / self.hertz
            wave = self.settings.ripple * np.sin(turn * np.arange(periods))
        out = np.empty((periods, 3))
        _course(self.resting(start), self._loop(step), wave, out)
        return out

    def settled(self, start: int, step: int, within: float) -> float | None:
        """Time after which the simulated gain stays within this share of its end, s; None if that
        takes more than ten times the closed form and the droop together."""
        end, slope = self.steady(step), self.voltage.slope(self.steady(step))
        expected = self.settling(self.steady(start), step, within / slope)
        peaks = self.course(start, step, int(10 * (expected + self.settings.droop) * self.hertz))[
            :, 1
        ]
        outside = np.flatnonzero(np.abs(peaks - end) > within / slope)
        last = int(outside[-1]) + 1 if outside.size else 0
        return (last + 1) / self.hertz if last < peaks.size else None


class RunningDrive:
    """The drive clock by clock from an edge of the pixel clock on.

    Args:
        drive: settings.
        step: step of the potentiometer.
        edge: first edge.
        cold: whether the sine begins there; otherwise the loop is at rest.
    """

    def __init__(self, drive: SineDrive, step: int, edge: int = 0, *, cold: bool = False) -> None:
        self.drive, self._edge, self._step = drive, edge, step
        self._state = (0.0, 0.0, 0.0) if cold else drive.resting(step)

    def set(self, edge: int, step: int) -> None:
        """Moves the potentiometer at an edge."""
        self._advance(edge)
        self._step = step

    def mean_peak(self, begin: int, end: int) -> float:
        """Mean of the peaks of a span of edges, V; exactly the steady state where it is reached."""
        self._advance(begin)
        mean = self._advance(end) / (end - begin)
        steady = self.drive.steady(self._step)
        return steady if abs(mean - steady) < _EXACT else mean

    def _advance(self, edge: int) -> float:
        loop = self.drive._loop(self._step)
        self._state, total = _total(self._state, loop, edge - self._edge)
        self._edge = edge
        return float(total)


class _Loop(NamedTuple):
    """Coefficients of the loop at a step: W, l, top, 1 + x, c, exp(-T/t_d), and 1 - exp(-T/t) of
    amplifier and transformer."""

    wanted: float
    feedback: float
    top: float
    strength: float
    attack: float
    decay: float
    amplifier: float
    tank: float


@njit(cache=True, nogil=True)
def _period(state: _State, loop: _Loop, ripple: float) -> _State:
    y, peak, held = state
    y += (loop.wanted - loop.feedback * held - y) * loop.amplifier
    y = min(max(y, 0.0), loop.top)
    peak += ((loop.strength + ripple) * y - peak) * loop.tank
    held *= loop.decay
    return y, peak, held + loop.attack * max(peak - held, 0.0)


@njit(cache=True, nogil=True)
def _total(state: _State, loop: _Loop, count: int) -> tuple[_State, float]:
    """State after `count` periods, and the sum of their peaks."""
    total = 0.0
    for n in range(count):
        before = state
        state = _period(state, loop, 0.0)
        total += state[1]
        moved = abs(state[0] - before[0]) + abs(state[1] - before[1]) + abs(state[2] - before[2])
        if moved < 1e-14:  # at rest
            return state, total + (count - 1 - n) * state[1]
    return state, total


@njit(cache=True, nogil=True)
def _course(state: _State, loop: _Loop, ripple: Values, out: Values) -> None:
    for n in range(out.shape[0]):
        state = _period(state, loop, ripple[n])
        out[n, 0], out[n, 1], out[n, 2] = state


def word_clocks() -> int:
    """System clocks from the fall of the select to its rise, when the wiper moves."""
    return (2 * _BITS + 1) * _HALF


def word_edges(edge: int, code: int) -> Iterator[tuple[int, str, int]]:
    """Yields (edge, signal, value) of the word that sets a code, from `edge` on, in order."""
    if not 0 <= code <= 0xFF:
        raise ValueError(f"code must be 0 to 255, not {code}")
    word = _WRITE << 8 | code
    yield edge, "spi_select", 0
    for n in range(_BITS):
        begin = edge + 2 * n * _HALF
        yield begin, "spi_data", word >> (_BITS - 1 - n) & 1
        yield begin + _HALF, "spi_clock", 1
        yield begin + 2 * _HALF, "spi_clock", 0
    yield edge + word_clocks(), "spi_select", 1


class Potentiometer:
    """The chip at the end of the wires, from power-on.

    Attributes:
        wiper: 0 to 255.
        words: words that have moved the wiper.
        refused: words that have not: of another length, or with another command.
    """

    def __init__(self) -> None:
        self.wiper, self.words, self.refused = _MIDDLE, 0, 0
        self._wires = {signal.name: signal.before for signal in SPI_SIGNALS}
        self._shifted = self._count = 0

    def change(self, signal: str, value: int) -> None:
        """Takes one change of a wire."""
        before, self._wires[signal] = self._wires[signal], value
        if signal == "spi_select" and before and not value:
            self._shifted = self._count = 0
        elif signal == "spi_clock" and value and not before and not self._wires["spi_select"]:
            self._shifted = (self._shifted << 1 | self._wires["spi_data"]) & 0xFFFF
            self._count += 1
        elif signal == "spi_select" and value and not before:
            self._load()

    def _load(self) -> None:
        whole = self._count > 0 and self._count % _BITS == 0
        if whole and self._shifted >> 8 & _CARES == _WRITE & _CARES:
            self.wiper, self.words = self._shifted & 0xFF, self.words + 1
        else:
            self.refused += 1
