"""What the readouts have in common: which keys belong to which, the light step by step, the
instants, and times as they are told."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from cosim import BLOCK, Block, Clock, InputError, Lens, Light
from cosim.light.source import Source
from scenarios.assemble.scenario import Scenario
from sensor import CameraSetting
from sensor.device.crosstalk import crosstalk_map

__all__ = [
    "AFRESH", "choose_instants", "light_steps", "make_relay", "refuse_keys", "refuse_leftovers",
    "refuse_options", "with_section",
]  # fmt: skip

AFRESH = "run it afresh with another --out"
"""What mends an interrupted run that cannot be resumed."""

_SECTIONS = {
    "asynchronous": "asynchronous",
    "channel": "asynchronous",
    "continuous": "continuous",
    "circuit": "synchronous",
}
"""Sections of [sensor] that belong to one readout, and which."""


def refuse_leftovers(scenario: Scenario) -> None:
    """Raises InputError where a chip is given what only one of another readout has."""
    has = scenario.sensor.readout
    if scenario.sensor.source is not None and has != "synchronous":
        raise InputError(
            "sensor.source", "absent unless sensor.readout = synchronous", f"given with {has}",
            "leave it out: the board latches its spikes by a clock",
        )  # fmt: skip
    if scenario.display is not None and has != "synchronous":
        raise InputError(
            "display", "absent unless sensor.readout = synchronous", f"given with {has}",
            "leave it out, or set sensor.readout=synchronous",
        )  # fmt: skip
    for name, readout in _SECTIONS.items():
        if getattr(scenario.sensor, name) is not None and has != readout:
            raise InputError(
                f"sensor.{name}", f"given with sensor.readout = {readout}", f"with {has}",
                f"set sensor.readout={readout} or leave it out",
            )  # fmt: skip


def refuse_keys(readout: str, keys: Iterable[tuple[str, Any, Any]], mend: str) -> None:
    """Raises InputError where a key of [sensor] (name, value, plain) is not what pixels without
    its meaning have."""
    for name, value, plain in keys:
        if value != plain:
            must = "absent" if plain is None else plain
            raise InputError(f"sensor.{name}", f"{must} with readout = {readout}", str(value), mend)


def refuse_options(readout: str, resume: bool, device: str | None) -> None:
    """Raises InputError for options that only the synchronous camera has."""
    if resume:
        raise InputError("--resume", "for readout = synchronous", f"for {readout}", "run it afresh")
    if device is not None and device.lower() != "numba":
        raise InputError(
            "--device", f"numba with readout = {readout}", device, "leave it out: these pixels "
            "run on the processor",
        )  # fmt: skip


def with_section(scenario: Scenario, name: str, default: Any) -> Scenario:
    """The scenario with [sensor.name] written out."""
    if getattr(scenario.sensor, name) is not None:
        return scenario
    sensor = scenario.sensor.model_copy(update={name: default})
    return scenario.model_copy(update={"sensor": sensor})


def choose_instants(scenario: Scenario, cycles: int) -> list[int]:
    """Cycles of sensor.clock whose images are made; five evenly spaced ones unless given."""
    at = scenario.image.at or tuple(sorted({cycles * (2 * i + 1) // 10 for i in range(5)}))
    late = [n for n in at if n >= cycles]
    if late:
        raise InputError(
            "image.at", f"cycles below {cycles}", f"{late[0]}", "lengthen duration or drop it"
        )
    return list(at)


def make_relay(lens: Lens, camera: CameraSetting) -> Callable[[Light], Light]:
    """From the scene's light to what each pixel gathers: the lens, and cross-talk."""
    through = lens.relay(camera.chip.pitch)
    if not camera.crosstalk:
        return through
    mixed = crosstalk_map(camera.crosstalk)
    return lambda light: mixed(through(light))


def light_steps(
    source: Source,
    relay: Callable[[Light], Light],
    clock: Clock,
    stop: int,
    most: int | None = None,
) -> Iterator[tuple[Light, int, int]]:
    """(light on the pixels, start, stop) one after another up to `stop` (ps): the whole run at once
    where the light that the scene gives reaches so far, else blocks of the clock. most: cycles of
    a step, where they are limited."""
    cycle, start = 0, 0
    cycles = clock.cycle_at(stop - 1) + 1
    while start < stop:
        block = Block(cycle, min(BLOCK, most or BLOCK, cycles - cycle))
        light = relay(source.step(None, block))
        cycle = block.stop
        if light.pieces[-1].stop >= stop:
            cycle = cycles if most is None else min(cycles, block.start + most)
        until = min(stop, clock.edge(cycle))
        yield light, start, until
        start = until
