"""The tables in the sections of a display."""

from __future__ import annotations

import math

from cosim.config.amounts import amount, decibel, number, percent
from cosim.report.parts import table
from display.chain.outcome import SPIKE, DisplayOutcome
from display.probes.blur import Blur
from display.probes.latency import Latency
from display.probes.metrics import GREY, NAMES
from display.quality.flicker import FlickerFigures

_LEAST = 1e-3
"""Percentage below which a figure is the rounding of float32."""
_LIGHTS = {"sparse": "0.15 % density", "grey": "mid grey", "bright": "above full scale"}


def _share(value: float, *, sign: bool = False) -> str:
    """Text of a percentage to two digits; rounding alone is 0, and NaN ""."""
    if math.isnan(value):
        return ""
    return percent(value / 100, 2, sign=sign) if abs(value) >= _LEAST else "0 %"


def _level(value: float | None) -> str:
    return "" if value is None or math.isnan(value) else decibel(value)


def _plain(value: float, unit: str = "1") -> str:
    """Text of a figure to two digits; "" for NaN."""
    return "" if math.isnan(value) else amount(value, unit, 2 if unit == "1" else 3)


def _kinds(outcome: DisplayOutcome) -> list[tuple[str, str, str]]:
    """(display, drive, title) of every row: the spike display with each drive, first that of the
    run, then the other displays. Without probes, the spike display has one row."""
    probes = outcome.probes
    if probes is None:
        return [(name, "", outcome.title(name)) for name in outcome.displays]
    drives = [row.drive for row in probes.flicker if row.display == SPIKE]
    ordered = sorted(dict.fromkeys(drives), key=lambda drive: drive != probes.drive)
    kinds = [(SPIKE, drive, f"spikes, {drive}") for drive in ordered]
    return kinds + [(n, "", outcome.title(n)) for n in outcome.displays if n != SPIKE]


def _blur(outcome: DisplayOutcome, display: str, drive: str, edge: tuple[float, float]) -> Blur:
    assert outcome.probes is not None
    rows = outcome.probes.blur
    return next(
        r for r in rows
        if (r.display, r.drive, r.ahead, r.behind) == (display, drive, *edge)
    )  # fmt: skip


def _flicker(
    outcome: DisplayOutcome, display: str, drive: str, rate: float, area: str = "patch"
) -> FlickerFigures:
    assert outcome.probes is not None
    rows = outcome.probes.flicker
    return next(
        r.figures for r in rows
        if (r.display, r.drive, r.rate, r.area) == (display, drive, rate, area)
    )  # fmt: skip


def _latency(outcome: DisplayOutcome, display: str, drive: str, rate: float, way: str) -> Latency:
    assert outcome.probes is not None
    rows = outcome.probes.latency
    return next(
        r for r in rows
        if (r.display, r.drive, r.rate, r.way) == (display, drive, rate, way)
    )  # fmt: skip


def _time(us: float) -> str:
    """Text of a time; "never" for NaN."""
    return "never" if math.isnan(us) else amount(us * 1e-6, "s")


def display_rows(outcome: DisplayOutcome) -> list[list[str]]:
    """A row for each display: name, EBET, SVM, percent flicker, visibility, PSNR of the still and
    of the pursuing eye, median delay of mid grey, and ColorVideoVDP where it was computed. PSNR and
    ColorVideoVDP exist only for the drive of the run; PSNR needs a scene, the others probes."""
    probes, rows = outcome.probes, []
    for display, drive, title in _kinds(outcome):
        views, jod = ["", ""], math.nan
        mine = display != SPIKE or probes is None or drive == probes.drive
        if mine and outcome.fidelity:
            views = [_level(outcome.fidelity_of(display, who).psnr) for who in ("eye", "pursuit")]
            jod = outcome.jod.get(display, math.nan)
        probed, delay = ["", "", "", ""], ""
        if probes is not None:
            flicker = _flicker(outcome, display, drive, GREY)
            blur = _blur(outcome, display, drive, (0.0, GREY)).ebet
            probed = [
                _plain(blur, "s"), _plain(flicker.svm), _share(flicker.percent),
                _plain(flicker.visibility),
            ]  # fmt: skip
            delay = _time(_latency(outcome, display, drive, GREY, "rise").total.median)
        rows.append([
            title, *probed, *views, delay,
            *([_plain(jod, "JOD")] if outcome.jod else []),
        ])  # fmt: skip
    return rows


