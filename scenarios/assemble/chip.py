"""The chip of a scenario, its operating point, and the parameters of its effects."""

from __future__ import annotations

from dataclasses import replace

from cosim import Clock, InputError
from scenarios.assemble.schema.scenario import LinkScenario, Scenario
from sensor.device.chips import Chip
from sensor.latched.effects.effect import Operation
from sensor.latched.setting import CameraSetting
from sensor.sections.own_chip import LEVELS, register_writes
from sensor.sections.provenance import effect_parameters


def camera_setting(
    scenario: Scenario | LinkScenario, height: int | None = None, width: int | None = None
) -> CameraSetting:
    """The chip of a scenario with every effect.

    Args:
        scenario: a scenario with a section [sensor].
        height, width: size of the array, pixels, in place of the chip's; None for that of the chip.

    Raises:
        InputError: the threshold is below one electron, or parameters are not physical.
    """
    section, device = scenario.sensor, scenario.sensor.pattern
    chip, clock = _resized(section.own_chip, height, width), Clock.from_hz(section.clock)
    # The threshold levels are assumed to be linear; they are not published.
    threshold = section.threshold * section.threshold_level / chip.threshold_levels
    writes = section.writes or ()
    least = min(section.threshold_level, *(w.threshold_level or LEVELS for w in writes), LEVELS)
    if section.threshold * least / chip.threshold_levels < 1:
        raise InputError(
            "sensor.threshold_level", "one at which the threshold is at least 1 e",
            f"{least} of {section.threshold:g} e", "raise it",
        )  # fmt: skip
    beyond = [write.window for write in writes if write.window is not None]
    if any(window[1] > chip.height for window in beyond):
        raise InputError(
            "the windows of sensor.writes", f"rows within 0 to {chip.height}",
            str([list(window) for window in beyond]), "change them",
        )  # fmt: skip
    temperature = 25.0 if device is None else device.temperature
    # Noise must fit the lowest threshold, too.
    effect_parameters(section, Operation(clock, section.threshold * least / LEVELS, temperature))
    return CameraSetting(
        chip, clock, threshold, scenario.seed, section.wavelength, reset=section.reset,
        parameters=effect_parameters(section, Operation(clock, threshold, temperature)),
        writes=register_writes(section, clock),
    )  # fmt: skip


def _resized(chip: Chip, height: int | None, width: int | None) -> Chip:
    assumed = {name for name, size in (("height", height), ("width", width)) if size is not None}
    return replace(
        chip, height=height or chip.height, width=width or chip.width,
        assumed=chip.assumed | assumed,
    )  # fmt: skip
