"""The lens of a scenario: with the f-number of the scenario, or one chosen for the spike rate of
white that the scenario sets."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from cosim import InputError, Light
from cosim.config.amounts import at_least, at_most
from cosim.light.lens import FASTEST_F_NUMBER, Lens
from cosim.light.mosaic import Mosaic
from scenarios.assemble.schema.scenario import Scenario
from sensor.device.crosstalk import crosstalk_map
from sensor.latched.setting import CameraSetting

SLOWEST_F_NUMBER = 1000.0
"""The largest f-number of a scenario; a pinhole."""


@dataclass(frozen=True)
class LightKey:
    """The key that states the light of white.

    Attributes:
        key, unit: Its name, and its unit.
        lux: Exitance of white for a unit of it, lux.
    """

    key: str
    unit: str
    lux: float


ILLUMINANCE: Final = LightKey("scene.illuminance", "lux", 1.0)
LUMINANCE: Final = LightKey("display.luminance", "cd/m²", math.pi)


@dataclass(frozen=True)
class LensChoice:
    """A lens and the exposure that it gives.

    Attributes:
        lens: the lens, with its f-number.
        white_rate: spike rate of the scene's white, spikes a cycle.
        notes: notes for the user.
    """

    lens: Lens
    white_rate: float
    notes: list[str]


def choose_lens(
    scenario: Scenario, setting: CameraSetting, light: LightKey = ILLUMINANCE
) -> LensChoice:
    """The lens of a scenario for this chip. Without an f-number in the scenario, white fires at
    `sensor.lens.white_rate` through the chosen lens.

    light: the key that states the light, for refusals.

    Raises:
        InputError: the f-number would be outside FASTEST_F_NUMBER to SLOWEST_F_NUMBER.
    """
    section, lux = scenario.sensor.lens, scenario.scene.illuminance
    mosaic = choose_mosaic(scenario)
    if mosaic is not None:  # white is that of the brightest colour
        lux *= mosaic.white

    def lens(f_number: float) -> Lens:
        return Lens(
            f_number, section.transmission, section.magnification, section.psf,
            scenario.sensor.wavelength,
        )  # fmt: skip

    notes = []
    if section.f_number is not None:
        chosen = lens(section.f_number)
        white_rate = setting.rate(lux * chosen.gain)
    else:
        # The rate of the scenario itself: the f-number's rounding must not change it.
        white_rate = section.white_rate
        widest = setting.rate(lux * lens(FASTEST_F_NUMBER).gain)
        number = FASTEST_F_NUMBER * math.sqrt(widest / white_rate)
        if not FASTEST_F_NUMBER <= number <= SLOWEST_F_NUMBER:
            raise _out_of_range(number, scenario.scene.illuminance, white_rate, light)
        chosen = lens(number)
        notes.append(f"f/{number:.3g} chosen so that white fires at {white_rate:.3g} a cycle")
    if white_rate > 1:
        notes.append(f"surfaces that reflect more than {1 / white_rate:.2g} of the light saturate")
    return LensChoice(chosen, white_rate, notes)


def choose_mosaic(scenario: Scenario) -> Mosaic | None:
    """The filter array of a scenario. Raises InputError for a lens that would mix its colours."""
    sensor = scenario.sensor
    if sensor.colour is None:
        return None
    if sensor.lens.psf != "none":
        raise InputError(
            "sensor.lens.psf", "none with sensor.colour: blur is computed for one colour",
            sensor.lens.psf, "leave it out",
        )  # fmt: skip
    from sensor.device.crosstalk import filter_array

    return filter_array(sensor.colour.filter, sensor.colour.depth, sensor.wavelength)


def _out_of_range(number: float, lux: float, white_rate: float, light: LightKey) -> InputError:
    """The error for `number`, the f-number at which white fires at `white_rate` in a scene of
    `lux`."""
    dark = number < FASTEST_F_NUMBER
    end = FASTEST_F_NUMBER if dark else SLOWEST_F_NUMBER
    given = lux / light.lux
    need = given * (end / number) ** 2 if number else math.inf
    limit = f"at least {at_least(need, 3)}" if dark else f"at most {at_most(need, 3)}"
    return InputError(
        light.key,
        f"{limit} {light.unit} for white to fire at "
        f"{white_rate:g} a cycle through a lens from f/{FASTEST_F_NUMBER:g} to "
        f"f/{SLOWEST_F_NUMBER:g}",
        f"{given:g} {light.unit}",
        f"{'raise' if dark else 'lower'} it, {'lower' if dark else 'raise'} sensor.threshold, "
        f"or write --set sensor.lens.f_number={end:g}",  # in reach, whatever the limits of the key
    )


def make_relay(lens: Lens, setting: CameraSetting) -> Callable[[Light], Light]:
    """The map from the light of the scene to the light that each pixel collects, by the lens and by
    cross-talk."""
    through = lens.relay(setting.chip.pitch)
    if not setting.crosstalk:
        return through
    mixed = crosstalk_map(setting.crosstalk)
    return lambda light: mixed(through(light))
