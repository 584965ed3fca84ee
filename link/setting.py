"""The numbers of a link's scenario: file, panel, lens, aim, air and camera."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from cosim import Clock, InputError, seconds_to_ps
from cosim.light.lens import FASTEST_F_NUMBER
from display import SpikePanel
from link.air import Aim, Air, AirSetting, Optics, Scene, Source, f_number_for
from link.air.geometry import lengths
from link.air.projection import Places
from link.coding import safe_name
from link.section import LinkScenario
from sensor import CameraSetting
from sensor.device.chips import ClockSteering
from sensor.sections.sensor import LensSection, SensorSection

LEAD, TAIL = 8, 4
"""Camera cycles before the panel's first light, and after its last plane."""
LARGEST = 1_000_000_000
"""Largest size of a file, bytes."""
SLOWEST_F_NUMBER = 1000.0
"""Largest f-number of a scenario; a pinhole."""
_MICRO = 1e-6
_RANDOM_NAME = "random.bin"
"""Name of the random bytes if no file is given."""
_STREAM_BYTES, _STREAM_PHASE = 0x4C494E4B, 0x50484153
"""Streams of random numbers of the payload and of the panel's phase; the key is the scenario's
seed."""


@dataclass(frozen=True)
class Payload:
    """What is sent.

    Attributes:
        name: name of the file in `received/`.
        data: its bytes.
    """

    name: str
    data: bytes


@dataclass(frozen=True)
class LinkSetting:
    """A link as it is simulated.

    Attributes:
        camera, panel, optics, aim, air: the parts.
        first_light: time at which the first row of the panel begins plane 0, ps.
        phase: delay of the panel's planes after the camera's ticks, ticks.
        scale: camera pixels for a panel pixel.
        chosen_f_number: whether the f-number follows from link.aim.on_level.
    """

    camera: CameraSetting
    panel: SpikePanel
    optics: Optics
    aim: Aim
    air: AirSetting
    first_light: int
    phase: float
    scale: float
    chosen_f_number: bool

    def make_air(
        self, source: Source, planes: int, effects: Collection[str] | None = None,
        places: Places | None = None,
    ) -> Air:  # fmt: skip
        """Stage that makes the light on the camera; see `Air` for its arguments."""
        return Air(
            source, Scene(self.panel, self.optics, self.aim, self.air), self.camera,
            first_light=self.first_light, planes=planes, effects=effects, places=places,
        )  # fmt: skip


def _random(seed: int, stream: int) -> np.random.Generator:
    return np.random.Generator(np.random.Philox(key=(stream << 32) | seed))


def payload_of(scenario: LinkScenario) -> Payload:
    """File, or random bytes of the scenario's seed. Raises InputError for a missing file."""
    section = scenario.link
    if section.file is None:
        return Payload(_RANDOM_NAME, _random(scenario.seed, _STREAM_BYTES).bytes(section.size))
    return read_payload(Path(section.file))


def read_payload(path: Path) -> Payload:
    """A file to send. Raises InputError for one that cannot be read."""

    def bad(problem: str) -> InputError:
        return InputError("link.file", "a file that can be read", f"{path} ({problem})", "check it")

    try:
        if path.is_dir():
            raise bad("a folder")
        size = path.stat().st_size
        if not path.is_file():
            raise bad("neither a file nor a folder")
        if size > LARGEST:
            raise InputError(
                "link.file",
                f"of at most {LARGEST:,} bytes",
                f"{size:,}",
                "choose another",
            )
        return Payload(safe_name(path.name), path.read_bytes())
    except OSError as exc:
        raise bad(exc.strerror or str(exc)) from exc


def _refuse_lens(lens: LensSection, section: str) -> None:
    """Raises InputError for a lens in the camera's section: that of a link is in [link.aim].

    Only the transmission is read from [sensor.lens].
    """
    plain = LensSection()
    for name in ("f_number", "white_rate", "magnification", "psf"):
        if getattr(lens, name) != getattr(plain, name):
            raise InputError(
                f"{section}.lens.{name}", "absent in a link", f"{getattr(lens, name)}",
                "leave it out: link.aim has the lens",
            )  # fmt: skip


def _panel_clock(clock: Clock, ppm: float) -> Clock:
    """Camera's nominal clock with an offset in parts per million."""
    rate = Fraction(clock.num, clock.den) * (1 + Fraction(repr(ppm)) / 10**6)
    return Clock(rate.numerator, rate.denominator)


