"""Dynamic range of a chain from the sensor to its digital output, and the document's formula.

The chain: electrons, volts at S a electron, circuit noise, analog gain m, converter of full scale
V_fs with noise a (quantisation in it), digital gain n, an output word as wide as the converter's.

Referred to the sensor's output, noises that are independent add in quadrature,

    V_n^2 = (S Q_noise)^2 + V_circuit^2 + (a/m)^2 + (r/(m n))^2,

where r is the noise that rounding after the digital gain adds. The largest signal is the least of
three clipping levels: the sensor's V_sat, the converter's V_fs/m, the output word's V_fs/(m n). The
least signal has an SNR of 1, its shot noise included: s = 1/2 + sqrt(1/4 + (V_n/S)^2) electrons.
`derived` is the ratio of the two.

The document (Wang et al., patent of 2017) prints

    20 log10(V_sat/(S2 Q_noise + V_circuit)) + 20 log10(1/(n^2 m (m + alpha))),

garbled; this is its plain reading. Its two gains stand for two things: 1/(n m) is the saturation
referred to the input (the output clips sooner), n (m + alpha) the noise referred to the output.
A ratio of the two counts the gain twice: with V_fs = V_sat a correct chain has 1/(n (m + alpha)),
so the document is 20 log10(n m) dB too low, and equal at m = n = 1. It also adds noises as if they
were one and the same, up to 3 dB a pair too low. Only a dimensionless alpha fits (m + alpha): the
converter's noise over that before it. `document` is that figure; nothing is chosen by it.

A sensor's data may give two saturation voltages, the linear full well and the full well: 2500 mV
and 3400 mV for the DALSA sensor of Wang et al. Between the two the output still rises with light,
but ever less. The document leaves this part out of the dynamic range, and so does this package;
`FullWell` computes what the part would add. The document does not print the curve: an exponential
approach with a continuous slope is assumed.

An output of few bits is a linear or gamma `Mapping` of the chain's values. One of L = 2^bits - 1
steps shows, at the least, its first step. Mapped by y = x^(1/gamma) that step stands for
x = L^-gamma, so an output holds gamma 20 log10(L) dB: 48.1 dB linear in 8 bits, 105.9 dB with
gamma 2.2. What it costs is the size of the other steps.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

import numpy as np
import numpy.typing as npt

from sensor.dynamic_range.parts import Converter, decibels

Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Chain:
    """A sensor, its circuit, a converter and two gains.

    Attributes:
        full_well: electrons at which the sensor's linear range ends.
        noise: noise of the sensor in the dark, electrons RMS.
        sensitivity: volts an electron.
        circuit: volts RMS at the sensor's output.
        analog, digital: gains.
    """

    full_well: float
    noise: float
    sensitivity: float
    circuit: float
    converter: Converter
    analog: float = 1.0
    digital: float = 1.0

    def parts(self) -> dict[str, float]:
        """Noise by origin, electrons RMS at the sensor."""
        volt = 1 / self.sensitivity
        step = self.converter.step
        rounding = math.sqrt(rounding_variance(self.digital)) * step / self.digital
        return {
            "sensor": self.noise,
            "circuit": self.circuit * volt,
            "converter": self.converter.noise * volt / self.analog,
            "quantisation": step / math.sqrt(12) * volt / self.analog,
            "rounding": rounding * volt / self.analog,
        }

    @property
    def floor(self) -> float:
        """Noise in the dark, electrons RMS."""
        return math.hypot(*self.parts().values())

    @property
    def least(self) -> float:
        """Signal whose SNR is 1, shot noise included, electrons."""
        return 0.5 + math.sqrt(0.25 + self.floor**2)

    @property
    def saturation(self) -> float:
        """Signal at which the first stage of the chain clips, electrons."""
        scale = self.converter.full_scale / (self.sensitivity * self.analog)
        return min(self.full_well, scale, scale / self.digital)

    @property
    def limit(self) -> str:
        """Name of the stage that clips first."""
        scale = self.converter.full_scale / (self.sensitivity * self.analog)
        if self.full_well <= min(scale, scale / self.digital):
            return "sensor"
        return "output word" if self.digital > 1 else "converter"

    @property
    def derived(self) -> float:
        """Saturation over the least signal, dB."""
        return decibels(self.saturation / self.least)

    @property
    def over_noise(self) -> float:
        """Saturation over the noise in the dark, dB: as the document means a dynamic range."""
        return decibels(self.saturation / self.floor)

    @property
    def document(self) -> float:
        """The document's figure, dB."""
        before = self.sensitivity * self.noise + self.circuit
        # Without noise before the converter alpha has no value; the formula has.
        before = max(before, 1e-9 * self.converter.total_noise)
        return document_dynamic_range(
            self.full_well * self.sensitivity, 1.0, 0.0, before,
            self.analog, self.digital, self.converter.total_noise / before,
        )  # fmt: skip

    @property
    def dithered(self) -> bool:
        """Whether noise spans half a step or more of everything that rounds. With less, errors of
        rounding are no noise of step/sqrt(12) and `derived` is a size only (EMVA 1288 draws the
        line at 0.24 DN^2 of variance, quantisation included). Steps are the converter's, those of
        an output word that a gain below 1 makes coarser, and the beat of the one with the other."""
        before = math.hypot(self.noise * self.sensitivity, self.circuit) * self.analog
        spread = math.hypot(before, self.converter.noise) / self.converter.step
        beat = abs(self.digital - round(self.digital))
        return spread >= max(1, 1 / self.digital, 1 / beat if beat else 1) / 2


