"""Exposure: the f-number that a scenario gives or leaves to the camera."""

from __future__ import annotations

import math

import pytest

from cosim import Clock, InputError, Lens
from scenarios.assemble.lens import LUMINANCE, choose_lens
from scenarios.assemble.schema.loading import load
from sensor import CHIPS, CameraSetting


def lens_of(*assignments: str) -> tuple[Lens, float]:
    """The lens of a film scenario and the spikes a cycle that white gives through it."""
    _, scenario = load("film", list(assignments))
    section = scenario.sensor
    setting = CameraSetting(
        CHIPS[section.chip], Clock.from_hz(section.clock), section.threshold, 1, section.wavelength
    )
    lens = choose_lens(scenario, setting).lens
    return lens, setting.rate(scenario.scene.illuminance * lens.gain)


@pytest.mark.parametrize(
    "assignments",
    [
        (),
        ("scene.illuminance=100 klx",),
        ("sensor.threshold=100 e", "sensor.clock=20 kHz"),
        ("sensor.lens.magnification=0.5", "sensor.lens.transmission=0.5"),
        ("sensor.wavelength=620 nm",),
    ],
)
def test_white_fires_at_0_6_a_cycle_unless_told_otherwise(assignments):
    assert lens_of(*assignments)[1] == pytest.approx(0.6, rel=1e-12)
    told = lens_of(*assignments, "sensor.lens.white_rate=0.25")
    assert told[1] == pytest.approx(0.25, rel=1e-12)


def test_the_f_number_follows_from_the_camera_equation():
    # 4.09e15 photons/(s m2 lx) x 100 um2 x QE 0.7 at 40 kHz and 1000 e: lux for 0.6 a cycle,
    # then E T / (4 N^2) solved for N.
    lux = 0.6 * 1000 * 40e3 / (4.09e15 * 1e-10 * 0.7)
    number = math.sqrt(700 * 0.9 / (4 * lux))
    assert lens_of()[0].f_number == pytest.approx(number, rel=2e-3)  # 4.09 is printed to 3 digits


def test_a_given_f_number_is_kept_and_what_saturates_is_said(film, tmp_path):
    lens, rate = lens_of("sensor.lens.f_number=0.7")
    assert lens.f_number == 0.7
    assert rate == pytest.approx(0.6 * (lens_of()[0].f_number / 0.7) ** 2)

    class Notes:
        def __init__(self) -> None:
            self.said: list[str] = []

        def start(self, what: str, total: int) -> None: ...
        def advance(self, done: int) -> None: ...
        def note(self, text: str) -> None:
            self.said.append(text)

    notes = Notes()
    result, _ = film(
        "step", tmp_path / "run", "scene.at=1 ms", "sensor.lens.f_number=0.7", progress=notes
    )
    assert result.metrics["white_rate"].value == pytest.approx(rate)
    assert result.metrics["f_number"].value == 0.7
    assert notes.said[0] == f"surfaces that reflect more than {1 / rate:.2g} of the light saturate"
    assert not any("chosen" in note for note in notes.said)


@pytest.mark.parametrize(
    ("assignments", "expected"),
    [
        (["scene.illuminance=1 lux"],
         "scene.illuminance must be at least 93.2 lux for white to fire at 0.6 a cycle through a "
         "lens from f/0.5 to f/1000, not 1 lux; raise it, lower sensor.threshold, or write "
         "--set sensor.lens.f_number=0.5"),
        (["scene.illuminance=1e9 lux", "sensor.threshold=1 e"],
         "scene.illuminance must be at most 372000 lux for white to fire at 0.6 a cycle through "
         "a lens from f/0.5 to f/1000, not 1e+09 lux; lower it, raise sensor.threshold, or write "
         "--set sensor.lens.f_number=1000"),
    ],
)  # fmt: skip
def test_light_that_no_lens_can_bring_to_the_rate_names_what_is_needed(assignments, expected):
    with pytest.raises(InputError) as caught:
        lens_of(*assignments)
    assert str(caught.value) == expected
    need = caught.value.must.split()[2]
    lens_of(
        *assignments,
        f"scene.illuminance={float(need) * (1.01 if 'least' in expected else 0.99)} lux",
    )


def test_a_refusal_before_a_panel_names_its_luminance():
    _, scenario = load("film", ["scene.illuminance=0.628318 lux"])  # pi times 0.2 cd/m2
    setting = CameraSetting(CHIPS["spiketwo"], Clock.from_hz(40e3), 1000.0, 1, 555.0)
    with pytest.raises(InputError, match=r"^display\.luminance .* cd/m² for .*, not 0\.2 cd/m²"):
        choose_lens(scenario, setting, LUMINANCE)
