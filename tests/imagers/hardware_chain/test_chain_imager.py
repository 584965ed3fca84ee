"""The hardware chain as an imager: its frames against the closed forms of document 004."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any, cast, get_args

import cv2
import numpy as np
import pytest
import zarr

from cosim import InputError
from imagers.catalogue import IMAGERS
from imagers.common.model import measure_frame
from imagers.common.scenery import Still
from imagers.hardware_chain.model import HardwareChainModel
from imagers.hardware_chain.pixels import strongest_stripes
from imagers.hardware_chain.section import HardwareChainSection
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.scenario import ImagerScenario
from sensor.dynamic_range import CONVERTERS, SENSORS, Mapping, decibels
from sensor.frame_pixels import Exposed

BARE: dict[str, Any] = {
    "circuit_noise": "0 V",
    "own_adc": {"name": "ideal", "bits": 16, "full_scale": "1.05 V", "rate": "100 MHz"},
}
"""The sensor alone: no circuit noise, a converter without noise of its own."""


def model(**keys: Any) -> HardwareChainModel:
    given = {"kind": "hardware-chain", "rows": 128, "columns": 128, "exposure": "1 ms"}
    return HardwareChainModel(HardwareChainSection.model_validate(given | keys))


def frames(made: HardwareChainModel, lux: float, count: int = 1) -> list[Any]:
    imager, effects = made.make(), frozenset(made.pixels.effects)
    scene, stop = Still(np.full(made.shape, lux)), made.timing.ready(count - 1)
    return list(imager.film(scene, stop, seed=3, kept=effects))


def measured_range(made: HardwareChainModel, count: int = 8) -> float:
    flood = 4 * made.chain.saturation / made.pixels.responsivity / made.section.exposure
    taken = [*frames(made, 0.0, count), *frames(made, flood)]
    noise, full = made.measured([measure_frame(frame) for frame in taken])
    assert noise and full
    return decibels(full / noise)


def test_the_sensor_alone_has_the_documents_64_db() -> None:
    """40 000 e over 25 e: 20 log10 1600 = 64.08 dB; 131 072 values know it to 0.017 dB."""
    assert measured_range(model(**BARE)) == pytest.approx(64.0824, abs=0.07)


@pytest.mark.parametrize(
    "keys",
    [
        {"circuit_noise": "0.5 mV"},
        {"adc": "8-bit", "analog_gain": 1.5, "circuit_noise": "8 mV"},
        {"adc": "12-bit", "analog_gain": 1.5, "digital_gain": 1.25},
        {"sensor": "cmos-3t", "temperature": "60 degC", "exposure": "50 ms"},
        {"sensor": "dalsa", "clock": "40 MHz", "adc": "16-bit"},
        {"ripple": "2 mV", "ripple_frequency": "31 kHz", "rows": 256},
    ],
)
def test_the_range_of_the_frames_is_that_of_the_design_study(keys: dict[str, Any]) -> None:
    """0.1 dB: four deviations of the noise of 131 072 values. A range that the converter limits
    loses what its scale below darkness takes, which is subtracted."""
    made = model(**keys)
    chain, pixels = made.chain, made.pixels
    if chain.limit == "sensor":
        pedestal = 0.0
    else:
        top = (1 << pixels.bits) - 1
        pedestal = decibels(1 - pixels.zero * chain.digital / top)
    # The mean dark charge is no signal: what it fills of the well is lost.
    dark = pixels.noise.dark.at(made.section.temperature) * made.section.exposure
    filled = decibels(1 - dark / chain.saturation) if chain.limit == "sensor" else 0.0
    expected = chain.over_noise + pedestal + filled
    assert measured_range(made) == pytest.approx(expected, abs=0.1)


def test_each_pixel_has_the_mean_and_variance_of_the_closed_form() -> None:
    """Mean and variance of a grey, 16 frames of 16 384 pixels, by every effect at once."""
    made = model(temperature="40 degC", exposure="20 ms", circuit_noise="0.6 mV", analog_gain=1.5)
    lux = 9000 / made.pixels.responsivity / made.section.exposure
    values = np.stack([frame.values for frame in frames(made, lux, 16)]).astype(float)
    mean, variance = made.pixels.mean_variance(lux * made.section.exposure, made.section.exposure)
    count = values.size
    assert values.mean() == pytest.approx(mean, abs=5 * math.sqrt(variance / count))
    assert values.var() == pytest.approx(variance, rel=5 * math.sqrt(2 / count))


@pytest.mark.parametrize(
    ("hertz", "per_row", "per_column"),
    [
        # A line is 176 cycles of 27 MHz. 100 kHz: 0.65185 periods a row, 0.0037037 a column; of
        # 0.65185 sampling by rows leaves -0.34815.
        (100e3, 100e3 * 176 / 27e6 - 1, 100e3 / 27e6),
        # 27 MHz and 1 %: 0.01 cycles a column, 1.76 - 2 cycles a row.
        (27.27e6, -0.24, 0.01),
        # In step with the pixel clock but for 1/176 of it: vertical stripes.
        (27e6 * (1 + 12 / 176), 0.0, 12 / 176),
    ],
)
def test_the_supplys_ripple_is_stripes(hertz: float, per_row: float, per_column: float) -> None:
    """Spatial frequency and amplitude of a dark frame's strongest wave, against f over the clocks
    of pixel and row; the wave is known to 6 sigma / (amplitude pi N sqrt N)."""
    made = model(ripple="2 mV", ripple_frequency=f"{hertz!r} Hz")
    row, column, amplitude = strongest_stripes(frames(made, 0.0)[0].values)
    if abs(per_row) > abs(per_column) and per_row < 0:
        per_row, per_column = -per_row, -per_column
    assert (row, column) == (pytest.approx(per_row, abs=3e-4), pytest.approx(per_column, abs=3e-4))
    assert made.pixels.ripple.stripes() == pytest.approx((per_row, per_column), abs=1e-9)
    # 2 mV over the step of 2 V in 14 bits.
    assert amplitude == pytest.approx(2e-3 / (2 / 16383), rel=0.02)


def test_a_late_frames_ripple_is_as_exact_as_the_firsts() -> None:
    """A frame so far on that the phase comes round again has the first frame's stripes."""
    made = model(ripple="2 mV", ripple_frequency="27.27 MHz")
    timing, ripple = made.timing, made.pixels.ripple
    again = 100 * 2**20  # 0.01 periods a clock: whole periods after 100 clocks
    late, first = (ripple.at(n, 0, 128, 128) for n in (again, 0))
    assert timing.frame * again > 2**40
    np.testing.assert_allclose(late, first, atol=1e-12)


