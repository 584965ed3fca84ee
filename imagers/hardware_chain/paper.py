"""Document 004 (a patent): dynamic range of an electro-optical system from a hardware model.

Noises, saturation and stripes are measured on frames of the imager, as on a bench: in the dark, and
in far too much light.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from cosim import PS
from cosim.run.printed import PrintedRow, number, unprinted
from imagers.common.model import FrameFigures, measure_frame
from imagers.common.scenery import Still
from imagers.hardware_chain.model import HardwareChainModel
from imagers.hardware_chain.pixels import strongest_stripes
from imagers.hardware_chain.section import HardwareChainSection
from sensor.dynamic_range import (
    DALSA,
    KODAK,
    Converter,
    as_ratio,
    bits_for,
    converter_rule,
    decibels,
    document_dynamic_range,
    gain_counted_once,
    sensor_dynamic_range,
)

_HERTZ: Final = 27e6
"""Pixel clock of the example in the text, Hz; the figure has 28 MHz."""
_SIDE: Final = 1024
"""Rows and columns on which the example is measured."""
_FRAMES: Final = 5
"""Frames without light of the example: 5e6 values know its noise to 0.003 dB."""
_PEDESTAL: Final = 0.2
"""dB that the converter's scale below darkness may take of a range that the converter limits."""


def dynamic_range_rows() -> list[PrintedRow]:
    """The rows of all numbers, in order."""
    return [*_example(), *_laws(), *_wells(), *_ripple(), *_converter(), *_formula()]


def _model(side: int, **keys: Any) -> HardwareChainModel:
    """The chain with a converter of 16 bits and no noise of its own; without other keys the
    document's example, with no circuit noise."""
    adc = {"name": "16 bits", "bits": 16, "full_scale": "1.05 V", "rate": "100 MHz"}
    given = {
        "kind": "hardware-chain", "rows": side, "columns": side, "clock": f"{_HERTZ:g} Hz",
        "own_adc": adc | keys.pop("adc", {}), "circuit_noise": "0 V", "exposure": "1 ms",
    }  # fmt: skip
    return HardwareChainModel(HardwareChainSection.model_validate(given | keys))


def _filmed(model: HardwareChainModel, lux: float, frames: int) -> list[FrameFigures]:
    """Frames under even light."""
    imager, timing = model.make(), model.timing
    scene = Still(np.full(model.shape, lux))
    effects = frozenset(model.pixels.effects)
    film = imager.film(scene, timing.ready(frames - 1), seed=1, kept=effects)
    return [measure_frame(frame) for frame in film]


def _measured(model: HardwareChainModel, frames: int = 1) -> tuple[float, float, float]:
    """Noise in the dark and saturation, e, and the dynamic range, dB."""
    flood = 4 * model.chain.saturation / model.pixels.responsivity / model.section.exposure
    noise, full = model.measured([*_filmed(model, 0.0, frames), *_filmed(model, flood, 1)])
    assert noise is not None and full is not None
    return noise, full, decibels(full / noise)


def _example() -> list[PrintedRow]:
    part = KODAK
    noise, full, measured = _measured(_model(_SIDE), _FRAMES)
    db, at_28 = (
        sensor_dynamic_range(part.full_well, part.noise.at(part.noise.celsius, hertz))
        for hertz in (_HERTZ, 28e6)
    )
    rule = converter_rule(db, Converter(16, 2.0))
    return [
        number("004 §1", "noise of the example at 27 MHz", "25", noise, "e",
               note="of frames without light; white and transfer noise, whose shares are assumed",
               by="component"),
        number("004 §1", "electrons at saturation", "40000", full, "e",
               note="of a frame in four times the light", by="component"),
        number("004 §1", "dynamic range of the example", "64.08", measured, "dB",
               note=f"of these frames, {_SIDE**2 * _FRAMES:.2g} values", by="component"),
        number("004 fig. 2", "pixel clock of the example, in the figure's title", "28",
               part.noise.hertz * 1e-6, "MHz",
               proof=round(db, 2) == 64.08 and round(at_28, 2) != 64.08,
               note="the document contradicts itself: 27 MHz in its text. With its own square "
               f"root of frequency 28 MHz would give {at_28:.2f} dB; 27 MHz is used",
               by="constant"),
        number("004 claim 1", "dynamic range of the converter over the sensor's, more than", "2",
               as_ratio(rule.as_ratio - rule.sensor),
               note=f"as a ratio: {rule.as_ratio:.2f} dB, {bits_for(rule.as_ratio)} bits; twice "
               f"the decibels would be {rule.as_decibels:.1f} dB, {bits_for(rule.as_decibels)} "
               "bits, which no converter at such a clock has", by="formula"),
    ]  # fmt: skip


def _power(part: str, warm: bool) -> float:
    """Exponent with which a part of the noise grows with absolute temperature (`warm`) or with the
    clock: of frames without light at -40 and 60 degrees Celsius, or 20 and 80 MHz, of a sensor with
    100 e of that noise alone. The frames have the same random numbers."""
    own = {
        "name": "one noise", "full_well": "40000 e", "sensitivity": "25 uV/e",
        **({"dark_current": "100 e/s"} if part == "dark" else {f"{part}_noise": "100 e"}),
    }  # fmt: skip
    key, low, high, ratio = (
        ("temperature", "-40 degC", "60 degC", 333.15 / 233.15) if warm
        else ("clock", "20 MHz", "80 MHz", 4.0)
    )  # fmt: skip
    seconds = "1 s" if part == "dark" else "1 ms"
    spreads = [
        _filmed(_model(128, own_sensor=own, exposure=seconds, **{key: text}), 0.0, 1)[0].spread
        for text in (low, high)
    ]
    return math.log(spreads[1] / spreads[0]) / math.log(ratio)


