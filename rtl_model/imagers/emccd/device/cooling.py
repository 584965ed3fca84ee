"""The loop that holds an EMCCD at -10 degC: integer PID, drive limits, faults of the thermistor.

Every sample the thermistor's code is read and a drive code is set, in whole numbers, gains in
1/4096:

    e = target - code;  u = (K_p e + I + K_d (e - e_before)) >> 12, limited to 0 .. top

The integral I grows by K_i e, but not while u is over a limit and e would push it further
(conditional integration: Astrom and Hagglund, Advanced PID Control, 2006), and is itself kept
within the drive's range. Without that (`anti_windup=False`) a day too hot is paid for with a chip
too cold. The top is a current below the one at which the Peltier element heats more than it cools,
where the loop's sign would turn. A code that no working thermistor gives turns the drive off, by
name, until `reset`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from cosim.compute.streams import Stream
from rtl_model.imagers.emccd.device.cold_plant import Plant, Temperatures, Thermistor
from sensor.imagers import normal
from sensor.imagers.emccd.chip import WORKING_KELVIN, ZERO_CELSIUS

__all__ = ["Cooler", "CoolingFault", "CoolingRun", "Pid", "PidSettings", "run_cooling"]

Values = npt.NDArray[np.float64]

_FRACTION: Final = 12
"""Bits behind the point of gains and integral."""


_BLOCK: Final = 256
"""Samples whose noise is drawn together."""


class CoolingFault(Enum):
    """Why a drive is off."""

    NONE = "none"
    OPEN = "thermistor open"
    SHORT = "thermistor short"


@dataclass(frozen=True)
class PidSettings:
    """Gains in 1/4096 of a drive code a thermistor code (a sample, for the integral; a difference
    of samples, for the derivative). sample: ps between samples. top: largest drive code. amps: at
    the top. All assumed: a crossover near .1 rad/s for the default plant."""

    proportional: int = 27_000
    integral: int = 340
    derivative: int = 108_000
    sample: int = PS // 2
    top: int = 4095
    amps: float = 1.6

    def current(self, drive: int) -> float:
        """A at a drive code."""
        return self.amps * drive / self.top


@dataclass
class Pid:
    """The controller's registers. codes: those that a working thermistor gives, lowest and
    highest."""

    settings: PidSettings
    target: int
    codes: tuple[int, int]
    anti_windup: bool = True
    fault: CoolingFault = CoolingFault.NONE
    total: int = 0
    before: int | None = None
    drive: int = 0

    def reset(self) -> None:
        """Forgets a fault and the integral."""
        self.fault, self.total, self.before, self.drive = CoolingFault.NONE, 0, None, 0

    def update(self, code: int) -> int:
        """One sample: the drive code for the next."""
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


Ambient = Callable[[float], float]
"""Kelvin of the air at a time in seconds."""
Break = Callable[[float], CoolingFault]
"""What is wrong with the thermistor at a time in seconds."""


@dataclass
class Cooler:
    """Plant and controller, advanced to instants in ps from power-on, when all is at ambient.

    target: K. noise: of the thermistor's converter, codes RMS (assumed). broken: see `Break`.
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
        """Of the chip, after the last sample."""
        return self.state.chip

    @property
    def fault(self) -> CoolingFault:
        """Why the drive is off."""
        return self.pid.fault

    @property
    def amps(self) -> float:
        """Through the Peltier element."""
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
        """One sample: read, set, and heat flows until the next."""
        seconds = self.samples * self.settings.sample / PS
        self.pid.update(self._code(seconds))
        air = self.ambient(seconds)
        self.state = self.plant.advance(self.state, self.amps, air, self.settings.sample / PS)
        self.samples += 1

    def advance(self, until: int) -> None:
        """All samples whose span has ended by the instant `until`, ps."""
        while (self.samples + 1) * self.settings.sample <= until:
            self.step()


@dataclass(frozen=True, eq=False)
class CoolingRun:
    """seconds, chip and sink in K, amps: (n,) float64, after each sample. faults: (n,)."""

    seconds: Values
    chip: Values
    sink: Values
    amps: Values
    faults: list[CoolingFault]

    def settled(self, target: float, within: float) -> float | None:
        """Seconds from which the chip stays within so many kelvin of the target; None if never."""
        outside = np.flatnonzero(np.abs(self.chip - target) > within)
        after = int(outside[-1]) + 1 if outside.size else 0
        return float(self.seconds[after]) if after < self.chip.size else None


def run_cooling(cooler: Cooler, seconds: float) -> CoolingRun:
    """Runs a cooler from where it stands for so long."""
    count = round(seconds * PS / cooler.settings.sample)
    rows, faults = np.empty((count, 4)), []
    for n in range(count):
        cooler.step()
        time = cooler.samples * cooler.settings.sample / PS
        rows[n] = time, cooler.state.chip, cooler.state.sink, cooler.amps
        faults.append(cooler.fault)
    return CoolingRun(rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3], faults)
