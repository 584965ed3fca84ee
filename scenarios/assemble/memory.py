"""The memory that a run of any kind needs, before its machine is assembled.

A latched camera and its display compute theirs from the survey of their scene (`camera.memory`);
this is what is known of a scenario without its scene. The figures are fits to the peaks of runs:
of the small runs in tests/survival/commands.py, and of the same scenarios with the whole chip.
Events and reports of pixels without a clock depend on the light: they come on top, and are compared
with the free memory where they are collected.
"""

from __future__ import annotations

from typing import Any, Final

from cosim.compute.memory import check_program
from scenarios.assemble.schema.scenario import (
    AnyScenario,
    BoardScenario,
    ImagerScenario,
    LinkScenario,
    Scenario,
    StreamScenario,
)
from scenarios.assemble.source.latched.memory import DISPLAY, PROGRAM, SEEN, SHOWN

_MIB: Final = 1 << 20
_SMALLER: Final = "lower sensor.width and sensor.height, or close other programs"
_CLOCKLESS: Final = {"asynchronous": (300 * _MIB, 1100), "continuous": (340 * _MIB, 350)}
"""Bytes of the program, and a pixel, by the kind of pixel: 1.58 GiB of a run of 2 ms of
asynchronous 1000 x 800 pixels, .60 GiB of continuous ones."""
_LINK: Final = (610 * _MIB, 1430)
"""The same of a link, by the pixels of its camera: .74 GiB for 400 x 250, 2.0 GiB for 1000 x
1000."""
_IMAGER: Final = 360 * _MIB
"""Program of an imager with its pixels; those that ship take .29 to .42 GiB."""
_BOARD: Final = 250 * _MIB
_PROGRAM: Final = 330 * _MIB
"""Program that makes images of a stream of any other source: of a recording only its file states
the size."""


def _pixels(sensor: Any) -> int:
    chip = sensor.own_chip
    return int(chip.height * chip.width)


def _source(scenario: AnyScenario) -> int:
    """Bytes of the program with what makes the stream."""
    if isinstance(scenario, BoardScenario):
        return _BOARD
    if isinstance(scenario, ImagerScenario):
        return _IMAGER
    if isinstance(scenario, LinkScenario):
        program, each = _LINK
    elif isinstance(scenario, Scenario):
        program, each = _CLOCKLESS.get(scenario.sensor.pixel, (PROGRAM, 0))
    else:
        return _PROGRAM
    return program + each * _pixels(scenario.sensor)


def least_memory(scenario: AnyScenario) -> int:
    """Bytes that a run of a scenario needs at least."""
    need = _source(scenario)
    if not isinstance(scenario, StreamScenario):
        return need
    if scenario.link is not None and scenario.link.sensor is not None:
        need = max(need, _LINK[0] + _LINK[1] * _pixels(scenario.link.sensor))
    if scenario.display is not None:
        pixels = _pixels(scenario.sensor) if isinstance(scenario, Scenario) else 0
        need = max(need, SHOWN + (DISPLAY + SEEN) * pixels)
    return need


def check_need(scenario: AnyScenario) -> str | None:
    """What a run needs, as a note; None of a latched camera, which says it itself.

    Raises:
        InputError: if the free memory, or the limit of the address space, does not hold it.
    """
    need = least_memory(scenario)
    check_program("the memory of this run", need, _SMALLER)
    latched = getattr(getattr(scenario, "sensor", None), "pixel", None) == "latched"
    if latched and not isinstance(scenario, LinkScenario):
        return None
    return f"the run needs at least {need / 2**30:.2g} GiB of memory"
