"""Electron multiplication: a packet of electrons passes S stages, in each of which every electron
makes one more with a small probability p.

Mean gain g = (1 + p)^S, so p = g^(1/S) - 1. The variance of one electron's output follows from the
branching recursion (Galton-Watson): g^2 v with v = (1 - 1/g)(1 - p)/(1 + p), so that Poisson
electrons come out with F^2 = 1 + v times the noise power of a gain without noise (Robbins and
Hadwen, IEEE Trans. Electron Devices 50:1227, 2003, in their notation).

Exact tier: `branch`, a binomial draw a stage. Fast tier: `multiply`, one draw of m + NegBin(k m, (g
- 1)/k): with k = 1 this is the distribution for infinitely many stages (a Yule process), and k = (g
- 1)/(g (1 - p)/(1 + p) - 1) gives exactly the variance of S stages. Moments from the third on are
not exact (`laws.py` measures the distance).

The gain follows from the high-voltage clock, which a digital potentiometer sets.

The document sets the peak of the clock RPhi2HV by a 256-step potentiometer in parallel with a fixed
resistor in a feedback network, which softens the exponential: 37 to 45 V in its text (section on
gain), 37 to 50 V in its summary. The range of the text is used, since it belongs to the description
of the circuit; `SUMMARY_PEAK` is the other. The gain is 1 to 1000 at the ends.

Impact ionisation: p = p_top exp((V - V_top)/v_s) a stage, and g = (1 + p)^S. g is never exactly 1
in this law, so v_s is chosen to give 1 within 1 % at the lower end (assumed). The document says
only that the gain is exponential in the peak voltage.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.compute.draws import negative_binomial, uniforms
from cosim.compute.streams import Stream
from imagers.emccd.pixels.chip import STAGES, WORKING_KELVIN

Values = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]
_ATTEMPTS: Final = 64
"""Counters reserved for a stage; a rejection needs more with probability below 1e-40."""
TEXT_PEAK: Final = (37.0, 45.0)
"""V, peak of the high-voltage clock in the document's text: the one that is used."""
SUMMARY_PEAK: Final = (37.0, 50.0)
"""V, in the document's summary, which contradicts its text."""
GAIN_STEPS: Final = 256
GAIN_RANGE: Final = (1.0, 1000.0)
_LOWEST: Final = 1.01
"""Gain at the lower end: 1 within 1 %."""


def stage_probability(gain: float, stages: int = STAGES) -> float:
    """p of one stage: g^(1/S) - 1. 1 <= gain <= 2^stages."""
    if not stages >= 1 or not gain >= 1 or math.log2(gain) > stages:
        raise ValueError(f"gain must be 1 to 2^stages, not {gain:g} in {stages} stages")
    return math.expm1(math.log(gain) / stages)


def excess_noise_squared(gain: float, stages: int = STAGES) -> float:
    """F^2 = 1 + (1 - 1/g)(1 - p)/(1 + p): 1 at gain 1, 1.901 at g = S = 100, 2 at the most."""
    p = stage_probability(gain, stages)
    return 1.0 + (1.0 - 1.0 / gain) * (1.0 - p) / (1.0 + p)


def fast_shape(gain: float, stages: int = STAGES) -> float:
    """k of the fast law, a little over 1 for many stages.

    Raises ValueError if the output of one electron has less variance than a Poisson count (gain of
    few stages): no negative binomial is so narrow, and the exact tier is needed.
    """
    p = stage_probability(gain, stages)
    if gain == 1.0:
        return 1.0
    over = gain * (1.0 - p) / (1.0 + p) - 1.0
    if not over > 0:
        raise ValueError(
            f"gain {gain:g} of {stages} stages must be drawn stage by stage, not by the fast law"
        )
    return (gain - 1.0) / over


@njit(cache=True, nogil=True)
def _binomial_one(count, p, pixel, frame, draw, seed, stream):  # type: ignore[no-untyped-def]
    """Binomial count, 0 < p <= 1/2: inversion where few are expected, else transformed rejection
    BTRS (Hoermann, J. Stat. Comput. Simul. 46:101, 1993)."""
    q = 1.0 - p
    if count * p < 10.0:
        u, _ = uniforms(pixel, frame, draw, seed, stream)
        odds = p / q
        term = math.exp(count * math.log1p(-p))
        total, k = term, 0
        while u > total and k < count:
            term *= odds * (count - k) / (k + 1.0)
            k += 1
            total += term
        return k
    spread = math.sqrt(count * p * q)
    b = 1.15 + 2.53 * spread
    a = -0.0873 + 0.0248 * b + 0.01 * p
    bound = 0.92 - 4.2 / b
    while True:
        u, v = uniforms(pixel, frame, draw, seed, stream)
        draw += 1
        u -= 0.5
        edge = 0.5 - abs(u)
        k = math.floor((2.0 * a / edge + b) * u + count * p + 0.5)
        if edge >= 0.07 and v <= bound:
            return int(k)
        if k < 0 or k > count:
            continue
        middle = math.floor((count + 1.0) * p)
        weight = (2.83 + 5.1 / b) * spread * v / (a / (edge * edge) + b)
        law = math.lgamma(middle + 1.0) + math.lgamma(count - middle + 1.0)
        law -= math.lgamma(k + 1.0) + math.lgamma(count - k + 1.0)
        if math.log(weight) <= law + (k - middle) * math.log(p / q):
            return int(k)