def display_table(outcome: DisplayOutcome) -> str:
    """HTML of the table of all displays."""
    head = [
        "display", "blur (EBET)", "flicker (SVM)", "percent flicker", "visibility",
        "PSNR, still eye", "PSNR, pursuing eye", "delay",
        *(["ColorVideoVDP"] if outcome.jod else []),
    ]  # fmt: skip
    return table(head, display_rows(outcome))


def display_lines(outcome: DisplayOutcome) -> list[str]:
    """The same table for a terminal: blur, flicker, PSNR of both eyes, delay; [] if there is none
    of these."""
    if not outcome.fidelity and outcome.probes is None:
        return []
    head = ["display", "EBET", "SVM", "PSNR still", "pursuing", "delay"]
    rows = [[row[k] or "-" for k in (0, 1, 2, 5, 6, 7)] for row in display_rows(outcome)]
    wide = [max(len(row[k]) for row in [head, *rows]) for k in range(len(head))]
    return [
        "  ".join(cell.ljust(w) if k == 0 else cell.rjust(w)
                  for k, (cell, w) in enumerate(zip(row, wide, strict=True)))
        for row in [head, *rows]
    ] + [""]  # fmt: skip


def light_table(outcome: DisplayOutcome) -> str:
    """HTML of the table of flicker, blur and delay by luminance and drive."""
    head = [
        "light, spikes a cycle", "display", "flicker (SVM)", "percent flicker", "visibility",
        "IEEE 1789", "single pixel (SVM)", "its IEEE 1789", "blur out of the dark", "delay on",
        "delay off",
    ]  # fmt: skip
    rows: list[list[str]] = []
    probes = outcome.probes
    assert probes is not None
    edges = {(r.ahead, r.behind) for r in probes.blur}
    for rate in dict.fromkeys(r.rate for r in probes.latency):
        name = f"{number(rate)}, {_LIGHTS.get(NAMES[rate], NAMES[rate])}"
        kinds = [kind for kind in _kinds(outcome) if not kind[0].endswith(" Hz")]
        for n, (display, drive, title) in enumerate(kinds):
            flicker = _flicker(outcome, display, drive, rate)
            single = _flicker(outcome, display, drive, rate, "pixel")
            blur = math.nan
            if (0.0, rate) in edges:
                blur = _blur(outcome, display, drive, (0.0, rate)).ebet
            on, off = (_latency(outcome, display, drive, rate, w) for w in ("rise", "fall"))
            rows.append([
                "" if n else name, title, _plain(flicker.svm), _share(flicker.percent),
                _plain(flicker.visibility), flicker.ieee.risk, _plain(single.svm),
                single.ieee.risk, _plain(blur, "s"), _time(on.total.median),
                _time(off.total.median),
            ])  # fmt: skip
    return table(head, rows)


def band_tables(outcome: DisplayOutcome) -> tuple[str, str]:
    """HTML of two tables of fidelity by luminance, with a row for each band and a column for each
    display: PSNR and SSIM; mean and RMS of the error."""
    fidelity = {name: outcome.fidelity_of(name, "eye") for name in outcome.displays}
    some = next(iter(fidelity.values()))
    head = ["luminance", "of all pixels", *(outcome.title(name) for name in fidelity)]
    similarity, errors = [], []
    for n, band in enumerate(some.bands):
        row = [f"{number(band.low)} to {number(band.high)}", percent(band.share)]
        bands = [one.bands[n] for one in fidelity.values()]
        similarity.append([
            *row, *(f"{_level(b.psnr)}, {number(b.ssim)}" for b in bands)
        ])  # fmt: skip
        errors.append([
            *row, *(f"{_share(100 * b.bias, sign=True)}, {_share(100 * b.spread)}" for b in bands)
        ])  # fmt: skip
    return table(head, similarity), table(head, errors)
