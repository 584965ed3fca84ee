"""The lens that a scenario asks for: of its f-number, or the one that exposes white as it says."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from cosim import InputError, Light
from cosim.light.lens import FASTEST_F_NUMBER, Lens
from scenarios.assemble.schema.scenario import Scenario
from sensor.device.crosstalk import crosstalk_map
from sensor.latched.setting import CameraSetting

__all__ = ["LensChoice", "choose_lens", "make_relay"]

SLOWEST_F_NUMBER = 1000.0
"""The largest that a scenario may give; a pinhole."""


@dataclass(frozen=True)
class LensChoice:
    """How the scene's light reaches the chip.

    Attributes:
        lens: with its f-number, chosen or given.
        white_rate: spikes a cycle of the scene's white.
        notes: what the user must know of it.
    """

    lens: Lens
    white_rate: float
    notes: list[str]


def choose_lens(scenario: Scenario, setting: CameraSetting) -> LensChoice:
    """The lens of a scenario before this chip; without an f-number the one through which white
    fires at `sensor.lens.white_rate`.

    Raises:
        InputError: no lens from FASTEST_F_NUMBER to SLOWEST_F_NUMBER exposes white so.
    """
    section, lux = scenario.sensor.lens, scenario.scene.illuminance

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
        # The rounding of a chosen f-number must not show in the white that was asked for.
        white_rate = section.white_rate
        widest = setting.rate(lux * lens(FASTEST_F_NUMBER).gain)
        number = FASTEST_F_NUMBER * math.sqrt(widest / white_rate)
        if not FASTEST_F_NUMBER <= number <= SLOWEST_F_NUMBER:
            raise _out_of_range(number, lux, white_rate)
        chosen = lens(number)
        notes.append(f"f/{number:.3g} chosen so that white fires at {white_rate:.3g} a cycle")
    if white_rate > 1:
        notes.append(f"what reflects more than {1 / white_rate:.2g} of the light saturates")
    return LensChoice(chosen, white_rate, notes)


def _out_of_range(number: float, lux: float, white_rate: float) -> InputError:
    """number: the f-number that would expose white at `white_rate` under `lux`."""
    dark = number < FASTEST_F_NUMBER
    end = FASTEST_F_NUMBER if dark else SLOWEST_F_NUMBER
    need = lux * (end / number) ** 2 if number else math.inf
    return InputError(
        "scene.illuminance",
        f"at {'least' if dark else 'most'} {need:.3g} lux for white to fire at "
        f"{white_rate:g} a cycle through a lens from f/{FASTEST_F_NUMBER:g} to "
        f"f/{SLOWEST_F_NUMBER:g}",
        f"{lux:g} lux",
        f"{'raise' if dark else 'lower'} it, {'lower' if dark else 'raise'} sensor.threshold, "
        "or give sensor.lens.f_number",
    )


def make_relay(lens: Lens, setting: CameraSetting) -> Callable[[Light], Light]:
    """From the scene's light to what each pixel gathers: the lens, and cross-talk."""
    through = lens.relay(setting.chip.pitch)
    if not setting.crosstalk:
        return through
    mixed = crosstalk_map(setting.crosstalk)
    return lambda light: mixed(through(light))
