"""The camera that a scenario asks for: the chip as it is run, and the lens, with its f-number or
the one that exposes white as it says."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from cosim import Clock, InputError
from cosim.light.lens import FASTEST_F_NUMBER, Lens
from scenarios.assemble.schema.scenario import LinkScenario, Scenario
from sensor import CHIPS, CameraSetting, DevicePattern, dark_current, ktc_electrons
from sensor.circuit import Circuit, Lumped
from sensor.sections.sensor import SensorSection

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
FAINTEST = 1e-3
"""Spikes a cycle down to which a circuit is lumped."""
ZERO_CELSIUS = 273.15
"""Kelvin at 0 degC."""


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


def _circuit(
    section: SensorSection, threshold: float, clock: Clock
) -> tuple[Circuit | None, Lumped | None]:
    """The pixel's circuit, and its lumped form between FAINTEST and one spike a cycle."""
    if section.circuit is None:
        return None, None
    if section.reset != "residual":
        raise InputError(
            "sensor.reset", "residual with sensor.circuit: its own switch resets the pixel",
            section.reset, "leave one of them out",
        )  # fmt: skip
    if section.dead_time > 0:
        raise InputError(
            "sensor.dead_time", "0 with sensor.circuit, whose reset_time it is",
            f"{section.dead_time:g} s", "leave one of them out",
        )  # fmt: skip
    circuit = section.circuit.circuit
    most = threshold * clock.hz
    try:
        lumped = circuit.lumped(threshold, FAINTEST * most, most)
    except ValueError as exc:
        raise InputError(
            "sensor.circuit", "one that the pixel can work with", str(exc), "change it"
        ) from exc
    period = float(clock.period)
    if not (lumped.bound < 1 and lumped.dead_time <= period):
        raise InputError(
            "sensor.circuit", f"one that fires at {FAINTEST:g} to 1 spike a cycle and is ready "
            f"again within a cycle, {period:g} s", "one that does not", "raise leak or bandwidth, "
            "or lower trip or reset_time",
        )  # fmt: skip
    return circuit, lumped


def camera_setting(scenario: Scenario | LinkScenario) -> CameraSetting:
    """The chip as the scenario runs it."""
    section, device = scenario.sensor, scenario.sensor.pattern
    clock = Clock.from_hz(section.clock)
    for name, seconds in (
        ("dead_time", section.dead_time),
        ("comparator_delay", section.comparator_delay),
    ):
        if seconds > float(clock.period):
            raise InputError(
                f"sensor.{name}", f"at most a cycle, {float(clock.period):g} s", f"{seconds:g} s",
                "shorten it",
            )  # fmt: skip
    # The levels are taken to be those of a linear reference; what they are is not published.
    threshold = section.threshold * section.threshold_level / CHIPS[section.chip].threshold_levels
    if threshold < 1:
        raise InputError(
            "sensor.threshold_level", "one at which the threshold is at least 1 e",
            f"{section.threshold_level} of {section.threshold:g} e", "raise it",
        )  # fmt: skip
    ktc = 0.0
    if section.capacitance is not None:
        celsius = 25.0 if device is None else device.temperature
        ktc = ktc_electrons(section.capacitance * 1e-15, celsius + ZERO_CELSIUS)
    noise = math.hypot(section.threshold_noise, ktc)
    if noise > threshold:
        raise InputError(
            "sensor.threshold_noise", f"at most the threshold, {threshold:g} e",
            f"{noise:g} e" + (" with kTC" if ktc else ""), "lower it",
        )  # fmt: skip
    circuit, lumped = _circuit(section, threshold, clock)
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
        threshold,
        scenario.seed,
        section.wavelength,
        pattern=pattern,
        threshold_noise=noise,
        reset=section.reset,
        dead_time=section.dead_time if lumped is None else lumped.dead_time,
        row_skew=section.row_skew,
        comparator_delay=section.comparator_delay,
        crosstalk=section.crosstalk,
        circuit=circuit,
        overshoot=0.0 if lumped is None else lumped.shift,
        leak=0.0 if lumped is None else lumped.dark_current,
        lumped_error=0.0 if lumped is None else lumped.bound,
    )