def test_rows_are_exposed_and_read_one_after_another() -> None:
    """Row 0 of the second frame is read a frame of 128 lines of 176 clocks after that of the
    first; the exposure is 27 000 clocks, more than the readout."""
    made = model()
    one, two = frames(made, 0.0, 2)
    assert two.end[0] - one.end[0] == one.exposure == 1_000_000_000
    assert one.end[1] - one.end[0] == 176 * 10**6 // 27
    assert one.ready == (27_000 + 128 * 176) * 10**6 // 27
    assert made.timing.frames(one.ready - 1) == 0 and made.timing.frames(two.ready) == 2


def test_tones_are_the_mapping_of_the_light() -> None:
    """Saturation is code 255 and darkness 0; a quarter of saturation reads 255 / 4^(1/gamma)."""
    for gamma in (1.0, 2.2):
        made = model(**BARE, gamma=gamma)
        pixels = made.pixels
        light = np.array([[0.0, 0.25, 1.0]]) * made.chain.saturation / pixels.responsivity
        values = pixels.convert(Exposed(light, np.ones(1), np.zeros(1), 0, 0), 1, frozenset())
        codes = made.picture(values, 16)[0]
        assert list(codes) == [0, round(255 * 0.25 ** (1 / gamma)), 255]
        assert made.mapping == Mapping(gamma, 8)