# A compiled kernel takes its arrays one by one: a record of them would be taken apart each call.
@njit(cache=True, nogil=True)
def _branch(electrons, p, stages, numbers, frame, seed, stream, out):  # type: ignore[no-untyped-def]
    flip = p > 0.5
    share = 1.0 - p if flip else p
    for n in range(electrons.size):
        held = electrons[n]
        if held > 0 and p > 0.0:
            for stage in range(stages):
                more = 0
                if share > 0.0:
                    draw = stage * _ATTEMPTS
                    more = _binomial_one(held, share, numbers[n], frame, draw, seed, stream)
                held += held - more if flip else more
        out[n] = held


def branch(
    electrons: npt.ArrayLike, gain: float, numbers: Numbers, frame: int, seed: int,
    stages: int = STAGES, stream: Stream = Stream.IMAGER_GAIN,
) -> npt.NDArray[np.int64]:  # fmt: skip
    """Exact tier: electrons after all stages, each stage a binomial draw. About 40 us a pixel.

    electrons: integers, of the shape of `numbers` or one for all. Draws have the key (seed, stream)
    and the counter (number, frame, stage).
    """
    p = stage_probability(gain, stages)
    held = np.broadcast_to(np.asarray(electrons, np.int64), numbers.shape)
    flat = np.ascontiguousarray(numbers, np.int64).reshape(-1)
    out = np.empty(numbers.size, np.int64)
    held = np.ascontiguousarray(held).reshape(-1)
    _branch(held, p, stages, flat, frame, seed, int(stream), out)
    return out.reshape(numbers.shape)


def multiply(
    electrons: npt.ArrayLike, gain: float, numbers: Numbers, frame: int, seed: int,
    stages: int = STAGES, stream: Stream = Stream.IMAGER_GAIN,
) -> Values:  # fmt: skip
    """Fast tier: one draw of m + NegBin(k m, (g - 1)/k), exact in mean and variance.

    electrons: as for `branch`; fractions are allowed (light without shot noise).
    """
    held = np.broadcast_to(np.asarray(electrons, np.float64), numbers.shape)
    if gain == 1.0:
        return held.copy()
    k = fast_shape(gain, stages)
    made = negative_binomial(k * held, (gain - 1.0) / k, numbers, frame, seed, stream)
    return held + made


@dataclass(frozen=True)
class HighVoltage:
    """The high-voltage drive of the multiplication register.

    Attributes:
        peak: V at the potentiometer's steps 0 and 255.
        stages: number of stages of the multiplication register.
        parallel: the potentiometer's full resistance over the fixed resistor's (0: none in
            parallel); assumed.
        kelvin: temperature at which the ends' gains hold.
        cooling: relative rise of p a kelvin of cooling; the gain's rise on cooling is reported, its
            size assumed.
        ageing: V by which use has moved the curve: the gain of a new chip takes so much more peak.
            That gains above 1000 age the register is reported, the law assumed.
    """

    peak: tuple[float, float] = TEXT_PEAK
    stages: int = STAGES
    parallel: float = 3.0
    kelvin: float = WORKING_KELVIN
    cooling: float = 0.005
    ageing: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.peak[0] < self.peak[1]:
            raise ValueError(f"peak must rise, not {self.peak}")
        if not 0 <= self.parallel < math.inf:
            raise ValueError(f"parallel must not be negative, not {self.parallel}")
        stage_probability(GAIN_RANGE[1], self.stages)

    @property
    def softness(self) -> float:
        """v_s, V in which p grows e-fold; 1.22 V for 37 to 45 V and 536 stages."""
        ends = [stage_probability(g, self.stages) for g in (_LOWEST, GAIN_RANGE[1])]
        return (self.peak[1] - self.peak[0]) / math.log(ends[1] / ends[0])

    def volts(self, step: int) -> float:
        """Peak at a step 0 to 255. The parallel resistance is x / (1 + rho x) of the full one for
        a share x of the potentiometer; the feedback makes the peak linear in it."""
        if not 0 <= step < GAIN_STEPS:
            raise ValueError(f"gain step must be 0 to {GAIN_STEPS - 1}, not {step}")
        x = step / (GAIN_STEPS - 1)
        share = x * (1.0 + self.parallel) / (1.0 + self.parallel * x)
        return self.peak[0] + (self.peak[1] - self.peak[0]) * share

    def gain_at(self, volts: float, kelvin: float | None = None) -> float:
        """Mean gain at a peak voltage and a chip temperature (the working one when None)."""
        top = stage_probability(GAIN_RANGE[1], self.stages)
        warmer = (self.kelvin if kelvin is None else kelvin) - self.kelvin
        over = volts - self.ageing - self.peak[1]
        log_p = math.log(top) + over / self.softness - self.cooling * warmer
        return math.exp(self.stages * math.log1p(math.exp(min(log_p, 0.0))))

    def slope(self, volts: float, kelvin: float | None = None) -> float:
        """d ln g / dV, 1/V: S p / ((1 + p) v_s), by which an error of the peak changes the gain."""
        p = stage_probability(self.gain_at(volts, kelvin), self.stages)
        return self.stages * p / (1.0 + p) / self.softness

    def gain(self, step: int, kelvin: float | None = None) -> float:
        """Mean gain at a step 0 to 255."""
        return self.gain_at(self.volts(step), kelvin)

    def table(self, kelvin: float | None = None) -> npt.NDArray[np.float64]:
        """(256,) gains, rising."""
        return np.array([self.gain(step, kelvin) for step in range(GAIN_STEPS)])

    def step_for(self, gain: float) -> int:
        """The step whose gain is nearest on a log scale, at the working temperature."""
        if not GAIN_RANGE[0] <= gain <= GAIN_RANGE[1]:
            raise ValueError(f"gain must be 1 to 1000, not {gain:g}")
        return int(np.argmin(np.abs(np.log(self.table() / gain))))
