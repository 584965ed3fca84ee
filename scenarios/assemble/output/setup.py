"""The readout of a scenario: checked, before its chip is assembled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cosim import Clock, InputError
from cosim.clock import seconds_to_ps
from cosim.files.raw_layout import RAW_SIZE
from rtl_model.readout.buffer import Needs, RowBuffer, needed_rate
from rtl_model.readout.scan import BIT_RATE, ScanTiming, Window
from scenarios.assemble.schema.scenario import AnyScenario, LinkScenario, Scenario
from sensor.sections.readout import ReadoutSection
from sensor.sections.sensor import SensorSection


@dataclass(frozen=True)
class ReadoutSetup:
    """The readout of a run.

    Attributes:
        section: the section [readout].
        timing: timing of the row scan, with its window.
    """

    section: ReadoutSection
    timing: ScanTiming

    @property
    def rate(self) -> int:
        """Rate of the link behind the chip, bit/s."""
        given = self.section.rate
        return BIT_RATE if given is None else round(given)

    @property
    def needed_bps(self) -> int:
        """Least rate of the link at which nothing is lost, bit/s."""
        return needed_rate(self.timing, self.section.buffer)

    def buffer(self) -> RowBuffer:
        """A new buffer."""
        return RowBuffer(self.timing, self.rate, self.section.buffer)

    def needs(self, cycles: int) -> dict[str, Any]:
        """The key `readout` of `viform plan --json`, for a run of `cycles` cycles."""
        return Needs.of(self.buffer(), cycles, self.section.file).document()


def refuse_readout(scenario: AnyScenario, command: str) -> None:
    """Raises InputError for a scenario with [readout], for commands without one."""
    if getattr(scenario, "readout", None) is not None:
        raise InputError(
            "readout", f"absent for viform {command}", "given",
            "leave it out: there is no host in this command",
        )  # fmt: skip


def readout_of(scenario: AnyScenario) -> ReadoutSetup | None:
    """The readout of a scenario; None without one. Raises InputError for one that its chip cannot
    have."""
    if not isinstance(scenario, Scenario | LinkScenario) or scenario.readout is None:
        return None
    section, sensor = scenario.readout, scenario.sensor
    _check_chip(sensor, isinstance(scenario, LinkScenario))
    spans = []
    for name, size in (("rows", RAW_SIZE[1]), ("columns", RAW_SIZE[0])):
        first, stop = getattr(section, name) or (0, size)
        if stop > size:
            raise InputError(
                f"readout.{name}", f"[first, stop) within 0 to {size}", str([first, stop]),
                f"write [{min(first, size - 1)}, {size}]",
            )  # fmt: skip
        spans.append((first, stop - 1))
    timing = ScanTiming(Clock.from_hz(sensor.clock), Window(*spans))
    return ReadoutSetup(section, timing)


def _check_chip(sensor: SensorSection, steered: bool) -> None:
    """Raises InputError for a chip without such a readout. steered: whether a link may steer it."""
    chip = sensor.own_chip
    if (chip.width, chip.height) != RAW_SIZE:
        own = [f"sensor.{side}" for side in ("width", "height") if getattr(sensor, side)]
        without = f" without {' and '.join(own)}" if own else ""
        raise InputError(
            "readout", f"given with a chip of {RAW_SIZE[0]} x {RAW_SIZE[1]} pixels, whose markers "
            "are known", f"with {chip.width} x {chip.height}",
            f"set sensor.chip=spiketwo{without}, or leave it out",
        )  # fmt: skip
    if any(write.window is not None for write in sensor.writes or ()):
        raise InputError(
            "the windows of sensor.writes", "absent with a [readout], whose window is fixed",
            "given", "use readout.rows, or leave the readout out",
        )  # fmt: skip
    if steered and sensor.clock_steering is not False:
        raise InputError(
            "sensor.clock_steering", "false with a [readout]: a shortened tick has no room for its "
            "scan", "on", "write --set sensor.clock_steering=false",
        )  # fmt: skip


def run_cycles(scenario: AnyScenario) -> int | None:
    """Cycles of a run with a scene; None for that of a link, which its plan determines."""
    if not isinstance(scenario, Scenario):
        return None
    return Clock.from_hz(scenario.sensor.clock).cycles_in(seconds_to_ps(scenario.duration))
