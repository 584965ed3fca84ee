"""`viform design dynamic-range`: the best of a budget, its document, its picture, bad input."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from cosim import InputError
from scenarios.studies.design import budget_document, load_budget, to_budget
from sensor.laboratory.bench import Bench
from sensor.laboratory.emva import measure_camera
from sensor.laboratory.figure import photon_transfer_figure
from tests.sensor.laboratory.linear_camera import LinearPixels

DESIGN = ("design", "dynamic-range")
SMALL = ("--set", "temperature=25 degC", "--set", "circuit_noise=0.1 mV", "--set", "digital_gain=1")
OWN = """
title = "Two sensors"
temperature = ["0 degC", "20 degC"]
circuit_noise = "0.2 mV"
analog_gain = [1, 2]
digital_gain = 1
exposure = "0 ms"
adc_rule = "none"

[[sensor]]
name = "quiet"
full_well = "10000 e"
sensitivity = "50 uV/e"
white_noise = "3 e"
noise_temperature = "0 degC"
power = "1 W"
price = 100

[[sensor]]
name = "deep"
full_well = "100000 e"
sensitivity = "10 uV/e"
white_noise = "30 e"
power = "2 W"

[[adc]]
name = "fine"
bits = 16
full_scale = "1 V"
noise = "20 uV"
rate = "40 MHz"
power = "0.5 W"
price = 20
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "budget.toml"
    path.write_text(OWN)
    return path


def test_the_best_is_that_of_the_closed_form(viform: Callable[..., Any], own: Path) -> None:
    code, out, err = viform(*DESIGN, own, "--json")
    assert (code, err) == (0, "")
    document = json.loads(out)
    rows, best = document["rows"], document["best"]
    assert len(rows) == 2 * 1 * 2 * 1 * 2 * 1
    assert [row["dr_db"] for row in rows] == sorted((r["dr_db"] for r in rows), reverse=True)
    assert {k: best[k] for k in rows[0]} == rows[0]
    # By hand, for the quiet sensor at 0 degC and analog gain 2: the well still fits, 0.5 V x 2.
    mine = next(r for r in rows if r["sensor"] == "quiet" and r["analog_gain"] == 2
                and r["temperature"] == 0)  # fmt: skip
    volts = (3 * 50e-6) ** 2 + 0.2e-3**2 + (20e-6**2 + (1 / 65535) ** 2 / 12) / 4
    least = 0.5 + (0.25 + volts / 50e-6**2) ** 0.5
    assert mine["least_signal"] == pytest.approx(least)
    assert mine["saturation"] == pytest.approx(10_000)
    assert 10 ** (mine["dr_db"] / 20) == pytest.approx(10_000 / least)
    # Warmer white noise goes with the root of the absolute temperature.
    warm = next(r for r in rows if r["sensor"] == "quiet" and r["temperature"] == 20)
    assert warm["noise"]["sensor"] == pytest.approx(3 * (293.15 / 273.15) ** 0.5)
    assert mine["power"] == pytest.approx(1.5 + 25 * 0.05)
    assert mine["price"] == 120 and best["sensor"] == "deep" and best["price"] is None


def test_limits_rule_choices_out(viform: Callable[..., Any], own: Path) -> None:
    code, out, _ = viform(*DESIGN, own, "--set", "price=200", "--json")
    best = json.loads(out)["best"]
    assert (code, best["sensor"]) == (0, "quiet")  # the other's price is unknown
    code, out, _ = viform(*DESIGN, own, "--set", "power=1.5 W", "--json")
    assert json.loads(out)["best"] is None and code == 1
    code, out, _ = viform(*DESIGN, own, "--set", "power=1.75 W", "--json")
    assert json.loads(out)["best"]["temperature"] == 20 and code == 0
    code, out, _ = viform(*DESIGN, own, "--set", "least_signal=10 e", "--json")
    assert json.loads(out)["best"]["sensor"] == "quiet"
    code, out, _ = viform(*DESIGN, own, "--set", "clock=50 MHz")
    assert code == 1 and "converter takes 40 MS/s" in out


