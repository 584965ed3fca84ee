"""The supplies of the EMCCD: they come up one after the other, and go down in reverse.

Document 003: the FPGA controls the order in which the supplies come up, so that the EMCCD is safe.
It prints no order, no delay and no rail but RPhi2HV and RPhiDC, so the table is assumed, with the
voltages of such a chip. The order follows from the interlocks: no drain may be negative to the
substrate, clocks need the substrate, and the high voltage needs the clocks that empty the register
and the gate before it.

The sequencer waits a rail's delay, enables it, and waits until it is good; down, it disables a rail
and waits until it is off. A rail that is not good in time takes all down. A switch-off on the way
up waits for its end.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import repeat
from typing import Final, NamedTuple

INTERLOCKS: Final = (
    ("output_drain", "substrate"),
    ("reset_drain", "substrate"),
    ("dump_drain", "substrate"),
    ("substrate", "area_clocks"),
    ("substrate", "register_clocks"),
    ("register_clocks", "high_voltage"),
    ("dc_gate", "high_voltage"),
)
"""(first, second): the second rail must be off unless the first is good."""
_GOOD: Final = 0.95
"""Share of its voltage from which a rail is good; 1 - this is the share up to which it is off."""
_OFF: Final = 1.0 - _GOOD
_ROUNDING: Final = 1e-9
_PATIENCE: Final = 4.0
"""Ramps after which a rail that is not good has failed."""
_TICK: Final = 1e-5
"""s, of the sequencer."""


class Rail(NamedTuple):
    """A supply.

    Attributes:
        name: name in scenarios.
        pins: pins of the chip.
        volts: voltage when up.
        ramp: time from 0 to `volts`, and back, s.
        delay: time from the rail before being good to the enable, s.
    """

    name: str
    pins: str
    volts: float
    ramp: float
    delay: float


RAILS: Final = {
    rail.name: rail
    for rail in (
        Rail("output_drain", "OD", 28.0, 3e-3, 1e-3),
        Rail("reset_drain", "RD", 17.0, 2e-3, 1e-3),
        Rail("dump_drain", "DD", 24.0, 2e-3, 1e-3),
        Rail("substrate", "SS", 4.5, 1e-3, 2e-3),
        Rail("area_clocks", "IPhi, SPhi", 7.0, 1e-3, 1e-3),
        Rail("register_clocks", "RPhi, PhiR, DG", 12.0, 1e-3, 1e-3),
        Rail("dc_gate", "RPhiDC", 3.0, 1e-3, 1e-3),
        Rail("high_voltage", "RPhi2HV", 45.0, 5e-3, 5e-3),
    )
}
"""All values are assumed."""

ORDER: Final = tuple(RAILS)


def broken_interlock(order: Sequence[str]) -> tuple[str, str] | None:
    """The first interlock that an order of all rails breaks, or None."""
    broken = (pair for pair in INTERLOCKS if order.index(pair[0]) > order.index(pair[1]))
    return next(broken, None)


@dataclass
class Course:
    """The supplies over time.

    Attributes:
        volts: name -> voltage at each tick from the switch on.
        good: instant at which the last rail was good, s; None if never.
        dark: instant at which the last rail was off again, s; None if not yet.
        fault: name of the rail that has taken all down, or None.
    """

    volts: dict[str, list[float]]
    good: float | None = None
    dark: float | None = None
    fault: str | None = None

    @property
    def seconds(self) -> list[float]:
        """The instants of the ticks, s."""
        return [n * _TICK for n in range(len(self.volts[ORDER[0]]))]

    @property
    def now(self) -> float:
        """The instant of the last tick, s."""
        return (len(self.volts[ORDER[0]]) - 1) * _TICK

    def is_good(self, rail: str, tick: int = -1) -> bool:
        """Whether a rail is good at a tick."""
        return self.volts[rail][tick] >= _GOOD * RAILS[rail].volts * (1 - _ROUNDING)

    def is_off(self, rail: str, tick: int = -1) -> bool:
        """Whether a rail is off at a tick."""
        return self.volts[rail][tick] <= _OFF * RAILS[rail].volts * (1 + _ROUNDING)


@dataclass(frozen=True)
class Supplies:
    """The sequencer of the supplies.

    Attributes:
        order: names of all rails, as they come up.
        ramp, delay: ramp and delay of every rail, s; None for those of the table.
        failed: rail that gives no voltage, or None.
    """

    order: tuple[str, ...] = ORDER
    ramp: float | None = None
    delay: float | None = None
    failed: str | None = None

    @property
    def rails(self) -> list[Rail]:
        """The rails, in their order."""
        table = [RAILS[name] for name in self.order]
        if self.ramp is not None:
            table = [rail._replace(ramp=self.ramp) for rail in table]
        if self.delay is not None:
            table = [rail._replace(delay=self.delay) for rail in table]
        return table

    @property
    def switch_time(self) -> float:
        """Time from the switch to the last rail good, s, in closed form: the sum of the delays and
        of 0.95 of the ramps. Down it takes the first rail's delay less."""
        return sum(rail.delay + _GOOD * rail.ramp for rail in self.rails)

    def run(self, off: float | None = None) -> Course:
        """Course of the rails from the switch at 0 until all are good; with a switch-off at `off`
        s, or after a fault, until all are off."""
        rails, enabled = self.rails, set[str]()
        course = Course({name: [0.0] for name in self.order})
        for _ in self._sequence(rails, enabled, course, off):
            for rail in rails:
                rises = rail.name in enabled and rail.name != self.failed
                step = rail.volts * _TICK / rail.ramp * (1 if rises else -1)
                volts = course.volts[rail.name]
                volts.append(min(max(volts[-1] + step, 0.0), rail.volts))
        return course

    def _sequence(
        self, rails: list[Rail], enabled: set[str], course: Course, off: float | None
    ) -> Iterator[None]:
        """The sequencer; each value that it yields is a tick. Changes `enabled` and `course`."""
        for rail in rails:
            yield from repeat(None, _ticks(rail.delay))
            enabled.add(rail.name)
            for _ in range(_ticks(_PATIENCE * rail.ramp)):
                if course.is_good(rail.name):
                    break
                yield
            else:
                course.fault = rail.name
                break
        else:
            course.good = course.now
            if off is None:
                return
            yield from repeat(None, max(_ticks(off - course.good), 0))
        for rail in [rail for rail in rails if rail.name in enabled][::-1]:
            enabled.remove(rail.name)
            while not course.is_off(rail.name):
                yield
            yield from repeat(None, _ticks(rail.delay) if enabled else 0)
        course.dark = course.now


def _ticks(seconds: float) -> int:
    return round(seconds / _TICK)


def breaches(course: Course) -> list[tuple[int, str, str]]:
    """(tick, first, second) wherever the second rail of an interlock is not off while the first is
    not good: read from the voltages alone."""
    return [
        (tick, first, second)
        for first, second in INTERLOCKS
        for tick in range(len(course.volts[first]))
        if not course.is_off(second, tick) and not course.is_good(first, tick)
    ]
