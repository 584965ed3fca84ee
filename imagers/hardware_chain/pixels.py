"""The hardware chain of document 004, pixel by pixel, with the supply's ripple in its frames:
stripes.

A ripple of frequency f adds A sin(2 pi f t) at the instant t at which a pixel is read (document
004: ripple near the sensor's output frequency enters the output amplifier, and slanted stripes
cover the picture). Pixel c of row r is read r L + c cycles of the pixel clock after the frame's
first. So the stripes are a plane wave of

    f / f_clock cycles a column and f L / f_clock cycles a row,

of which sampling leaves the distance to the nearest whole number: a low frequency makes rows darker
and brighter, f L / f_clock = f t_row cycles a row; one near the clock, slanted stripes.

Photoelectrons and dark electrons (Poisson) fill the well; reset, white and transfer noise of the
sensor follow, by their laws of temperature and clock (`sensor.dynamic_range.parts`); S volts an
electron; circuit noise and the supply's ripple; analog gain m; a converter with its noise, whose
zero lies `black` codes below darkness; digital gain n, rounded, into a word as wide as the
converter's. `Chain` (`viform design dynamic-range`) is its closed form.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.streams import Stream
from cosim.plan.effects import Bound, Effect, Summary
from imagers.common.fixed import FixedTiming
from imagers.common.frame_pixel import (
    Conversion,
    digitised,
    noise_change,
    steady_effects,
    summary_of,
)
from sensor.dynamic_range import Chain, SensorNoise, rounding_variance
from sensor.frame_pixels import Exposed, ImagerSummary

Values = npt.NDArray[np.float64]
PEDESTAL: Final = 6.0
"""Deviations of the noise in the dark between darkness and the converter's zero."""
_FULL: Final = 100.0
"""Wells of electrons beyond which a pixel is full whatever its noise."""
_NS: Final = {
    "shot noise": 60.0, "dark current": 30.0, "reset noise": 45.0, "white noise": 45.0,
    "transfer noise": 45.0, "circuit noise": 45.0, "supply ripple": 15.0, "converter noise": 45.0,
}  # fmt: skip
"""Run-time costs, ns per pixel and frame, by the run time with and without the effect on one core
at 2.5 GHz."""
_SOURCES: Final = {
    "shot noise": (Stream.IMAGER_SHOT, "Poisson law of photoelectrons"),
    "dark current": (Stream.IMAGER_DARK, "Poisson law of dark electrons; I 2^((T - T0)/Td) or "
                     "T^3 exp(-E/kT)"),
    "reset noise": (Stream.IMAGER_RESET, "document 004: as the root of the temperature"),
    "white noise": (Stream.IMAGER_WHITE, "document 004: as the root of the temperature"),
    "transfer noise": (Stream.IMAGER_TRANSFER, "document 004: as the root of the clock"),
    "circuit noise": (Stream.IMAGER_CIRCUIT, "document 004: V_circuit; in quadrature"),
    "supply ripple": (Stream.NONE, "document 004: a sine on the sensor's output, stripes"),
    "converter noise": (Stream.IMAGER_READ, "document 004: alpha; in quadrature"),
}  # fmt: skip
_GAUSSIAN: Final = ("reset", "white", "transfer")


def _beside_whole(cycles: Fraction) -> float:
    """What sampling leaves of a frequency in cycles a sample, -1/2 to 1/2."""
    return float(cycles - round(cycles))


def _upright(row: float, column: float) -> tuple[float, float]:
    """Frequency of a wave or of its negative: the one whose larger part is positive."""
    return (-row, -column) if max(row, column, key=abs) < 0 else (row, column)


