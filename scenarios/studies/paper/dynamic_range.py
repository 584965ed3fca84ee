"""Document 004 (a patent): dynamic range of an electro-optical system from a hardware model."""

from __future__ import annotations

import math
from dataclasses import replace

from cosim.run.printed import Row, number
from sensor.dynamic_range import (
    DALSA,
    KODAK,
    Chain,
    Converter,
    as_ratio,
    bits_for,
    converter_rule,
    decibels,
    document_dynamic_range,
    gain_counted_once,
    sensor_dynamic_range,
)

__all__ = ["dynamic_range_rows"]

_HERTZ = 27e6
"""Pixel clock of the example in the text, Hz; the figure has 28 MHz."""


def dynamic_range_rows() -> list[Row]:
    """The rows of all numbers, in order."""
    return [*_example(), *_laws(), *_wells(), *_converter(), *_formula()]


def _example() -> list[Row]:
    part = KODAK
    noise, other = (part.noise.at(part.noise.celsius, hertz) for hertz in (_HERTZ, 28e6))
    db, at_28 = (sensor_dynamic_range(part.full_well, n) for n in (noise, other))
    rule = converter_rule(db, Converter(16, 2.0))
    return [
        number("004 §1", "noise of the example at 27 MHz", "25", noise, "e",
               note="white and transfer noise in quadrature; their shares are assumed",
               by="formula"),
        number("004 §1", "electrons at saturation", "40000", as_ratio(db) * noise, "e",
               by="formula"),
        number("004 §1", "dynamic range of the example", "64.08", db, "dB", by="formula"),
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
    """Exponent with which a part of the noise grows with absolute temperature (`warm`) or clock,
    near 25 degC and 27 MHz."""
    noise = KODAK.noise
    if part in ("reset", "white") and getattr(noise, part) == 0:
        noise = replace(noise, reset=10.0, white=10.0)
    t, f, step = noise.celsius, _HERTZ, 1e-4
    zero = t + 273.15
    at = (t + zero * step, f) if warm else (t, f * (1 + step))
    before, after = (noise.parts(*here, seconds=1.0)[part] for here in ((t, f), at))
    return math.log(after / before) / math.log1p(step)


def _laws() -> list[Row]:
    dark = _power("dark", True)
    return [
        number("004 §1", "power of the temperature by which reset noise grows", "0.500",
               _power("reset", True), by="formula"),
        number("004 §1", "power of the temperature by which white noise grows", "0.500",
               _power("white", True), by="formula"),
        number("004 §1", "the same of dark noise: more", "0.500", dark, relation=">", by="formula"),
        number("004 §1", "power of the clock by which transfer noise grows", "0.500",
               _power("transfer", False), by="formula"),
    ]  # fmt: skip


def _wells() -> list[Row]:
    full = float(DALSA.response(1e6)) * 1e3
    levels = [n / 1000 for n in range(1, 5000)]
    linear = max(x for x in levels if float(DALSA.response(x)) == x) * 1e3
    return [
        number("004 §1", "full well of the DALSA example", "3400", full, "mV",
               note="the maximum of its response", by="component"),
        number("004 §1", "its linear full well", "2500", linear, "mV",
               note="the end of the linear response; the two differ by "
               f"{DALSA.output_gain:.2f} dB", by="component"),
    ]  # fmt: skip


def _converter() -> list[Row]:
    """The document's chain without circuit and converter noise equals the sensor."""
    s = KODAK.sensitivity
    noise = KODAK.noise.at(KODAK.noise.celsius, _HERTZ)
    alone = document_dynamic_range(KODAK.full_well * s, s, noise, 0.0, 1.0, 1.0, 0.0)
    return [
        number("004 formula", "no circuit, no converter noise, gains of 1: the sensor's", "64.08",
               alone, "dB",
               note="the printed formula is garbled; read as 20 log10 of both parts", by="formula"),
    ]  # fmt: skip


def _formula(m: float = 2.0, n: float = 2.0) -> list[Row]:
    """The errors of the formula: it counts gains twice, and adds noises as if they were fully
    correlated. `printed` is the value by the printed formula."""
    s = KODAK.sensitivity
    noise = KODAK.noise.at(KODAK.noise.celsius, _HERTZ)
    inputs = (KODAK.full_well * s, s, noise, 0.0, m, n, 0.0)
    wrong, right = document_dynamic_range(*inputs), gain_counted_once(*inputs)
    plain = Converter(24, KODAK.full_well * s)
    chain = Chain(KODAK.full_well, noise, s, noise * s, plain)
    twice = Chain(KODAK.full_well, noise, s, 0.0, plain, m, n)
    return [
        number("004 formula", f"analog gain {m:g}, digital gain {n:g}, no other noise",
               f"{wrong:.2f}", right, "dB",
               proof=math.isclose(right - wrong, decibels(n * m), abs_tol=1e-9)
               and abs(twice.over_noise - right) < 1e-3,
               note="the document's error: it counts the gain in the signal and in the noise, "
               f"{decibels(n * m):.2f} dB too low; a chain of such gains has the computed value, "
               "which is used", by="formula"),
        number("004 formula", "circuit noise as large as the sensor's, gains of 1",
               f"{chain.document:.2f}", chain.over_noise, "dB",
               proof=math.isclose(chain.over_noise - chain.document, decibels(math.sqrt(2)),
                                  abs_tol=1e-3),
               note="the document's error: independent noises add in quadrature, which is used",
               by="formula"),
    ]  # fmt: skip
