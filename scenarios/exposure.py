"""The camera that a scenario asks for: the chip as it is run, and the lens, with its f-number or
the one that exposes white as it says."""

from __future__ import annotations

import math

from cosim import Clock, InputError
from cosim.lens import FASTEST_F_NUMBER, Lens
from scenarios.schema import Scenario
from sensor import CHIPS, CameraSetting, DevicePattern, dark_current

__all__ = ["camera_setting", "choose_lens", "lens_notes"]

SLOWEST_F_NUMBER = 1000.0
"""The largest that a scenario may give; a pinhole."""


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


def camera_setting(scenario: Scenario) -> CameraSetting:
    """The chip as the scenario runs it."""
    section, device = scenario.sensor, scenario.sensor.pattern
    clock = Clock.from_hz(section.clock)
    if section.dead_time > clock.period:
        raise InputError(
            "sensor.dead_time", f"at most a cycle, {float(clock.period):g} s",
            f"{section.dead_time:g} s", "shorten it",
        )  # fmt: skip
    if section.threshold_noise > section.threshold:
        raise InputError(
            "sensor.threshold_noise", f"at most the threshold, {section.threshold:g} e",
            f"{section.threshold_noise:g} e", "lower it",
        )  # fmt: skip
    pattern = None
    if device is not None:
        pattern = DevicePattern(
            prnu=device.prnu,
            dark=dark_current(device.dark_current, device.temperature),
            dsnu=device.dsnu,
            threshold_fpn=device.threshold_fpn,
            hot=device.hot_pixels,
            hot_current=device.hot_current,
            dead=device.dead_pixels,
            device_seed=device.device_seed,
        )
    return CameraSetting(
        CHIPS[section.chip],
        clock,
        section.threshold,
        scenario.seed,
        section.wavelength,
        pattern=pattern,
        threshold_noise=section.threshold_noise,
        reset=section.reset,
        dead_time=section.dead_time,
    )