def test_the_rule_in_both_readings(viform: Callable[..., Any]) -> None:
    def best(rule: str) -> tuple[int, dict[str, Any]]:
        code, out, _ = viform(*DESIGN, *SMALL, "--set", f"adc_rule={rule}", "--json")
        return code, json.loads(out)

    (_, ratio), (never, decibels), (_, free) = map(best, ("ratio", "decibels", "none"))
    row = ratio["best"]["adc_rule"]
    assert row["ratio_db"] == pytest.approx(ratio["best"]["sensor_db"] + 6.0206, abs=1e-4)
    assert row["decibels_db"] == pytest.approx(2 * ratio["best"]["sensor_db"])
    # No converter of the catalogue has twice a sensor's decibels.
    assert never == 1 and decibels["best"] is None
    # What the rule alone rules out is told, and is what is best without it.
    other = ratio["best_without_rule"]
    assert other["dr_db"] == free["best"]["dr_db"] > ratio["best"]["dr_db"]
    assert free["best_without_rule"] is None


def test_measured_agrees(viform: Callable[..., Any]) -> None:
    # The seed is fixed; limits of 99 %.
    _, out, _ = viform(*DESIGN, *SMALL, "--measure", "--seed", 2, "--json")
    best = json.loads(out)["best"]
    low, high = best["measured"]["ci"]
    assert low < best["dr_db"] < high < low + 0.5


def test_text_and_picture(viform: Callable[..., Any], tmp_path: Path) -> None:
    picture = tmp_path / "dr.png"
    code, out, _ = viform(*DESIGN, "--top", 3, "--out", picture)
    assert code == 0
    lines = out.splitlines()
    assert lines[0].startswith("A hardware budget: 1440 choices")
    assert lines[1].startswith("best: ") and lines[-2].startswith("... 1437 more")
    table = lines.index(next(line for line in lines if line.startswith("sensor ")))
    name = lines[1].removeprefix("best: ").split()[0]
    assert lines[table + 1].startswith(name)
    with Image.open(picture) as image:
        assert image.width > 1000
    assert list(tmp_path.iterdir()) == [picture]
    code, *_ = viform(*DESIGN, *SMALL, "--set", "sensors=cmos-4t", "--set", "analog_gain=1",
                      "--set", "adcs=8-bit", "--out", tmp_path / "one.svg")  # fmt: skip
    assert code == 1 and (tmp_path / "one.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--set", "temperature=5 lux"], "temperature.0 must be a temperature such as '25 degC'"),
        (["--set", "temperature=[]"], "temperature must be"),
        (["--set", "analog_gain=0"], "analog_gain.0 must be at least 0.000976562, not '0'"),
        (["--set", "analog_gain=nan"], "analog_gain.0 must be"),
        (["--set", "adc_rule=maybe"], "adc_rule must be 'ratio', 'decibels' or 'none'"),
        (["--set", "sensors=none"], "sensors must be of kodak-full-frame, dalsa"),
        (["--set", "tempratur=1 degC"], "did you mean temperature?"),
        (["--set", "power=-1 W"], "power must be a power such as '2 W' and at least 0 W"),
        (["--set", "power=2 V"], "power must be a power such as '2 W'"),
        (["--set", "sensor=1"], "sensor must be"),
        (["--set", "x"], "--set must be KEY=VALUE"),
        (["--out", "a.gif"], "--out must be a name ending in .png or .svg"),
        (["--out", "nowhere/a.png"], "in a folder that exists"),
        (["."], "the budget must be a TOML file"),
        (["nowhere.toml"], "the budget must be a TOML file"),
        (["--set", f"clock={json.dumps([f'{n} MHz' for n in range(1, 99)])}"], "at most 20000"),
    ],
)  # fmt: skip
def test_bad_input(refused: Callable[..., str], arguments: list[str], says: str) -> None:
    assert says in refused(*DESIGN, *arguments)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('name = "deep"', 'name = "quiet"', "sensor.name must be unique"),
        ("bits = 16", "bits = 25", "adc.0.bits must be at most 24"),
        ('sensitivity = "10 uV/e"', 'sensitivity = "10 V"', "must be a conversion gain such as"),
        ('rate = "40 MHz"', "", "adc.0.rate must be given"),
        ('name = "fine"', 'name = "a\\nb"', "adc.0.name must be"),
        ("[[adc]]", "[adc]", "adc must be"),
        ('title = "Two', "title = Two", "the budget must be a TOML file"),
    ],
)  # fmt: skip
def test_bad_files(refused: Callable[..., str], own: Path, old: str, new: str, says: str) -> None:
    own.write_text(OWN.replace(old, new, 1))
    assert says in refused(*DESIGN, own)


