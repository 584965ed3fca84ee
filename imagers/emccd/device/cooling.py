"""The cooling loop of the EMCCD at -10 degC: integer PID, drive limits, thermistor faults.

In every sample, the controller reads the thermistor code and sets a drive code, in integers with
gains in 1/4096:

    e = target - code;  u = (K_p e + I + K_d (e - e_before)) >> 12, limited to 0 .. top

The integral I grows by K_i e, except while u exceeds a limit and e would increase the excess
(conditional integration: Astrom and Hagglund, Advanced PID Control, 2006). It is also limited to
the range of the drive. Without these limits (`anti_windup=False`), the chip becomes too cold after
a period in which the air was too hot. The top is below the current at which the Peltier element
heats more than it cools, where the sign of the loop gain would change. A code outside the range of
a working thermistor is a fault and turns the drive off until `reset`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from cosim.compute.draws import normal
from cosim.compute.streams import Stream
from imagers.emccd.device.cold_plant import Plant, Temperatures, Thermistor
from imagers.emccd.pixels.chip import WORKING_KELVIN, ZERO_CELSIUS

Values = npt.NDArray[np.float64]
_FRACTION: Final = 12
"""Fractional bits of gains and integral."""
_BLOCK: Final = 256
"""Number of samples whose noise is drawn at once."""
Ambient = Callable[[float], float]
"""Time in s -> temperature of the air, K."""


class CoolingFault(Enum):
    """Fault that turns the drive off."""

    NONE = "none"
    OPEN = "thermistor open"
    SHORT = "thermistor short"


@dataclass(frozen=True)
class PidSettings:
    """Settings of the controller; all assumed, for a crossover near 0.1 rad/s with the default
    plant.

    Attributes:
        proportional: gain, 1/4096 drive code per thermistor code.
        integral: gain per sample, in the same unit.
        derivative: gain per difference of two samples, in the same unit.
        sample: sampling period, ps.
        top: largest drive code.
        amps: current at the largest drive code, A.
    """

    proportional: int = 27_000
    integral: int = 340
    derivative: int = 108_000
    sample: int = PS // 2
    top: int = 4095
    amps: float = 1.6

    def current(self, drive: int) -> float:
        """Current at a drive code, A."""
        return self.amps * drive / self.top


@dataclass
class Pid:
    """The controller.

    Attributes:
        settings: gains and limits.
        target: thermistor code of the target temperature.
        codes: lowest and highest code of a working thermistor.
        anti_windup: whether the integral is limited.
        fault: fault that turns the drive off.
        total: integral, 1/4096 drive code.
        before: error of the last sample; None before the first.
        drive: present drive code.
    """

    settings: PidSettings
    target: int
    codes: tuple[int, int]
    anti_windup: bool = True
    fault: CoolingFault = CoolingFault.NONE
    total: int = 0
    before: int | None = None
    drive: int = 0

    def reset(self) -> None:
        """Clears the fault, the integral and the drive."""
        self.fault, self.total, self.before, self.drive = CoolingFault.NONE, 0, None, 0

    def update(self, code: int) -> int:
        """Processes the code of one sample. Returns the drive code until the next sample."""
        low, high = self.codes
        if self.fault is CoolingFault.NONE and not low <= code <= high:
            self.fault = CoolingFault.SHORT if code < low else CoolingFault.OPEN
        if self.fault is not CoolingFault.NONE:
            self.total, self.before, self.drive = 0, None, 0
            return 0
        s = self.settings
        error = self.target - code
        change = 0 if self.before is None else error - self.before
        self.before = error
        grown = self.total + s.integral * error
        wanted = (s.proportional * error + grown + s.derivative * change) >> _FRACTION
        if not self.anti_windup:
            self.total = grown
        elif not ((wanted > s.top and error > 0) or (wanted < 0 and error < 0)):
            self.total = min(max(grown, 0), s.top << _FRACTION)
        wanted = (s.proportional * error + self.total + s.derivative * change) >> _FRACTION
        self.drive = min(max(wanted, 0), s.top)
        return self.drive


Break = Callable[[float], CoolingFault]
"""Time in s -> fault of the thermistor."""


@dataclass
class Cooler:
    """Plant and controller from power-on, with everything at ambient temperature.

    Attributes:
        ambient: temperature of the air, see `Ambient`.
        target: temperature of the chip, K.
        plant, thermistor: what is cooled, and its sensor.
        settings: settings of the controller.
        anti_windup: whether the integral is limited.
        seed: seed of the noise.
        noise: noise of the thermistor's converter, codes RMS (assumed).
        broken: faults of the thermistor, see `Break`.
    """

    ambient: Ambient = lambda _: ZERO_CELSIUS + 25.0
    target: float = WORKING_KELVIN
    plant: Plant = field(default_factory=Plant)
    thermistor: Thermistor = field(default_factory=Thermistor)
    settings: PidSettings = field(default_factory=PidSettings)
    anti_windup: bool = True
    seed: int = 1
    noise: float = 0.5
    broken: Break = lambda _: CoolingFault.NONE

    def __post_init__(self) -> None:
        t = self.thermistor
        if not t.coldest < self.target < t.hottest:
            raise ValueError(f"target must be {t.coldest:g} to {t.hottest:g} K, not {self.target}")
        air = float(self.ambient(0.0))
        self.state = Temperatures(air, air)
        self.pid = Pid(
            self.settings,
            t.code(self.target),
            (t.code(t.hottest), t.code(t.coldest)),
            self.anti_windup,
        )
        self.samples = 0
        self._block, self._drawn = -1, np.empty(0)

    @property
    def kelvin(self) -> float:
        """Temperature of the chip after the last sample, K."""
        return self.state.chip

    @property
    def fault(self) -> CoolingFault:
        """Fault that turns the drive off."""
        return self.pid.fault

    @property
    def amps(self) -> float:
        """Current through the Peltier element, A."""
        return self.settings.current(self.pid.drive)

    def _code(self, seconds: float) -> int:
        broken = self.broken(seconds)
        if broken is CoolingFault.OPEN:
            return self.thermistor.full
        if broken is CoolingFault.SHORT:
            return 0
        block, place = divmod(self.samples, _BLOCK)
        if block != self._block:
            numbers = np.arange(_BLOCK, dtype=np.int64)
            self._drawn = normal(numbers, block, self.seed, Stream.IMAGER_THERMAL)
            self._block = block
        return self.thermistor.code(self.state.chip, self.noise * float(self._drawn[place]))

    def step(self) -> None:
        """Runs one sample: reads the thermistor, sets the drive, and advances the plant."""
        seconds = self.samples * self.settings.sample / PS
        self.pid.update(self._code(seconds))
        air = self.ambient(seconds)
        self.state = self.plant.advance(self.state, self.amps, air, self.settings.sample / PS)
        self.samples += 1

    def advance(self, until: int) -> None:
        """Runs all samples that end by the instant `until`, ps."""
        while (self.samples + 1) * self.settings.sample <= until:
            self.step()


@dataclass(frozen=True, eq=False)
class CoolingRun:
    """The course of a cooler after each of n samples.

    Attributes:
        seconds: (n,) time, s, float64.
        chip, sink: (n,) temperatures, K, float64.
        amps: (n,) current, A, float64.
        faults: n faults.
    """

    seconds: Values
    chip: Values
    sink: Values
    amps: Values
    faults: list[CoolingFault]

    def settled(self, target: float, within: float) -> float | None:
        """Time from which the chip stays within `within` K of `target`, s; None if never."""
        outside = np.flatnonzero(np.abs(self.chip - target) > within)
        after = int(outside[-1]) + 1 if outside.size else 0
        return float(self.seconds[after]) if after < self.chip.size else None


def run_cooling(cooler: Cooler, seconds: float) -> CoolingRun:
    """Runs a cooler from its present state for `seconds`."""
    count = round(seconds * PS / cooler.settings.sample)
    rows, faults = np.empty((count, 4)), []
    for n in range(count):
        cooler.step()
        time = cooler.samples * cooler.settings.sample / PS
        rows[n] = time, cooler.state.chip, cooler.state.sink, cooler.amps
        faults.append(cooler.fault)
    return CoolingRun(rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3], faults)