def _optics(scenario: LinkScenario, camera: CameraSetting) -> Optics:
    """Panel and the lens, with its f-number or the one for the requested brightness."""
    section, panel, aim = scenario.link, scenario.link.panel, scenario.link.aim
    optics = Optics(
        width=panel.width, height=panel.height, pitch=panel.pitch * _MICRO,
        luminance=panel.luminance, reflectance=panel.reflectance,
        focal_length=aim.focal_length * _MICRO,
        f_number=FASTEST_F_NUMBER if aim.f_number is None else aim.f_number,
        transmission=scenario.sensor.lens.transmission,
        focus=None if aim.focus is None else aim.focus * _MICRO, blur=aim.blur,
        camera_pitch=camera.chip.pitch * _MICRO, wavelength_nm=scenario.sensor.wavelength,
    )  # fmt: skip
    if aim.f_number is not None:
        return optics
    number = f_number_for(
        aim.on_level, optics, section.distance * _MICRO, camera.threshold,
        camera.electrons_per_lux, camera.clock,
    )  # fmt: skip
    if number > SLOWEST_F_NUMBER:
        raise InputError(
            "link.aim.on_level", f"reached by a lens up to f/{SLOWEST_F_NUMBER:g}",
            f"{aim.on_level:g}, which needs f/{number:.3g}",
            "lower link.panel.luminance or give link.aim.f_number",
        )  # fmt: skip
    return replace(optics, f_number=number)


def check_receiver(sensor: SensorSection, name: str = "sensor") -> None:
    """Raises InputError for a camera that cannot receive a link.

    Args:
        sensor: its section.
        name: name of the section.
    """
    if sensor.pixel != "latched":
        raise InputError(
            f"{name}.pixel", "latched in a link", sensor.pixel, "leave it out"
        )  # fmt: skip
    for key in (
        "source",
        "asynchronous",
        "continuous",
        "channel",
        "sub_threshold",
        "dark_limit",
        "colour",
    ):
        if getattr(sensor, key) is not None:
            raise InputError(f"{name}.{key}", "absent in a link", "given", "leave it out")
    if sensor.clock_steering and sensor.reset != "hard":
        raise InputError(
            f"{name}.clock_steering", "true only with a hard reset, whose charge the loop knows "
            "after each spike", f"true with reset = {sensor.reset}", "leave it out",
        )  # fmt: skip
    if sensor.writes:
        raise InputError(f"{name}.writes", "empty in a link", "given", "leave them out")
    _refuse_lens(sensor.lens, name)


def steering_of(sensor: SensorSection) -> ClockSteering | None:
    """Steering of a link's camera; None if its ticks keep their length.

    By default it is used where the chip's board has it and the reset is hard.
    """
    if sensor.clock_steering is False or sensor.reset != "hard":
        return None
    return sensor.own_chip.steering


def link_setting(scenario: LinkScenario, camera: CameraSetting) -> LinkSetting:
    """Link of a scenario.

    Args:
        scenario: the scenario.
        camera: camera of [sensor], with every effect.

    Raises:
        InputError: if the scenario cannot be simulated.
    """
    section, sensor = scenario.link, scenario.sensor
    panel, aim, air = section.panel, section.aim, section.air
    distance = section.distance * _MICRO
    optics = _optics(scenario, camera)
    scale = lengths(optics, distance).camera * optics.pitch / distance
    row_scan = panel.row_scan
    if row_scan is None:  # each row of the image is shown when the camera samples it
        row_scan = min(sensor.row_skew * panel.height * scale / camera.chip.height, 1.0)
    phase = panel.phase
    if phase is None:
        phase = float(_random(scenario.seed, _STREAM_PHASE).random())
    spike_panel = SpikePanel(
        (panel.height, panel.width), _panel_clock(camera.clock, panel.clock_offset), 1.0, "impulse",
        rise=panel.rise, decay=panel.decay, row_scan=row_scan, fill=panel.fill,
        luminance=panel.luminance,
    )  # fmt: skip
    period = camera.clock.edge(1)
    return LinkSetting(
        camera, spike_panel, optics,
        Aim((aim.offset_x, aim.offset_y), aim.rotation, (aim.tilt_x, aim.tilt_y), aim.vibration,
            aim.vibration_frequency, aim.occluded,
            tuple((seconds_to_ps(a), seconds_to_ps(b)) for a, b in aim.blocked)),
        AirSetting(
            distance, air.ambient, air.surroundings,
            None if air.visibility is None else air.visibility * _MICRO, air.particles,
            air.structure, air.wind, air.sun, air.sun_angle, air.glare, scenario.seed,
        ),
        camera.clock.edge(LEAD) + round(phase * period), phase, scale, aim.f_number is None,
    )  # fmt: skip
