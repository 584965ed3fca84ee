"""The camera that a scenario asks for: the chip as it is run, and the lens, with its f-number or
the one that exposes white as it says."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from cosim import Clock, InputError
from cosim.light.lens import FASTEST_F_NUMBER, Lens
from scenarios.assemble.schema.scenario import LinkScenario, Scenario
from sensor.device.chips import CHIPS
from sensor.latched.effects.effect import Operation
from sensor.latched.setting import CameraSetting
from sensor.sections.parameters import effect_parameters

__all__ = [
    "LensedCamera",
    "camera_setting",
    "choose_lens",
    "lens_notes",
    "lensed_camera",
    "resized",
]

SLOWEST_F_NUMBER = 1000.0
"""The largest that a scenario may give; a pinhole."""


@dataclass(frozen=True)
class LensedCamera:
    """A latched camera behind its lens.

    Attributes:
        setting: the camera with every effect.
        lens: with its f-number, chosen or given.
        white_rate: spikes a cycle of the scene's white.
        notes: what the user must know of the exposure.
    """

    setting: CameraSetting
    lens: Lens
    white_rate: float
    notes: list[str]


def lensed_camera(scenario: Scenario, size: tuple[int, int] | None = None) -> LensedCamera:
    """The camera of a scenario behind its lens. size: rows and columns of a board that stands in
    for the chip. Raises InputError for what cannot be simulated."""
    setting = camera_setting(scenario)
    if size is not None:
        setting = resized(setting, size[1], size[0])
    lens = choose_lens(scenario, setting)
    # The rounding of a chosen f-number must not show in the white that was asked for.
    white_rate = (
        setting.rate(scenario.scene.illuminance * lens.gain)
        if scenario.sensor.lens.f_number is not None
        else scenario.sensor.lens.white_rate
    )
    return LensedCamera(setting, lens, white_rate, lens_notes(scenario, lens, white_rate))


def choose_lens(scenario: Scenario, setting: CameraSetting) -> Lens:
    """The scenario's lens; without an f-number the one that lets white fire at white_rate."""
    section, lux = scenario.sensor.lens, scenario.scene.illuminance

    def lens(f_number: float) -> Lens:
        return Lens(
            f_number,
            section.transmission,
            section.magnification,
            section.psf,
            scenario.sensor.wavelength,
        )

    if section.f_number is not None:
        return lens(section.f_number)
    widest = setting.rate(lux * lens(FASTEST_F_NUMBER).gain)
    number = FASTEST_F_NUMBER * math.sqrt(widest / section.white_rate)
    if FASTEST_F_NUMBER <= number <= SLOWEST_F_NUMBER:
        return lens(number)
    dark = number < FASTEST_F_NUMBER
    end = FASTEST_F_NUMBER if dark else SLOWEST_F_NUMBER
    need = lux * (end / number) ** 2 if number else math.inf
    raise InputError(
        "scene.illuminance",
        f"at {'least' if dark else 'most'} {need:.3g} lux for white to fire at "
        f"{section.white_rate:g} a cycle through a lens from f/{FASTEST_F_NUMBER:g} to "
        f"f/{SLOWEST_F_NUMBER:g}",
        f"{lux:g} lux",
        f"{'raise' if dark else 'lower'} it, {'lower' if dark else 'raise'} sensor.threshold, "
        "or give sensor.lens.f_number",
    )


def lens_notes(scenario: Scenario, lens: Lens, white_rate: float) -> list[str]:
    """What a user must know of the exposure."""
    notes = []
    if scenario.sensor.lens.f_number is None:
        notes.append(
            f"f/{lens.f_number:.3g} chosen so that white fires at {white_rate:.3g} a cycle"
        )
    if white_rate > 1:
        notes.append(f"what reflects more than {1 / white_rate:.2g} of the light saturates")
    return notes


def resized(setting: CameraSetting, width: int | None, height: int | None) -> CameraSetting:
    """The camera with an array of this size, its own where None."""
    chip = replace(
        setting.chip,
        width=width or setting.chip.width,
        height=height or setting.chip.height,
        assumed=setting.chip.assumed
        | ({"width"} if width else set())
        | ({"height"} if height else set()),
    )
    return replace(setting, chip=chip)


def camera_setting(scenario: Scenario | LinkScenario) -> CameraSetting:
    """The chip as the scenario runs it."""
    section, device = scenario.sensor, scenario.sensor.pattern
    clock = Clock.from_hz(section.clock)
    # The levels are taken to be those of a linear reference; what they are is not published.
    threshold = section.threshold * section.threshold_level / CHIPS[section.chip].threshold_levels
    if threshold < 1:
        raise InputError(
            "sensor.threshold_level", "one at which the threshold is at least 1 e",
            f"{section.threshold_level} of {section.threshold:g} e", "raise it",
        )  # fmt: skip
    return CameraSetting(
        CHIPS[section.chip],
        clock,
        threshold,
        scenario.seed,
        section.wavelength,
        reset=section.reset,
        parameters=effect_parameters(
            section, Operation(clock, threshold, 25.0 if device is None else device.temperature)
        ),
    )