words = st.sampled_from([
    "0", "-1", "1e999", "1e-320", "25 degC", "-150 degC", "150 degC", "1 e", "1e9 e", "0 e", "nan",
    "1 Hz", "100 GHz", "0 V", "1000 V", "1e-3 uV/e", "1e6 uV/e", "[", "[1, [2]]", '["1 W", 2]', "",
    "\x00", "none", "ratio", "true", "24", "8-bit", "dalsa", "1e6 W", "0.0009765625", "1024",
    "0 s", "24 hour", "999999999999999999999", "é",
])  # fmt: skip
keys = st.sampled_from([
    "title", "sensors", "adcs", "sensor", "adc", "temperature", "clock", "circuit_noise",
    "analog_gain", "digital_gain", "exposure", "adc_rule", "power", "price", "least_signal",
    "ambient", "cooler", "gamma", "output_bits", "sensor.name", "temperature.x", "a.b", "",
])  # fmt: skip


@settings(max_examples=40)
@given(st.dictionaries(keys, words | st.text(max_size=8), max_size=4))
def test_no_assignment_breaks_it(assignments: dict[str, str]) -> None:
    """A document, or one line."""
    given_ = [f"{key}={value}" for key, value in assignments.items()]
    base = ["adcs=12-bit", "temperature=25 degC", "circuit_noise=1 mV"]
    try:
        budget = to_budget(load_budget(None, [*base, *given_]))
    except InputError as exc:
        assert "\n" not in str(exc)
        return
    from cosim.run.result import dumps

    json.loads(dumps(budget_document("", budget)))


@settings(max_examples=30)
@given(st.binary(max_size=40) | st.text(max_size=40).map(lambda t: (OWN + t).encode()))
def test_no_file_breaks_it(data: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "budget.toml"
        path.write_bytes(data)
        try:
            load_budget(str(path))
        except InputError as exc:
            assert "\n" not in str(exc)


amount = st.sampled_from(["0 e", "1e-30 e", "1 e", "1e6 e"])


@given(
    st.sampled_from(["1 e", "1e9 e"]), st.sampled_from(["1e-3 uV/e", "1e6 uV/e"]), amount, amount,
    st.sampled_from(["0 e/s", "1e12 e/s"]), st.sampled_from([1, 100]),
    st.sampled_from([0.01, 3, None]), st.sampled_from(["-150 degC", "150 degC"]),
    st.sampled_from(["-150 degC", "150 degC"]), st.integers(1, 24),
    st.sampled_from(["1 uV", "1000 V"]), st.sampled_from(["0 V", "100 V"]),
    st.sampled_from([1 / 1024, 0.3, 1, 1024]), st.sampled_from(["0 V", "100 V"]),
    st.sampled_from(["0 s", "24 hour"]),
)  # fmt: skip
def test_no_extreme_part_breaks_it(
    well, sensitivity, white, transfer, dark, doubling, activation, cold, hot, bits, scale, noise,
    gain, circuit, exposure,
):  # fmt: skip
    sensor = {
        "name": "s", "full_well": well, "sensitivity": sensitivity, "white_noise": white,
        "transfer_noise": transfer, "dark_current": dark, "dark_doubling": doubling,
        "dark_temperature": cold,
    }  # fmt: skip
    if activation is not None:
        sensor["dark_activation"] = activation
    adc = {"name": "a", "bits": bits, "full_scale": scale, "noise": noise, "rate": "1 MHz"}
    budget = to_budget(load_budget(None, [
        f"sensor=[{json.dumps(sensor)}]", f"adc=[{json.dumps(adc)}]", f"temperature={hot}",
        f"circuit_noise={circuit}", f"analog_gain={gain}", f"digital_gain={gain}",
        f"exposure={exposure}",
    ]))  # fmt: skip
    from cosim.run.result import dumps

    row = json.loads(dumps(budget_document("", budget)))["rows"][0]
    assert row["dr_db"] is not None and row["dr_document_db"] is not None


def test_a_photon_transfer_is_drawn(tmp_path: Path) -> None:
    pixels = LinearPixels((16, 80), 10, 0.2, 0.6, 2e-11, 100, 2, 0.01, 8, 30)
    report = measure_camera(
        Bench(pixels, pixels.area, 0.01, (0.01, 0.1), rows=16, levels=6, frames=4, stack=8)
    )
    photon_transfer_figure(report, "a linear camera", tmp_path / "pt.png")
    with Image.open(tmp_path / "pt.png") as image:
        assert image.width > 800
