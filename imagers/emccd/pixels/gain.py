"""Gain as a function of the high-voltage clock, which a digital potentiometer sets.

The document sets the peak of the clock RPhi2HV by a 256-step potentiometer in parallel with a fixed
resistor in a feedback network, which softens the exponential: 37 to 45 V in its text (section on
gain), 37 to 50 V in its summary. The range of the text is used, since it belongs to the description
of the circuit; `SUMMARY_PEAK` is the other. The gain is 1 to 1000 at the ends.

Impact ionisation: p = p_top exp((V - V_top)/v_s) a stage, and g = (1 + p)^S. g is never exactly 1
in this law, so v_s is chosen to give 1 within 1 % at the lower end (assumed). The document says
only that the gain is exponential in the peak voltage (`document_gain`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from imagers.emccd.pixels.chip import STAGES, WORKING_KELVIN
from imagers.emccd.pixels.multiplication import stage_probability

__all__ = [
    "GAIN_RANGE",
    "GAIN_STEPS",
    "SUMMARY_PEAK",
    "TEXT_PEAK",
    "HighVoltage",
    "document_gain",
]

TEXT_PEAK: Final = (37.0, 45.0)
"""V, peak of the high-voltage clock in the document's text: the one that is used."""
SUMMARY_PEAK: Final = (37.0, 50.0)
"""V, in the document's summary, which contradicts its text."""
GAIN_STEPS: Final = 256
GAIN_RANGE: Final = (1.0, 1000.0)
_LOWEST: Final = 1.01
"""Gain at the lower end: 1 within 1 %."""


def document_gain(volts: float, peak: tuple[float, float] = TEXT_PEAK) -> float:
    """Gain at a peak voltage if it were purely exponential, 1 to 1000 over `peak`."""
    share = (volts - peak[0]) / (peak[1] - peak[0])
    return GAIN_RANGE[0] * (GAIN_RANGE[1] / GAIN_RANGE[0]) ** share


@dataclass(frozen=True)
class HighVoltage:
    """The high-voltage drive of the multiplication register.

    Attributes:
        peak: V at the potentiometer's steps 0 and 255.
        stages: of the multiplication register.
        parallel: the potentiometer's full resistance over the fixed resistor's (0: none in
            parallel); assumed.
        kelvin: at which the ends' gains hold.
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