@dataclass(frozen=True)
class Ripple:
    """A sine on the supply.

    Attributes:
        volts: amplitude at the sensor's output.
        hertz: frequency.
        timing: timing of the readout.
    """

    volts: float
    hertz: float
    timing: FixedTiming

    @property
    def _per_cycle(self) -> Fraction:
        """Periods in a cycle of the pixel clock, exact."""
        clock = self.timing.clock
        return Fraction(repr(self.hertz)) * clock.den / clock.num

    @property
    def rms(self) -> float:
        """Volts RMS: of V_circuit, in quadrature."""
        return self.volts / 2**0.5

    def at(self, frame: int, first: int, rows: int, columns: int) -> Values:
        """Volts at the readout of these pixels, (rows, columns). Phases are reduced exactly, so a
        late frame is as accurate as the first."""
        per, timing = self._per_cycle, self.timing
        start = timing.first(frame) + first * timing.line
        turns = np.arange(rows)[:, None] * float(per * timing.line % 1) + float(per * start % 1)
        return self.volts * np.sin(2 * np.pi * (turns + np.arange(columns) * float(per % 1)))

    def stripes(self) -> tuple[float, float]:
        """Spatial frequency of the stripes, cycles a row and cycles a column, by the closed form;
        of the two signs that a real wave has, the one whose larger part is positive."""
        per = self._per_cycle
        return _upright(_beside_whole(per * self.timing.line), _beside_whole(per))


def strongest_stripes(values: npt.NDArray[np.uint16]) -> tuple[float, float, float]:
    """Spatial frequency (cycles a row, cycles a column) and amplitude (DN) of the strongest plane
    wave in a frame. The peak of the spectrum is refined by the phase between halves of the frame,
    to a small part of 1/rows and 1/columns."""
    rows, columns = values.shape
    plane = values - values.mean()
    power = np.abs(np.fft.rfft2(plane))
    peak_row, peak_column = np.unravel_index(int(power.argmax()), power.shape)
    row, column = peak_row / rows, peak_column / columns
    row -= round(row)
    down, across = np.arange(rows), np.arange(columns)
    for _ in range(4):
        wave = plane * np.exp(-2j * np.pi * (row * down[:, None] + column * across))
        row += _turned(wave.sum(axis=1)) / (rows / 2)
        column += _turned(wave.sum(axis=0)) / (columns / 2)
    # Least squares of cosine and sine: they are not orthogonal over a part of a period.
    angle = 2 * np.pi * (row * down[:, None] + column * across).ravel()
    parts = np.stack([np.cos(angle), np.sin(angle)])
    amplitude = np.hypot(*np.linalg.solve(parts @ parts.T, parts @ plane.ravel()))
    return (*_upright(float(row), float(column)), float(amplitude))


def _turned(samples: npt.NDArray[np.complex128]) -> float:
    """Turns by which the second half of a line leads the first."""
    half = len(samples) // 2
    ratio = samples[-half:].sum() * np.conj(samples[:half].sum())
    return float(np.angle(ratio)) / (2 * np.pi)


