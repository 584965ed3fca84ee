"""What a refusal proposes is accepted. Random scenarios (tests/fuzz) have found these."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest

SMALL = ("sensor.width=24", "sensor.height=16", "duration=2 ms")
CASES = {
    "a lens for dim light": (
        ("step", "scene.illuminance=1 lux", "sensor.threshold=1234 e"),
        r"scene\.illuminance must be at least (?P<value>\S+ lux)", "scene.illuminance"),
    "a lens for bright light": (
        ("step", "scene.illuminance=1e9 lux", "sensor.threshold=1.3 e"),
        r"scene\.illuminance must be at most (?P<value>\S+ lux)", "scene.illuminance"),
    "a lens for the brightest colour": (
        ("step", "scene.illuminance=1 lux", "sensor.colour.filter=rggb"),
        r"scene\.illuminance must be at least (?P<value>\S+ lux)", "scene.illuminance"),
    "a comparator's delay": (
        ("step", "sensor.clock=10.62025 kHz", "sensor.comparator_delay=1 ms",
         "duration=9 ms"),
        r"at most a cycle, (?P<value>\S+ s)", "sensor.comparator_delay"),
    "threshold noise with that of a capacitance": (
        ("step", "sensor.threshold=100 e", "sensor.capacitance=15 fF",
         "sensor.threshold_noise=90 e"),
        r"at most the threshold less the kTC noise of \S+ e, (?P<value>\S+ e)",
        "sensor.threshold_noise"),
    "threshold noise with that of a hot capacitance": (
        ("step", "sensor.threshold=2e6 e", "scene.illuminance=1e6 lux",
         "sensor.capacitance=1e6 fF", "sensor.pattern.temperature=150 degC",
         "sensor.threshold_noise=30000 e"),
        r"at most 32768 e less the kTC noise of \S+ e, (?P<value>\S+ e)",
        "sensor.threshold_noise"),
    "a capacitance": (
        ("step", "sensor.capacitance=1e6 fF"),
        r"sensor\.capacitance must be at most (?P<value>\S+ fF)", "sensor.capacitance"),
    "a chamber": (
        ("shockwave", "scene.mach=4.57365", "scene.chamber=100 kPa", "image.at=[40]"),
        r"scene\.chamber must be \S+ to (?P<value>\S+ Pa)", "scene.chamber"),
    "a clock for slow rows": (
        ("step", "sensor.row_time=2096.62 ns", "sensor.height=64", "duration=9 ms"),
        r"sensor\.clock must be at most (?P<value>\S+ Hz)", "sensor.clock"),
    "a panel in the colours of the camera": (
        ("glass", "display.colour=as-camera", "display.fit=nearest", "sensor.colour.filter=rggb"),
        r"write --set display\.fit=(?P<value>\w+)", "display.fit"),
    "planes of a panel": (
        ("glass", "sensor.clock=50 Hz", "duration=0.5 s"),
        r"sensor\.clock must be at least (?P<value>\S+ Hz) with a display", "sensor.clock"),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_a_refusal_proposes_is_accepted(
    case: str, viform: Callable[..., tuple[int, str, str]]
) -> None:
    (name, *sets), pattern, key = CASES[case]
    words = [word for each in (*SMALL, *sets) for word in ("--set", each)]
    code, out, err = viform("plan", name, *words)
    assert (code, out) == (2, "")
    proposed = re.search(pattern, err)
    assert proposed, err
    code, _, err = viform("plan", name, *words, "--set", f"{key}={proposed['value']}")
    assert code == 0, err


def test_rows_that_no_plane_of_a_panel_holds_are_refused_by_their_own_time(
    viform: Callable[..., tuple[int, str, str]], refused: Callable[..., str]
) -> None:
    sets = (*SMALL, "duration=0.5 s", "sensor.clock=80 Hz", "sensor.row_time=700 us")
    words = ["plan", "glass", *(word for s in sets for word in ("--set", s))]
    said = refused(*words)
    assert said.startswith("sensor.row_time must be at most 0.000625 s with a display: 16 rows")
    mended = ("sensor.row_time=0.000625 s", "sensor.clock=100 Hz")
    assert viform(*words, *(word for s in mended for word in ("--set", s)))[0] == 0


def test_a_panel_in_colours_is_not_told_another_fit(refused: Callable[..., str]) -> None:
    sets = (*SMALL, "sensor.colour.filter=rggb", "display.colour=as-camera", "display.width=2")
    said = refused("plan", "glass", *(word for s in sets for word in ("--set", s)))
    assert said.startswith("display.width and display.height must be the stream's 24 x 16")
    assert said.endswith("not 2 x 16; leave them out")


def test_a_run_without_a_cycle_is_refused_before_its_readings(refused: Callable[..., str]) -> None:
    sets = (*SMALL, "sensor.clock=20 Hz", "sensor.sub_threshold.limit=1 s")
    said = refused("plan", "step", *(word for s in sets for word in ("--set", s)))
    assert said.startswith("duration must be at least image.window = 41 cycles, not 0 cycles")


def test_a_circuit_that_overshoots_by_half_the_threshold_is_refused(
    refused: Callable[..., str],
) -> None:
    sets = ("clock=3.3e-5 Hz", "circuit.capacitance=400 fF", "circuit.trip=100 V",
            "circuit.reset_time=9 s")  # fmt: skip
    said = refused("plan", "step", *(word for s in sets for word in ("--set", f"sensor.{s}")))
    assert said.startswith(
        "sensor.circuit must be one whose comparator overshoots by less than half the threshold, "
        "500 e, not one that does by 249"
    )