def test_the_schema_names_the_parts_of_the_catalogue() -> None:
    fields = HardwareChainSection.model_fields
    assert get_args(fields["sensor"].annotation) == tuple(part.name for part in SENSORS)
    assert get_args(fields["adc"].annotation) == tuple(part.name for part in CONVERTERS)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"clock": "70 MHz", "adc": "12-bit"}, "imager.clock must be at most 60000000 Hz"),
        (
            {"own_adc": BARE["own_adc"] | {"rate": "138 Hz"}},  # below the slowest clock
            "imager.own_adc.rate must be at least 27000000 Hz, imager.clock, not 138 Hz; raise it",
        ),
        ({"own_adc": BARE["own_adc"] | {"bits": 20}}, "imager.own_adc.bits must be at most 16"),
        ({"frame_rate": "1001 Hz"}, "imager.frame_rate must be at most 1000 Hz"),
        ({"black": 20000}, "imager.black must be below full scale"),
    ],
)
def test_hardware_that_does_not_work_is_refused(keys: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        model(**keys).make()
    with pytest.raises(InputError, match="one with registers"):
        model().make().write("exposure", 1)


def test_a_bound_holds_what_leaving_an_effect_out_does() -> None:
    """The deviation with everything and without one noise, on frames with the same draws."""
    made = model(sensor="cmos-3t", exposure="20 ms", circuit_noise="1 mV")
    summary = made.pixels.summary((0.0, 0.0), (0.02, 0.02), 1)
    rows = Exposed(np.zeros(made.shape), np.full(128, 0.02), np.zeros(128), 0, 0)
    every = frozenset(made.pixels.effects)
    full = made.pixels.convert(rows, 1, every).astype(float)
    for name in ("reset noise", "white noise", "circuit noise", "converter noise", "dark current"):
        less = made.pixels.convert(rows, 1, every - {name}).astype(float)
        change = 1 - less.std() / full.std()
        bound = made.pixels.effects[name].bound(summary).value
        if name == "dark current":
            change = max(change, abs(1 - less.mean() / full.mean()))
        assert change == pytest.approx(bound, abs=0.02), name
    none = replace(made.pixels, ripple=replace(made.pixels.ripple, volts=0.0))
    assert none.effects["supply ripple"].bound(summary).value == 0


def test_the_shipped_scenario_measures_its_own_range(viform: Any, tmp_path: Path) -> None:
    """A run of 64 x 64 pixels through every stage: its frames, pictures, metrics and page."""
    out = tmp_path / "run"
    answer = viform(
        "run", "hardware-chain", "--out", out, "--json", "--set", "imager.rows=64", "--set",
        "imager.columns=64", "--set", "imager.frame_rate=100 Hz", "--trace", tmp_path / "t.vcd",
    )  # fmt: skip
    document = json.loads(answer.out)
    assert (answer.code, document["outcome"]) == (0, "ok")
    figures = {name: each["value"] for name, each in document["metrics"].items()}
    # 10 dark frames of 4096 values: 0.03 dB; the plan leaves out up to 1 %.
    assert figures["dynamic_range"] == pytest.approx(figures["dynamic_range_formula"], abs=0.2)
    assert figures["stripes_row"] == pytest.approx(figures["stripes_row_formula"], abs=2e-3)
    assert figures["stripes_column"] == pytest.approx(figures["stripes_column_formula"], abs=2e-3)
    amplitude = figures["stripes_amplitude_formula"]
    assert figures["stripes_amplitude"] == pytest.approx(amplitude, rel=0.05)
    # The pictures are tone-mapped: by a gamma of 2.2 from darkness to 40 000 e.
    last = sorted((out / "images").glob("*.png"))[-1]
    values = zarr.open_group(out / "frames.zarr", mode="r")["values"][int(last.stem[-5:])]
    section = cast(ImagerScenario, load(str(out / "scenario.toml"))[1]).imager
    assert isinstance(section, HardwareChainSection)
    light = (values - HardwareChainModel(section).pixels.zero) / (40_000 * 25e-6 / (2 / 16383))
    codes = np.rint(np.clip(light, 0, 1) ** (1 / 2.2) * 255)
    np.testing.assert_array_equal(cv2.imread(str(last), cv2.IMREAD_UNCHANGED), codes)
    page = (out / "report.html").read_text()
    assert "A frame without light" in page and "Tones" in page
    assert "frame_valid" in (tmp_path / "t.vcd").read_text()
    assert IMAGERS["hardware-chain"].number is None