@dataclass(frozen=True)
class ChainPixels:
    """See `PixelModel`.

    Attributes:
        shape: (H, W).
        chain: well, volts an electron, circuit noise without the ripple, converter and gains; its
            `noise` is not used here.
        noise: noise of the sensor, by its laws.
        responsivity: photoelectrons of a lux second.
        celsius: temperature of the sensor.
        hertz: pixel clock.
        ripple: ripple of the supply.
        black: value of darkness at the converter, DN; None for `PEDESTAL`.
        exposure: s, for that `PEDESTAL`.
    """

    shape: tuple[int, int]
    chain: Chain
    noise: SensorNoise
    responsivity: float
    celsius: float
    hertz: float
    ripple: Ripple
    black: int | None = None
    exposure: float = 0.0

    @property
    def bits(self) -> int:
        return self.chain.converter.bits

    @property
    def codes(self) -> float:
        """Codes of the converter for an electron, without the digital gain."""
        return self.chain.sensitivity * self.chain.analog / self.chain.converter.step

    @property
    def slope(self) -> float:
        """DN of an electron."""
        return self.codes * self.chain.digital

    @cached_property
    def zero(self) -> int:
        """Value of darkness at the converter, DN."""
        if self.black is not None:
            return self.black
        random = math.sqrt(self._variances(0.0, self.exposure)["sum"]) / self.slope * self.codes
        sine = self.ripple.volts * self.chain.analog / self.chain.converter.step
        return math.ceil(PEDESTAL * random + sine)

    def volts(self, volts: float) -> float:
        """Volts at the sensor's output as DN."""
        return volts / self.chain.sensitivity * self.slope

    def _variances(self, electrons: float, seconds: float) -> dict[str, float]:
        """Variance by effect, DN^2, and their sum with that of rounding; the ripple's apart."""
        sensor = self.noise.parts(self.celsius, self.hertz, seconds, electrons)
        named = {"shot": "shot noise", "dark": "dark current"}
        made = {
            named.get(name, f"{name} noise"): (part * self.slope) ** 2
            for name, part in sensor.items()
        }
        made["circuit noise"] = self.volts(self.chain.circuit) ** 2
        converter = self.chain.converter
        made["converter noise"] = (converter.noise / converter.step * self.chain.digital) ** 2
        rounding = self.chain.digital**2 / 12 + rounding_variance(self.chain.digital)
        return made | {"sum": sum(made.values()) + rounding}

    def convert(self, rows: Exposed, seed: int, kept: frozenset[str]) -> npt.NDArray[np.uint16]:
        """See `PixelModel`."""
        chain, at = self.chain, Conversion.of(rows, seed, kept)
        most = _FULL * chain.full_well
        charge = np.minimum(rows.lux_seconds * self.responsivity, most)
        charge = at.counts(charge, "shot noise", Stream.IMAGER_SHOT)
        rate = self.noise.dark.at(self.celsius)
        charge = charge + at.dark_counts(rate, rows.seconds, most=most, effect="dark current")
        # The well ends the signal; what the output adds is not in the well.
        charge = np.minimum(charge, chain.full_well)
        parts = self.noise.parts(self.celsius, self.hertz)
        for name in _GAUSSIAN:
            effect = f"{name} noise"
            charge = at.noisy(charge, parts[name], effect, _SOURCES[effect][0])
        volts = charge * chain.sensitivity
        volts = at.noisy(volts, chain.circuit, "circuit noise", Stream.IMAGER_CIRCUIT)
        if "supply ripple" in kept and self.ripple.volts:
            volts = volts + self.ripple.at(rows.frame, rows.first, *at.shape)
        volts = volts * chain.analog
        volts = at.noisy(volts, chain.converter.noise, "converter noise", Stream.IMAGER_READ)
        codes = digitised(np.rint(volts / chain.converter.step) + self.zero, self.bits)
        return digitised(np.floor(codes * chain.digital + 0.5), self.bits)

    def mean_variance(self, lux_seconds: float, seconds: float) -> tuple[float, float]:
        """See `PixelModel`. The ripple counts with its mean square."""
        electrons = lux_seconds * self.responsivity
        dark = self.noise.dark.at(self.celsius) * seconds
        mean = self.zero * self.chain.digital + (electrons + dark) * self.slope
        variance = self._variances(electrons, seconds)["sum"]
        return mean, variance + self.volts(self.ripple.rms) ** 2

    def summary(
        self, lux_seconds: tuple[float, float], seconds: tuple[float, float], frames: int
    ) -> ImagerSummary:
        """See `PixelModel`."""
        well = self.chain.full_well
        low, high = (min(light * self.responsivity, well) for light in lux_seconds)
        return summary_of((low, high), seconds, frames, well, step=1 / self.slope)

    @cached_property
    def effects(self) -> dict[str, Effect]:
        """See `PixelModel`."""
        return steady_effects(_SOURCES, _NS, self._bound)

    def _bound(self, name: str) -> Callable[[Summary], Bound]:
        """The larger of the change of a value's mean and of its noise. A noise with the share p of
        the variance leaves sqrt(1 - p) of the deviation; the share is largest in the darkest pixel,
        that of shot noise in the brightest. An estimate, because values are rounded and clipped."""

        def bound(scene: Summary) -> Bound:
            assert isinstance(scene, ImagerSummary)
            shift, shares = 0.0, []
            for light in (float(scene.darkest), float(scene.brightest)):
                for seconds in scene.exposure:
                    parts = self._variances(light, seconds)
                    # In DN a Poisson mean is its variance over the slope.
                    dark = parts["dark current"] / self.slope
                    base = max(self.zero * self.chain.digital + light * self.slope + dark, 1.0)
                    if name == "supply ripple":
                        sine = self.volts(self.ripple.rms)
                        shift = max(shift, sine / base)
                        shares.append(sine**2 / (sine**2 + parts["sum"]))
                        continue
                    shares.append(parts[name] / parts["sum"])
                    if name == "dark current":
                        shift = max(shift, dark / base)
            return Bound(max(shift, float(noise_change(max(shares)))), "estimate")

        return bound