def rounding_variance(digital: float) -> float:
    """Variance that rounding after a digital gain adds, DN^2 of the output.

    For a gain p/q in lowest terms the rounding errors are the q multiples of 1/q around 0. Halves
    are rounded up.
    """
    q = Fraction(repr(float(digital))).denominator
    return (1 - 1 / q**2) / 12


def document_dynamic_range(
    saturated: float, sensitivity: float, noise: float, circuit: float, analog: float,
    digital: float, alpha: float,
) -> float:  # fmt: skip
    """The document's system dynamic range, dB, in its plain reading.

    Args:
        saturated: V_sat, volts.
        sensitivity: S2, volts an electron (the document calls it optical sensitivity, but times
            Q_noise it must give volts).
        noise: Q_noise, electrons.
        circuit: volts.
        analog, digital: gains m and n.
        alpha: the converter's noise over S2 Q_noise + V_circuit.
    """
    before = sensitivity * noise + circuit
    return decibels(saturated / before) + decibels(1 / (digital**2 * analog * (analog + alpha)))


def gain_counted_once(
    saturated: float, sensitivity: float, noise: float, circuit: float, analog: float,
    digital: float, alpha: float,
) -> float:  # fmt: skip
    """The document's formula, dB, with signal and noise referred to the same point.

    The gains enter as 1/(n (m + alpha)). Valid for a converter whose full scale is V_sat and for
    gains of 1 or more. The arguments are those of `document_dynamic_range`.
    """
    before = sensitivity * noise + circuit
    return decibels(saturated / before) + decibels(1 / (digital * (analog + alpha)))


@dataclass(frozen=True)
class Mapping:
    """A power law from a chain's values to an output of few bits.

    Attributes:
        gamma: 1 is linear.
        bits: bits of the output.
    """

    gamma: float = 1.0
    bits: int = 8

    @property
    def steps(self) -> int:
        return (1 << self.bits) - 1

    def codes(self, light: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """Output codes of values from 0 to 1 (what lies outside is clipped), rounded."""
        x = np.clip(np.asarray(light, np.float64), 0, 1)
        return np.rint(x ** (1 / self.gamma) * self.steps).astype(np.int64)

    def light(self, codes: npt.ArrayLike) -> Values:
        """Values from 0 to 1 that codes stand for."""
        return np.asarray((np.asarray(codes, np.float64) / self.steps) ** self.gamma)

    @property
    def holds(self) -> float:
        """dB from the first step to the last."""
        return self.gamma * decibels(self.steps)

    def survives(self, db: float) -> float:
        """dB left of a chain's dynamic range: the chain's, or what the output holds."""
        return min(db, self.holds)

    def step(self, light: float) -> float:
        """Size of a step at a value, relative to it: gamma/(L x^(1/gamma))."""
        return self.gamma / (self.steps * light ** (1 / self.gamma))


@dataclass(frozen=True)
class FullWell:
    """Where a sensor's output leaves its linear range.

    Attributes:
        linear: volts up to which output goes with light.
        full: volts that it never exceeds.
    """

    linear: float
    full: float

    def response(self, light: npt.ArrayLike) -> Values:
        """Volts out of light, given as the volts that a sensor without an end would put out."""
        x = np.asarray(light, np.float64)
        room = self.full - self.linear
        beyond = np.maximum(x - self.linear, 0)
        bent = self.linear - room * np.expm1(-beyond / room) if room > 0 else self.linear
        return np.where(x <= self.linear, x, bent)

    @property
    def output_gain(self) -> float:
        """dB of output between the two."""
        return decibels(self.full / self.linear)


DALSA: Final = FullWell(2.5, 3.4)
"""Wang et al., patent of 2017."""