def _laws() -> list[PrintedRow]:
    where = "of the spread of frames without light"
    return [
        number("004 §1", "power of the temperature by which reset noise grows", "0.500",
               _power("reset", True), note=where, by="component"),
        number("004 §1", "power of the temperature by which white noise grows", "0.500",
               _power("white", True), note=where, by="component"),
        number("004 §1", "the same of dark noise: more", "0.500", _power("dark", True),
               relation=">", note=where, by="component"),
        number("004 §1", "power of the clock by which transfer noise grows", "0.500",
               _power("transfer", False), note=where, by="component"),
    ]  # fmt: skip


def _wells() -> list[PrintedRow]:
    full = float(DALSA.response(1e6)) * 1e3
    levels = [n / 1000 for n in range(1, 5000)]
    linear = max(x for x in levels if float(DALSA.response(x)) == x) * 1e3
    return [
        number("004 §1", "full well of the DALSA example", "3400", full, "mV",
               note="the maximum of its response", by="constant"),
        number("004 §1", "its linear full well", "2500", linear, "mV",
               note="the end of the linear response; the two differ by "
               f"{DALSA.output_gain:.2f} dB", by="constant"),
    ]  # fmt: skip


def _ripple() -> list[PrintedRow]:
    """Stripes of a ripple near the pixel clock."""
    model = _model(256, ripple="1 mV", ripple_frequency="27.54 MHz", blanking=16)
    imager = model.make()
    effects = frozenset(model.pixels.effects)
    for _ in imager.film(Still(np.zeros(model.shape)), PS // 50, seed=1, kept=effects):
        pass
    assert imager.dark is not None
    row, column, amplitude = strongest_stripes(imager.dark)
    # The document has the frequencies beside each other; the closed form is their difference.
    s = model.section
    beat = s.ripple_frequency / s.clock - 1
    turns = (s.columns + s.blanking) * beat
    angle = math.degrees(math.atan2(row, column))
    expected = math.degrees(math.atan2(turns - round(turns), beat))
    volts = amplitude / model.pixels.slope * model.chain.sensitivity
    good = abs(angle - expected) < 0.5 and math.isclose(volts, s.ripple, rel_tol=0.03)
    return [
        unprinted("004 §1", "slant of the stripes of a ripple 2 % above the output frequency",
                  angle, "deg", holds=good,
                  note="of a dark frame's spectrum; the rows' and columns' beat gives "
                  f"{expected:.2f} deg; amplitude {volts * 1e3:.3f} mV of {s.ripple * 1e3:g} mV",
                  by="component"),
    ]  # fmt: skip


def _converter() -> list[PrintedRow]:
    """The document's chain without circuit and converter noise equals the sensor."""
    s = KODAK.sensitivity
    noise = KODAK.noise.at(KODAK.noise.celsius, _HERTZ)
    alone = document_dynamic_range(KODAK.full_well * s, s, noise, 0.0, 1.0, 1.0, 0.0)
    return [
        number("004 formula", "no circuit, no converter noise, gains of 1: the sensor's", "64.08",
               alone, "dB",
               note="the printed formula is garbled; read as 20 log10 of both parts", by="formula"),
    ]  # fmt: skip


def _formula(m: float = 2.0, n: float = 2.0) -> list[PrintedRow]:
    """The errors of the formula: it counts gains twice, and adds noises as if they were fully
    correlated. `printed` is the value by the printed formula, `computed` that of frames."""
    s = KODAK.sensitivity
    noise = KODAK.noise.at(KODAK.noise.celsius, _HERTZ)
    inputs = (KODAK.full_well * s, s, noise, 0.0, m, n, 0.0)
    wrong, right = document_dynamic_range(*inputs), gain_counted_once(*inputs)
    scale = {"full_scale": f"{KODAK.full_well * s} V"}
    twice = _model(256, adc=scale, analog_gain=m, digital_gain=n)
    both = _model(256, circuit_noise=f"{noise * s} V")
    with_gain, with_circuit = (_measured(model, 4)[2] for model in (twice, both))
    document, quadrature = both.chain.document, both.chain.over_noise
    return [
        number("004 formula", f"analog gain {m:g}, digital gain {n:g}, no other noise",
               f"{wrong:.2f}", with_gain, "dB",
               proof=math.isclose(right - wrong, decibels(n * m), abs_tol=1e-9)
               and -_PEDESTAL < with_gain - right < 0.03,
               note="the document's error: it counts the gain in the signal and in the noise, "
               f"{decibels(n * m):.2f} dB too low; with the gain once it is {right:.2f} dB, of "
               "which the converter's scale below darkness takes a little; this is used",
               by="component"),
        number("004 formula", "circuit noise as large as the sensor's, gains of 1",
               f"{document:.2f}", with_circuit, "dB",
               proof=math.isclose(quadrature - document, decibels(math.sqrt(2)), abs_tol=0.05)
               and abs(with_circuit - quadrature) < 0.05,
               note="the document's error: independent noises add in quadrature, which is used",
               by="component"),
    ]  # fmt: skip
